"""What a term's operator is made of: all of its samples in float32 where the memory has room for that, else less.

Where an operator would take a hand's patience, a rough one is there first, by which the picture goes on
(docs/adr/0089-operators-of-merged-lights.md).

What a hand is on is followed whatever the picture's size. An operator along a curve of 256 bands takes 3 kB a sample,
6.4 GB where a material fills 1920×1080 pixels. In 16 bits it is half of that, to 10⁻⁴; where that is too much, one
sample of each square of pixels says how the picture changes. At rest every sample is shaded
(docs/adr/0083-operators-of-some-samples.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.operators.frozen import Frozen, frozen_bytes, packed_bytes
from relume.operators.packed import Packed
from relume.operators.thin import NUM_NEAR, Thin, thin_bytes
from relume.parallel import num_threads
from relume.picture.material_image import MaterialImage
from relume.project.receivers import GatherRays, Rays, Receivers
from relume.views.sharing import sharing
from relume.views.squares import nearest, one_of_each_square
from relume.views.view import View

_SPARE = 8  # of the budget, left beside a packed one: an image that is shaded at rest must not push it out
_SHARE = 2  # an operator of some samples takes the budget over this: images have room beside it, another one follows
_LARGEST_STEP = 8
_FEWEST = 256  # samples; fewer do not say where a highlight is
_LONG = 12_000_000  # pairs of samples and lights a thread, of which it takes a third of a second and more
_FEW = 800  # lights, of which less than half would be left to merge into
_SOFT = 0.05  # pixels²; what a chosen sample's own neighbours have of it


class Form(NamedTuple):
    """What an operator is made of.

    Attributes:
        step: one sample of each square of so many pixels; 1: all. is_packed: in 16 bits.
        is_rough: of merged lights.
    """

    step: int
    is_packed: bool
    is_rough: bool = False

    def num_bytes(self, material: MaterialImage, num_columns: int) -> int:
        """Memory that it takes of a material's term. num_columns: in each channel."""
        if self.step > 1:
            return thin_bytes(material.num_samples, material.num_squares(self.step), num_columns)
        return (packed_bytes if self.is_packed else frozen_bytes)(material.num_samples, num_columns)


EXACT = Form(1, is_packed=False)
PACKED = Form(1, is_packed=True)
ROUGH = Form(1, is_packed=False, is_rough=True)


def form_for(material: MaterialImage, num_columns: int, budget_bytes: int) -> Form | None:
    """The best form of an operator that fits; None where none does, and the hand has to be waited for.

    Args:
        material: whose samples. num_columns: of the operator, in each channel. budget_bytes: of the memory.
    """
    if EXACT.num_bytes(material, num_columns) <= budget_bytes:
        return EXACT
    if PACKED.num_bytes(material, num_columns) <= budget_bytes - budget_bytes // _SPARE:
        return PACKED
    for step in range(2, _LARGEST_STEP + 1):
        form = Form(step, is_packed=True)
        if form.num_bytes(material, num_columns) <= budget_bytes // _SHARE:
            return form if material.num_squares(step) >= _FEWEST else None
    return None


def comes_roughly(material: MaterialImage, num_columns: int, num_lights: int, budget_bytes: int) -> bool:
    """Whether an exact operator takes so long to be made that a rough one is to be there first, and both fit.

    Args:
        material, num_columns, budget_bytes: as in `form_for`. num_lights: that its samples may see.
    """
    is_long = num_lights >= _FEW and material.num_samples * num_lights > _LONG * num_threads()
    return is_long and 2 * EXACT.num_bytes(material, num_columns) <= budget_bytes


def freeze_some(
    view: View, material: int, step: int, receivers: Receivers, freeze: Callable[[Receivers], Frozen | Packed]
) -> Thin:
    """An operator of one sample of each square of pixels.

    Args:
        view: whose samples. material: its index. step: side of a square.
        receivers: all samples of the material, with what arrives at them.
        freeze: makes the operator of those that are chosen.
    """
    chosen = one_of_each_square(view, material, step)
    near, weight = nearest(view, material, chosen, step, NUM_NEAR, _SOFT)
    return Thin(freeze(_chosen(view, material, step, receivers, chosen)), len(chosen), near, weight)


def _chosen(view: View, material: int, step: int, receivers: Receivers, chosen: NDArray[np.intp]) -> Receivers:
    """Some of a material's samples, which share gather rays as those of a picture do that is as much smaller."""
    some = receivers.some(chosen)
    y, x = np.divmod(view.pixel[view.rows(material)][chosen], np.uint32(view.width))
    width = -(-view.width // step)
    square = (y // step * width + x // step).astype(np.uint32)

    def shared(few: Rays, whole: Rays) -> Rays:
        if not (isinstance(few, GatherRays) and isinstance(whole, GatherRays) and whole.sharing is not None):
            return few
        return replace(few, sharing=sharing(square, width, some.points, whole.sharing.even.times))

    return replace(some, rays=tuple(map(shared, some.rays, receivers.rays)))
