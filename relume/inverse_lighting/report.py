"""Residuals of a solution: of all marked pixels, and of each stroke that could not be reached."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.inverse_lighting.painting import Region
from relume.inverse_lighting.sources import Sources

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Cause = Literal["locked", "no_light", "conflict"]
MAX_MEAN_ERROR = 0.07
"""A stroke counts as reached if the relative error of its mean color is at most this, a tenth of a stop."""
MAX_RESIDUAL = 0.1
"""A reference picture counts as reached up to this relative RMS error."""
_LIT = 1e-4  # relative luminance that a light needs in a region to count there


@dataclass(frozen=True)
class Shortfall:
    """A region of the target that cannot be reached.

    Attributes:
        region: its index. residual: relative RMS error.
        cause: all lights that reach it are `locked`; `no_light` reaches it; or the lights that do reach other pixels,
            too, and have other colors (`conflict`).
        asked_stops, reached_stops: change of its mean luminance; None if it was or becomes black.
    """

    region: int
    residual: float
    cause: Cause
    asked_stops: float | None
    reached_stops: float | None


def residual(
    image: Shaped[F32, "height width 3"], radiance: Shaped[F32, "height width 3"], weights: Shaped[F32, "height width"]
) -> float:
    """Return the weighted RMS difference of an image and a target, relative to the target.

    Args:
        image: radiance. radiance: of the target. weights: of the pixels.
    Returns:
        0 without weights; the absolute difference if the target is black.
    """
    w = np.where(np.isfinite(radiance).all(axis=-1), weights, 0.0).astype(np.float64)[..., None]
    wanted = np.where(w > 0.0, radiance, 0.0)
    if not w.any():
        return 0.0
    error, size = np.sum(w * np.square(image - wanted)), np.sum(w * np.square(wanted))
    return math.sqrt(error / size) if size > 0.0 else math.sqrt(error / (3.0 * w.sum()))


def shortfalls(
    sources: Sources,
    images: tuple[Shaped[F32, "height width 3"], Shaped[F32, "height width 3"]],
    is_free: Shaped[NDArray[np.bool_], " sources"],
    radiance: Shaped[F32, "height width 3"],
    regions: Sequence[Region],
) -> list[Shortfall]:
    """Return the regions of a target that are not reached.

    Args:
        sources: the sources. images: the current one, and that of the solution. is_free: as in `solve_strengths`.
        radiance: of the target. regions: of the target.
    """
    before, after = images
    unreached = []
    for k, region in enumerate(regions):
        if not _is_reached(after, radiance, region):
            asked, reached = (_stops(before, image, region.weights) for image in (radiance, after))
            cause = _cause(sources, is_free, region.weights)
            unreached.append(Shortfall(k, residual(after, radiance, region.weights), cause, asked, reached))
    return unreached


def _is_reached(image: F32, radiance: F32, region: Region) -> bool:
    if region.kind == "reference":
        return residual(image, radiance, region.weights) <= MAX_RESIDUAL
    difference, wanted = (_sum(each, region.weights) for each in (image - radiance, radiance))
    return float(np.linalg.norm(difference)) <= MAX_MEAN_ERROR * float(np.linalg.norm(wanted))


def _sum(image: F32, weights: F32) -> Shaped[F64, " 3"]:
    pixels = np.where(weights[..., None] > 0.0, image, 0.0).reshape(-1, 3)
    return np.asarray(weights.reshape(-1).astype(np.float64) @ pixels)


def _cause(sources: Sources, is_free: NDArray[np.bool_], weights: F32) -> Cause:
    light = luminance(np.einsum("cshw,hw->sc", sources.images, weights))
    whole = luminance(sources.images.mean(axis=(2, 3)).T) * weights.sum()
    reaches = light > _LIT * whole
    if not reaches.any():
        return "no_light"
    return "conflict" if (reaches & is_free).any() else "locked"


def _stops(before: F32, after: F32, weights: F32) -> float | None:
    y_before, y_after = (float(luminance(_sum(image, weights).astype(np.float32))) for image in (before, after))
    return math.log2(y_after / y_before) if min(y_before, y_after) > 0.0 else None
