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

from relume.operators.shade import Shaded
from relume.picture.fidelity import Fidelity, Word
from relume.picture.jobs import Cancelled, Place, Progress, Shade
from relume.picture.light import Light
from relume.picture.shown import Shown
from relume.views.view import Tile

F32 = NDArray[np.float32]

_WORTH = 20_000  # samples out of sight; shading fewer takes no longer than another frame is worth


@dataclass(frozen=True, eq=False)
class ShadeRegion:
    """The samples of a term in a region, before all others.

    Attributes:
        whole: the image that they are of. region: x, y, width, height in pixels.
    """

    whole: Shade
    region: Tile
    state: Literal["freezing", "shading"] = "shading"
    goes_on = True

    @property
    def what(self) -> str:
        """In words."""
        return self.whole.what

    @property
    def key(self) -> tuple[Hashable, ...]:
        """See `Job`."""
        return (*self.whole.key, "region", self.region)

    @property
    def refines(self) -> bool:
        """See `Job`."""
        return self.whole.refines

    def make(self, progress: Progress, cancelled: Cancelled) -> F32:
        """See `Job`. Returns rows of the image, of which those in the region are right. (n, 3)"""
        return self.whole.some(self.whole.place.material.lies_in(self.region), progress, cancelled)

    def install(self, made: F32) -> None:
        """See `Job`; samples in the region show this from now on, others what they did."""
        images, material, live = self.whole.place
        key = images.key_of_image(material, live, live.light)
        if not self.whole.place.is_there() or self.whole.key != key or not _may_be_in_parts(live.ready, live.light):
            return
        image = with_rows(live.ready.image, made, material.lies_in(self.region))
        live.put(replace(live.ready, image=image, exact_in=(key, self.region)))


def _may_be_in_parts(ready: Shown, light: Light) -> bool:
    """Whether some of an image may be exact: it is shown, in this light, and nothing is added to it."""
    return ready.fidelity in (Fidelity.PREVIEW, Fidelity.FOLLOWED) and ready.light == light


def with_rows(image: F32, rows: F32, which: NDArray[np.bool_]) -> F32:
    """A copy of an image in which some samples are those of rows.

    Args:
        image: (tiles, 3, samples) float32. rows: (n, 3) float32. which: of the rows. (n,)
    """
    return Shaded.of(np.where(which[:, None], rows, Shaded(image).rows(len(which)))).image


def is_exact_in(place: Place, region: Tile | None) -> bool:
    """Whether what a term has ready is exact in a region of the picture, though not in all of it."""
    images, material, live = place
    found = live.ready.exact_in
    if region is None or found is None or not _contains(found[1], region):
        return False
    return found[0] == images.key_of_image(material, live, live.light)


def word_in(place: Place, region: Tile | None) -> Word:
    """How near what is shown of a term in a region is to its look; None: in all of the picture."""
    live = place.live
    is_shown = live.displayed is live.ready and is_exact_in(place, region)
    return "exact" if is_shown or not is_seen(place, region) else live.word


def is_seen(place: Place, region: Tile | None) -> bool:
    """Whether any sample of a term's material lies in a region; None: in the picture."""
    return region is None or bool(place.material.lies_in(region).any())


def region_first(whole: Shade, lacking: Iterable[Place], region: Tile | None) -> ShadeRegion | None:
    """What of an image is to be shaded first; None where all of it is.

    Args:
        whole: the image. lacking: terms of the picture that are shaded, this one among them. region: that is seen.
    """
    images, material, live = place = whole.place
    if region is None or is_exact_in(place, region) or not _may_be_in_parts(live.ready, live.light):
        return None
    if images.is_at_hand(material, live):
        return None
    out_of_sight = sum(np.count_nonzero(~other.material.lies_in(region)) for other in lacking)
    is_split = 0 < np.count_nonzero(material.lies_in(region)) < material.num_samples
    return ShadeRegion(whole, region) if is_split and out_of_sight > _WORTH else None


def _contains(one: Tile, other: Tile) -> bool:
    (x, y, width, height), (left, top, across, down) = one, other
    return x <= left and y <= top and left + across <= x + width and top + down <= y + height
