"""The visible region of an image becomes exact first: its samples are shaded before all others.

If a large image is zoomed or exceeds its window, most samples are not visible. Partial results are cached, so the
complete image costs no more.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity, FidelityLabel
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback, Shade, TermTarget
from relume.operators.shade import ShadedTerm
from relume.views.view import Tile

F32 = NDArray[np.float32]

_MIN_HIDDEN_SAMPLES = 20_000  # samples outside the region; with fewer, an extra frame does not pay off


@dataclass(frozen=True, eq=False)
class ShadeRegion:
    """Shade the samples of a term in a region first.

    Attributes:
        whole: the job of the complete image. region: x, y, width, height in pixels.
    """

    whole: Shade
    region: Tile
    state: Literal["precomputing", "shading"] = "shading"
    is_resumable = True

    @property
    def label(self) -> str:
        """Text for the user."""
        return self.whole.label

    @property
    def key(self) -> tuple[Hashable, ...]:
        """See `Job`."""
        return (*self.whole.key, "region", self.region)

    @property
    def is_refinement(self) -> bool:
        """See `Job`."""
        return self.whole.is_refinement

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Shaped[F32, "n 3"]:
        """See `Job`. Returns rows of the image, valid in the region."""
        return self.whole.shade_samples(self.whole.target.material.lies_in(self.region), progress, is_canceled)

    def install(self, result: Shaped[F32, "n 3"]) -> None:
        """See `Job`; replaces the samples in the region."""
        images, material, live = self.whole.target
        key = images.image_key(material, live, live.light)
        if not self.whole.target.exists() or self.whole.key != key or not _allows_partial(live.ready, live.light):
            return
        image = with_samples(live.ready.image, result, material.lies_in(self.region))
        live.set_ready(replace(live.ready, image=image, exact_region=(key, self.region)))


def _allows_partial(ready: DisplayedImage, light: Illumination) -> bool:
    """Return whether a part of an image may be replaced: it is shown in this light, and no steps are added to it."""
    return ready.fidelity in (Fidelity.PREVIEW, Fidelity.INCREMENTAL) and ready.light == light


def with_samples(
    image: Shaped[F32, "tiles 3 lanes"], rows: Shaped[F32, "n 3"], mask: Shaped[NDArray[np.bool_], " n"]
) -> Shaped[F32, "tiles 3 lanes"]:
    """Return a copy of an image with some samples replaced.

    Args:
        image: the image. rows: new values, float32. mask: the samples to replace.
    """
    return ShadedTerm.from_rows(np.where(mask[:, None], rows, ShadedTerm(image).rows(len(mask)))).image


def is_exact_within(target: TermTarget, region: Tile | None) -> bool:
    """Return whether the newest image of a term is exact in a region, though not everywhere."""
    images, material, live = target
    exact_region = live.ready.exact_region
    if region is None or exact_region is None or not _contains(exact_region[1], region):
        return False
    return exact_region[0] == images.image_key(material, live, live.light)


def fidelity_label_in(target: TermTarget, region: Tile | None) -> FidelityLabel:
    """Return the fidelity of the displayed image of a term in a region; None: everywhere."""
    live = target.live
    is_exact = live.displayed is live.ready and is_exact_within(target, region)
    return "exact" if is_exact or not is_visible(target, region) else live.fidelity_label


def is_visible(target: TermTarget, region: Tile | None) -> bool:
    """Return whether any sample of a term's material lies in a region; None: in the image."""
    return region is None or bool(target.material.lies_in(region).any())


def make_region_job(whole: Shade, candidates: Iterable[TermTarget], region: Tile | None) -> ShadeRegion | None:
    """Return the job that shades the visible region first; None if the complete image is shaded at once.

    Args:
        whole: job of the complete image. candidates: terms to be shaded, including this one. region: the visible
            region.
    """
    images, material, live = target = whole.target
    if region is None or is_exact_within(target, region) or not _allows_partial(live.ready, live.light):
        return None
    if images.is_cached(material, live):
        return None
    num_hidden = sum(np.count_nonzero(~candidate.material.lies_in(region)) for candidate in candidates)
    is_split = 0 < np.count_nonzero(material.lies_in(region)) < material.num_samples
    return ShadeRegion(whole, region) if is_split and num_hidden > _MIN_HIDDEN_SAMPLES else None


def _contains(outer: Tile, inner: Tile) -> bool:
    (x, y, width, height), (left, top, across, down) = outer, inner
    return x <= left and y <= top and left + across <= x + width and top + down <= y + height
