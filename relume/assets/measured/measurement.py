"""Measurements of other layouts on the grid of MERL files, which everything after the import works with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.measured.merl import CHANNEL_SCALE, MAX_VALUE, NOT_MEASURED, SHAPE, grid_angles, grid_directions
from relume.core.errors import MaterialError

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Measurement:
    """A measured material as planes of a MERL file, and what users should know about the conversion."""

    planes: Shaped[F64, "3 90 90 180"]
    warnings: tuple[str, ...] = ()


def sample_on_grid(
    evaluate: Callable[[F64, F64, F64], F64], max_theta: float, label: str
) -> tuple[Shaped[F64, "3 90 90 180"], float]:
    """Evaluate a BRDF at the nodes of the MERL grid whose directions are both at most `max_theta` from the normal.

    Negative channels (of colors outside Rec. 709, or noise) become zero, since negative means "not measured" there.

    Args:
        evaluate: wi, wo (n, 3) and θh, θd, φd (n, 3) of nodes -> linear Rec. 709 in 1/sr, (n, 3).
        max_theta: radians. label: name of the file, in errors.
    Returns:
        Planes of a MERL file, and the fraction of the evaluated nodes with a negative channel.
    Raises:
        MaterialError: a value is not finite or exceeds 10⁶ per steradian.
    """
    wi, wo = grid_directions()
    angles = np.stack(np.broadcast_arrays(*grid_angles()), axis=-1)
    is_covered = np.minimum(wi[..., 2], wo[..., 2]) >= np.cos(max_theta)
    planes, num_negative = np.full((3, *SHAPE), NOT_MEASURED), 0
    for h in range(SHAPE[0]):  # one slab at a time bounds the memory
        covered = is_covered[h]
        values = evaluate(wi[h][covered], wo[h][covered], angles[h][covered])
        if not np.isfinite(values).all() or float(values.max(initial=0.0)) > MAX_VALUE:
            raise MaterialError(f"{label} has values that are not finite or above {MAX_VALUE:g} per steradian")
        num_negative += int((values < 0).any(axis=-1).sum())
        planes[:, h, covered] = (np.maximum(values, 0.0) / CHANNEL_SCALE).T
    return planes, num_negative / max(int(is_covered.sum()), 1)


def coverage_warnings(max_theta: float, negative_fraction: float) -> tuple[str, ...]:
    """Warn about directions without measurement, and about colors outside Rec. 709."""
    warnings = [f"nothing was measured beyond {np.degrees(max_theta):.0f}°; the nearest values stand in there"]
    if negative_fraction >= 1e-3:
        warnings.append(
            f"{negative_fraction:.1%} of the values have a channel below zero (colors outside Rec. 709, or noise), "
            "which is zero here"
        )
    return tuple(warnings)
