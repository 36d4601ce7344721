"""The routes of a curve or a parameter that is in hand: the term's frozen operator, R += T · Δc or R = Σ_s c_s R_s.

A step adds the most important coefficients first where there is no time for all (eqs. 29 to 31, Ben-Artzi 2006). Along
a parameter, whose few coefficients say curves only nearly, a step sums all of them, and the image is near its look.
An operator of some samples (`relume.operators.thin`) adds the change of either kind to an image of all. What that and
packed columns (`relume.operators.packed`) make is shaded when the hand rests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.operators.operator import Operator
from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Place, Settle
from relume.picture.shown import MOST_IN_EXACT, Shown, length_of, rounding_of

F64 = NDArray[np.float64]

# Share of an image's length that float32 sums may have left in it before it is summed anew instead of gone on with; a
# frame's pixels have nine bits.
MAX_ROUNDING = 2.0**-11
_WORTH_SUMMING = 4.0  # times what that sum itself would leave


def step(place: Place, max_coefficients: int | None) -> None:
    """Bring the curves that a term's operator leaves free to their target, as far as the operator is there.

    Args:
        max_coefficients: of each channel, at most; None for all.
    """
    images, material, live = place
    frozen = images.operator(material, live)
    if frozen is not None:
        after = advance(live.ready, live.target, frozen, max_coefficients)
        if after is not live.ready:
            live.put(after)


def advance(ready: Shown, target: Mapping[str, F64], frozen: Operator, max_coefficients: int | None) -> Shown:
    """What an image shows after one step along its basis; the same where that leaves nothing free that differs.

    Args:
        ready: with basis and coefficients. target: bands of each of the term's curves. (3, J) each
        frozen: the operator that the coefficients are of. max_coefficients: of each channel, at most; None for all.
    """
    basis, light = ready.basis, ready.light
    if basis is None or light is None or set(ready.differing(target)).isdisjoint(basis.moves):
        return ready
    moved = {**ready.bands, **{name: target[name] for name in basis.moves}}
    if basis.is_complete:
        return _add_change(ready, moved, frozen, max_coefficients)
    return ready.summed(frozen, basis, moved, light) if frozen.is_whole else _add_change(ready, moved, frozen, None)


def settle_job(place: Place) -> Settle | None:
    """What makes of an image that was summed from steps one that was summed once from all coefficients.

    None where the operator is gone or not exact, where there is no need: a few small steps leave less than a sum of all
    coefficients, whose columns cancel; and where they cancel so that no such sum is exact.
    """
    images, material, live = place
    ready, frozen = live.ready, images.operator(material, live)
    basis, coefficients = ready.basis, ready.coefficients
    if frozen is None or basis is None or coefficients is None or not (frozen.is_exact and basis.is_complete):
        return None
    left = rounding_of(0.0, coefficients, frozen)
    if left >= ready.rounding or left > MOST_IN_EXACT * length_of(ready.image):
        return None
    key = images.key_of_operator(material, live, basis, live.target)
    return Settle(place, (*key, "settled"), ready, lambda image: frozen.write_image(coefficients, image), left)


def _add_change(ready: Shown, moved: Mapping[str, F64], frozen: Operator, max_coefficients: int | None) -> Shown:
    """Add T · Δc; where float32 sums have left too much in the image, sum all of it anew."""
    assert ready.basis is not None
    assert ready.coefficients is not None
    shown, perfect = ready.coefficients, ready.basis.coefficients(moved)
    change = perfect - shown
    budget = change.size if max_coefficients is None else change.size // change.shape[-1] * max_coefficients
    if np.count_nonzero(change) > budget:
        weight = np.abs(change) * frozen.importance
        change[weight < np.partition(weight.ravel(), -budget)[-budget]] = 0.0
        perfect = np.where(change == 0, shown, perfect)  # a sum would leave a rest to move again
        unsaid = {name: np.full_like(moved[name], np.nan) for name in ready.basis.moves}  # shows no curve exactly
        moved = {**moved, **unsaid}
    length = length_of(ready.image)
    frozen.add(change, ready.image)
    rounding = float(np.hypot(ready.rounding, rounding_of(length, change, frozen)))
    after = replace(ready, bands=moved, coefficients=perfect, rounding=rounding)
    if not frozen.is_exact:  # at rest it is shaded
        return replace(after, fidelity=min(ready.fidelity, Fidelity.NEAR if frozen.is_whole else Fidelity.COARSE))
    left = rounding_of(0.0, perfect, frozen)
    if rounding > max(MAX_ROUNDING * length, _WORTH_SUMMING * left):
        frozen.write_image(perfect, after.image)
        after = replace(after, rounding=left, fidelity=Fidelity.EXACT)
    return after.as_worn()
