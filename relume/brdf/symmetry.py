"""Symmetries of terms: rotations about the normal and reflections that leave a term unchanged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.brdf.term import Angle, Curve

F64 = NDArray[np.float64]

_TOLERANCE = 1e-6  # relative difference due to rounding
_REFLECTIONS = {"x": np.diag([-1.0, 1.0, 1.0]), "y": np.diag([1.0, -1.0, 1.0])}


def rotational_symmetry(phi: float) -> Shaped[F64, "3 3"]:
    """Rotation matrix of local directions about the normal by `phi` radians."""
    cosine, sine = np.cos(phi), np.sin(phi)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def is_isotropic(term_document: Mapping[str, Any]) -> bool:
    """True if a term is invariant under rotation about the normal and reflection of both directions."""
    declared = TERMS[term_document["model"]]
    if all(map(_is_isotropic_curve, declared.normalized(term_document).curves)):
        return _has_isotropic_quotient(declared.model, declared.fixed_values(term_document))
    return _is_invariant(lambda wi, wo: eval_brdf(term_document, wi, wo), _ISOTROPY_MAPS)


def has_reflection_symmetry(term_document: Mapping[str, Any]) -> bool:
    """True if a term is invariant under reflection of both directions along the tangent and across it."""
    return _is_invariant(lambda wi, wo: eval_brdf(term_document, wi, wo), tuple(_REFLECTIONS.values()))


_ISOTROPY_MAPS = (rotational_symmetry(1.2345), _REFLECTIONS["y"])  # an angle that no other symmetry has


def _is_isotropic_curve(curve: Curve) -> bool:
    """True if a curve's angle is invariant under rotation about the normal and reflection of both directions."""
    if curve.angle is Angle.LOBE:
        return curve.axes[0] == curve.axes[1]
    return curve.angle not in (Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)


@lru_cache(maxsize=256)
def _has_isotropic_quotient(model: str, fixed: tuple[tuple[str, float | str], ...]) -> bool:
    """True if the quotient of a term with isotropic curves is isotropic: edits of curves do not change that."""
    term = TERMS[model].normalized_by(fixed)

    def quotient(wi: F64, wo: F64) -> F64:
        return np.moveaxis(term.quotients(*np.moveaxis(wi, -1, 0), *np.moveaxis(wo, -1, 0)), 0, -1)

    return _is_invariant(quotient, _ISOTROPY_MAPS)


def _is_invariant(evaluate: Callable[[F64, F64], F64], maps: Sequence[F64]) -> bool:
    """True if a function of both directions is invariant under each of some maps, tested at random directions."""
    rng = np.random.default_rng(1)
    wi, wo = (np.abs(rng.normal(size=(256, 3))) for _ in range(2))
    wi[:128, 0] *= -1
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    reference = evaluate(wi, wo)
    scale = np.abs(reference).max() + 1e-30
    transformed = (evaluate(wi @ matrix.T, wo @ matrix.T) for matrix in maps)
    return all(np.abs(values - reference).max() <= _TOLERANCE * scale for values in transformed)
