"""Updates of an active curve or parameter by the term's operator, R += T · Δc or R = Σ_s c_s R_s.

A step adds the most important coefficients first if time is short (eqs. 29 to 31, Ben-Artzi 2006). Along a parameter,
whose few coefficients only approximate curves, a step sums all of them, and the image is nearly exact. A subsampled
operator adds the change to an image of all samples. The results of compressed operators
(`relume.operators.linear_operator`) are shaded exactly when the drag ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import MAX_EXACT_ROUNDING, DisplayedImage, accumulated_error, norm_of
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.jobs import Resum, TermTarget
from relume.operators.linear_operator import LinearOperator

F64 = NDArray[np.float64]

# Greatest rounding error, as a fraction of the image's norm, before an image is resummed; a frame's pixels have 9 bits.
MAX_ROUNDING = 2.0**-11
_RESUM_RATIO = 4.0  # times the rounding error of the resummed image


def step(target: TermTarget, max_coefficients: int | None) -> None:
    """Update the free curves of a term's operator toward their target.

    Args:
        max_coefficients: limit per channel; None for all.
    """
    images, material, live = target
    operator = images.operator(material, live)
    if operator is not None:
        after = advance(live.ready, live.target_bands, operator, max_coefficients)
        if after is not live.ready:
            live.set_ready(after)


def advance(
    ready: DisplayedImage, target_bands: Mapping[str, F64], operator: LinearOperator, max_coefficients: int | None
) -> DisplayedImage:
    """Return an image after one step along its basis; the same if no free curve differs.

    Args:
        ready: with basis and coefficients. target_bands: bands of each of the term's curves. (3, J) each
        operator: the operator of the coefficients. max_coefficients: limit per channel; None for all.
    """
    basis, light = ready.basis, ready.light
    if basis is None or light is None or set(ready.changed_curves(target_bands)).isdisjoint(basis.affected_curves):
        return ready
    new_bands = {**ready.bands, **{name: target_bands[name] for name in basis.affected_curves}}
    if basis.is_complete:
        return _add_change(ready, new_bands, operator, max_coefficients)
    return (
        ready.evaluate_operator(operator, basis, new_bands, light)
        if operator.is_whole
        else _add_change(ready, new_bands, operator, None)
    )


def resum_job(target: TermTarget) -> Resum | None:
    """Return the job that sums an image once from all coefficients, after steps.

    None if the operator is missing or not exact, if a few small steps leave less rounding error than a sum of all
    coefficients, or if the columns cancel so that no such sum is exact.
    """
    images, material, live = target
    ready, operator = live.ready, images.operator(material, live)
    basis, coefficients = ready.basis, ready.coefficients
    if operator is None or basis is None or coefficients is None or not (operator.is_exact and basis.is_complete):
        return None
    resum_error = accumulated_error(0.0, coefficients, operator)
    if resum_error >= ready.rounding or resum_error > MAX_EXACT_ROUNDING * norm_of(ready.image):
        return None
    key = images.operator_key(material, live, basis, live.target_bands)
    return Resum(
        target, (*key, "resummed"), ready, lambda image: operator.write_image(coefficients, image), resum_error
    )


def _add_change(
    ready: DisplayedImage, new_bands: Mapping[str, F64], operator: LinearOperator, max_coefficients: int | None
) -> DisplayedImage:
    """Add T · Δc; resum if the rounding error is too large."""
    assert ready.basis is not None
    assert ready.coefficients is not None
    current, exact = ready.coefficients, ready.basis.coefficients(new_bands)
    change = exact - current
    budget = change.size if max_coefficients is None else change.size // change.shape[-1] * max_coefficients
    if np.count_nonzero(change) > budget:
        weight = np.abs(change) * operator.importance
        change[weight < np.partition(weight.ravel(), -budget)[-budget]] = 0.0
        exact = np.where(change == 0, current, exact)  # a sum would leave a remainder
        # no curve is shown exactly
        undefined = {name: np.full_like(new_bands[name], np.nan) for name in ready.basis.affected_curves}
        new_bands = {**new_bands, **undefined}
    norm = norm_of(ready.image)
    operator.add(change, ready.image)
    rounding = float(np.hypot(ready.rounding, accumulated_error(norm, change, operator)))
    after = replace(ready, bands=new_bands, coefficients=exact, rounding=rounding)
    if not operator.is_exact:  # shaded when the drag ends
        return replace(
            after, fidelity=min(ready.fidelity, Fidelity.NEARLY_EXACT if operator.is_whole else Fidelity.COARSE)
        )
    resum_error = accumulated_error(0.0, exact, operator)
    if rounding > max(MAX_ROUNDING * norm, _RESUM_RATIO * resum_error):
        operator.write_image(exact, after.image)
        after = replace(after, rounding=resum_error, fidelity=Fidelity.EXACT)
    return after.downgrade_if_inexact()
