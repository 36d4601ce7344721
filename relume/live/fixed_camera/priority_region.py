"""What somebody sees of a picture is exact before the rest of it: samples in a region of its pixels are shaded first.

Where a large picture is zoomed into, or does not fit its window, most of its samples are out of sight. What was shaded
of an image is kept, so that the whole of it costs no more than without.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity, FidelityLabel
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback, Shade, TermTarget
from relume.operators.shade import ShadedTerm
from relume.views.view import Tile

F32 = NDArray[np.float32]

_MIN_HIDDEN_SAMPLES = 20_000  # samples out of sight; shading fewer takes no longer than another frame is worth


@dataclass(frozen=True, eq=False)
class ShadeRegion:
    """The samples of a term in a region, before all others.

    Attributes:
        whole: the image that they are of. region: x, y, width, height in pixels.
    """

    whole: Shade
    region: Tile
    state: Literal["precomputing", "shading"] = "shading"
    is_resumable = True

    @property
    def label(self) -> str:
        """In words."""
        return self.whole.label

    @property
    def key(self) -> tuple[Hashable, ...]:
        """See `Job`."""
        return (*self.whole.key, "region", self.region)

    @property
    def is_refinement(self) -> bool:
        """See `Job`."""
        return self.whole.is_refinement

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> F32:
        """See `Job`. Returns rows of the image, of which those in the region are right. (n, 3)"""
        return self.whole.shade_samples(self.whole.target.material.lies_in(self.region), progress, is_canceled)

    def install(self, result: F32) -> None:
        """See `Job`; samples in the region show this from now on, others what they did."""
        images, material, live = self.whole.target
        key = images.image_key(material, live, live.light)
        if not self.whole.target.exists() or self.whole.key != key or not _allows_partial(live.ready, live.light):
            return
        image = with_samples(live.ready.image, result, material.lies_in(self.region))
        live.set_ready(replace(live.ready, image=image, exact_region=(key, self.region)))


def _allows_partial(ready: DisplayedImage, light: Illumination) -> bool:
    """Whether some of an image may be exact: it is shown, in this light, and nothing is added to it."""
    return ready.fidelity in (Fidelity.PREVIEW, Fidelity.INCREMENTAL) and ready.light == light


def with_samples(image: F32, rows: F32, mask: NDArray[np.bool_]) -> F32:
    """A copy of an image in which some samples are those of rows.

    Args:
        image: (tiles, 3, samples) float32. rows: (n, 3) float32. mask: of the rows. (n,)
    """
    return ShadedTerm.from_rows(np.where(mask[:, None], rows, ShadedTerm(image).rows(len(mask)))).image


def is_exact_within(target: TermTarget, region: Tile | None) -> bool:
    """Whether what a term has ready is exact in a region of the picture, though not in all of it."""
    images, material, live = target
    exact_region = live.ready.exact_region
    if region is None or exact_region is None or not _contains(exact_region[1], region):
        return False
    return exact_region[0] == images.image_key(material, live, live.light)


def fidelity_label_in(target: TermTarget, region: Tile | None) -> FidelityLabel:
    """How near what is shown of a term in a region is to its look; None: in all of the picture."""
    live = target.live
    is_exact = live.displayed is live.ready and is_exact_within(target, region)
    return "exact" if is_exact or not is_visible(target, region) else live.fidelity_label


def is_visible(target: TermTarget, region: Tile | None) -> bool:
    """Whether any sample of a term's material lies in a region; None: in the picture."""
    return region is None or bool(target.material.lies_in(region).any())


def make_region_job(whole: Shade, candidates: Iterable[TermTarget], region: Tile | None) -> ShadeRegion | None:
    """What of an image is to be shaded first; None where all of it is.

    Args:
        whole: the image. candidates: terms of the picture that are shaded, this one among them. region: that is seen.
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
