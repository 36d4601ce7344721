"""The visible region of an image becomes exact first: its samples are shaded before all others.

If a large image is zoomed or exceeds its window, most samples are not visible. Partial results are cached, so the
complete image costs no more.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.shade import ShadedTerm
from relume.views.view import Tile

F32 = NDArray[np.float32]


def replace_region(target: TermTarget, key: tuple[Hashable, ...], region: Tile, rows: Shaped[F32, "n 3"]) -> None:
    """Replace the samples of a term in a region by exact ones, if its target is still the same.

    Args:
        target: the term. key: of the exact image. region: x, y, width, height in pixels. rows: valid in the region.
    """
    images, material, live = target
    current_key = images.image_key(material, live, live.light)
    if target.exists() and key == current_key and allows_partial(live.ready, live.light):
        image = with_samples(live.ready.image, rows, material.lies_in(region))
        live.set_ready(replace(live.ready, image=image, exact_region=(key, region)))


def allows_partial(ready: DisplayedImage, light: Illumination) -> bool:
    """Return whether a part of an image may be replaced: it is shown in this light, and no steps are added to it."""
    return not ready.is_converged and ready.light == light


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


def fidelity_in(target: TermTarget, region: Tile | None) -> Fidelity:
    """Return the fidelity of the displayed image of a term in a region; None: everywhere."""
    live = target.live
    is_exact = live.displayed is live.ready and is_exact_within(target, region)
    return Fidelity.EXACT if is_exact or not is_visible(target, region) else live.fidelity


def is_visible(target: TermTarget, region: Tile | None) -> bool:
    """Return whether any sample of a term's material lies in a region; None: in the image."""
    return region is None or bool(target.material.lies_in(region).any())


def num_hidden_samples(targets: Iterable[TermTarget], region: Tile) -> int:
    """Return the number of samples of some terms outside a region."""
    return sum(int(np.count_nonzero(~target.material.lies_in(region))) for target in targets)


def _contains(outer: Tile, inner: Tile) -> bool:
    (x, y, width, height), (left, top, across, down) = outer, inner
    return x <= left and y <= top and left + across <= x + width and top + down <= y + height
