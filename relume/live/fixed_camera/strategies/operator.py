"""Updates of an active curve or parameter by the term's operator, R += T · Δc or R = Σ_s c_s R_s.

A step adds the most important coefficients first if time is short (eqs. 29 to 31, Ben-Artzi 2006). Along a parameter,
whose few coefficients only approximate curves, a step sums all of them, and the image is nearly exact. A subsampled
operator adds the change to an image of all samples. The results of compressed operators
(`relume.operators.linear_operator`) are shaded exactly when the drag ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import MAX_EXACT_ROUNDING, DisplayedImage, accumulated_error, norm_of
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job
from relume.live.fixed_camera.operator_budget import EXACT, MERGED_LIGHT, operator_form, use_coarse
from relume.live.fixed_camera.strategies.operator_job import OperatorPrecompute, can_resume_from
from relume.live.fixed_camera.strategies.resum import resum_job
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.edit_basis import CurveBasis, EditBasis
from relume.operators.linear_operator import Compression, LinearOperator

F64 = NDArray[np.float64]

# Greatest rounding error, as a fraction of the image's norm, before an image is resummed; a frame's pixels have 9 bits.
MAX_ROUNDING = 2.0**-11
_RESUM_RATIO = 4.0  # times the rounding error of the resummed image


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    images, material, live = target
    return not live.is_exact() and images.operator(material, live) is not None


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    images, material, live = target
    operator = images.operator(material, live)
    if operator is not None:
        after = advance(live.ready, live.target_bands, operator, max_coefficients)
        if after is not live.ready:
            live.set_ready(live.mark_lobe(after))


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
            after, fidelity=min(ready.fidelity, Fidelity.NEAR_EXACT if operator.is_whole else Fidelity.INCREMENTAL)
        )
    resum_error = accumulated_error(0.0, exact, operator)
    if rounding > max(MAX_ROUNDING * norm, _RESUM_RATIO * resum_error):
        operator.write_image(exact, after.image)
        after = replace(after, rounding=resum_error, fidelity=Fidelity.EXACT)
    return after.downgrade_if_inexact()


def form_of(target: TermTarget, basis: EditBasis) -> Compression | None:
    """Return the operator form that fits the memory budget; None: the term is shaded instead."""
    return operator_form(target.material, basis.num_columns, target.images.cache.budget_bytes)


def missing_images(situation: Situation) -> Iterator[tuple[TermTarget, EditBasis | None]]:
    """Yield the terms whose image differs from the target and has no operator that updates it.

    Each has the basis of the operator that brings its image to the target; None if it must be shaded.
    """
    for target in situation.targets:
        live = target.live
        changed = set(live.changed_curves())
        basis = situation.control.edit_basis(live, changed)
        if not live.is_converged:
            # its operator along a curve gives the image as well, and exactly
            is_whole = basis is not None and basis.is_complete and form_of(target, basis) == EXACT
            yield target, basis if is_whole else None
        elif changed and not _continues(target, basis):
            first = next(name for name in live.target_bands if name in changed)
            new_basis = basis or CurveBasis.from_curve(live.term.curve(first))
            yield target, new_basis if _reaches_target(target, new_basis, changed) else None


def _reaches_target(target: TermTarget, basis: EditBasis, changed: set[str]) -> bool:
    """Return whether an operator would reach the target; a subsampled one excludes changes of other curves."""
    form = form_of(target, basis)
    return form is not None and (form.step == 1 or can_resume_from(target.live.ready, changed, basis))


def _continues(target: TermTarget, basis: EditBasis | None) -> bool:
    """Return whether the active operator should be reused: it covers some changed curves, and no other basis is
    better.
    """
    live = target.live
    active, changed = live.ready.basis, set(live.changed_curves())
    if active is None or changed.isdisjoint(active.affected_curves):
        return False
    if target.images.operator(target.material, live) is None:
        return False
    return changed <= set(active.affected_curves) or basis is None or not changed <= set(basis.affected_curves)


def job_for(target: TermTarget, basis: EditBasis, form: Compression) -> Job:
    """Return an operator job; a coarse operator comes first if the exact one takes long and the edit can use it.

    Args:
        target, basis, form: as in `OperatorPrecompute.for_target`.
    """
    images, material, live = target
    if form == EXACT and not images.cache.contains(images.operator_key(material, live, basis, live.target_bands)):
        lights = images.transfer.num_lights if live.light.has_direct_environment else 0
        is_merged_first = use_coarse(material, basis.num_columns, lights, images.cache.budget_bytes)
        if is_merged_first and can_resume_from(live.ready, live.changed_curves(), basis):
            form = MERGED_LIGHT
    return OperatorPrecompute.for_target(target, basis, form).job()


def _prepared_job(situation: Situation) -> Job | None:
    """Return the operator job for the prepared control.

    A parameter whose only curve has a complete operator needs no other: that operator is exact.
    """
    prepared = situation.control.prepared_control
    if prepared is None or not prepared.target.material.num_samples or prepared.basis is None:
        return None
    target, basis = prepared.target, prepared.basis
    live, active, form = target.live, target.live.ready.basis, form_of(target, basis)
    if live.changed_curves() or form is None:
        return None
    has_operator = active is not None and target.images.operator(target.material, live) is not None
    is_enough = active is not None and (
        active == basis or (active.is_complete and active.affected_curves == basis.affected_curves)
    )
    return None if has_operator and is_enough else job_for(target, basis, form)


def _exact_operator_job(situation: Situation) -> Job | None:
    """Return the job for the exact operator of a term with a coarse one; frames continue meanwhile."""
    for target in situation.targets:
        basis = target.live.ready.basis
        operator = target.images.operator(target.material, target.live)
        if basis is not None and operator is not None and operator.has_merged_lights:
            return OperatorPrecompute.for_target(target, basis, EXACT).job()
    return None


def _resum_job(situation: Situation) -> Job | None:
    """Return the job that sums an image once from all coefficients, after steps.

    None if the operator is missing or not exact, if a few small steps leave less rounding error than a sum of all
    coefficients, or if the columns cancel so that no such sum is exact.
    """
    for target in situation.targets:
        live, ready = target.live, target.live.ready
        is_stepped = live.is_converged and ready.basis is not None and ready.rounding > 0
        job = _resum_job_of(target) if is_stepped and not live.changed_curves() else None
        if job is not None:
            return job
    return None


def _resum_job_of(target: TermTarget) -> Job | None:
    images, material, live = target
    ready, operator = live.ready, images.operator(material, live)
    basis, coefficients = ready.basis, ready.coefficients
    if operator is None or basis is None or coefficients is None or not (operator.is_exact and basis.is_complete):
        return None
    resum_error = accumulated_error(0.0, coefficients, operator)
    if resum_error >= ready.rounding or resum_error > MAX_EXACT_ROUNDING * norm_of(ready.image):
        return None
    key = images.operator_key(material, live, basis, live.target_bands)
    return resum_job(target, key, partial(operator.write_image, coefficients), resum_error)


OPERATOR = Strategy(
    name="operator",
    needs="columns of the curve, or images at the nodes of the parameter",
    cost="T Δc, the largest coefficients first; along a parameter Σ c_s R_s",
    fidelity=Fidelity.EXACT,
    is_ready=_is_ready,
    update=_update,
    jobs={
        Urgency.PREPARED_CONTROL: _prepared_job,
        Urgency.BETTER_OPERATOR: _exact_operator_job,
        Urgency.REFINEMENT: _resum_job,
    },
)
