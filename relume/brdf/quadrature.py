"""Evaluation of terms at fixed pairs of directions, with cached factors that an edit does not change.

    f(ωi, ωo) = q(ωi, ωo) Π_c f_c(γ_c(ωi, ωo))

The angles γ depend only on the pairs. The quotient q depends only on a term's fixed parameters. An edit of a parameter
or a curve changes functions of one angle; each is evaluated once at a few thousand angles, cached, and interpolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curves import curve_values
from relume.brdf.evaluate import angles_numpy
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.registry import TERMS
from relume.brdf.term import F64, Angle
from relume.core.numba_options import NO_REFCOUNT

F32 = NDArray[np.float32]
Fixed = tuple[tuple[str, float | str], ...]  # from `Term.fixed_values`

_STEPS = 4096  # of a curve, densest at both ends: highlights are narrow at 0, masking falls off at π/2


class Quadrature:
    """Fixed pairs of directions.

    Args:
        wi, wo: local frame, unit, z = normal; they broadcast.
    """

    def __init__(self, wi: Shaped[F64, "*#batch 3"], wo: Shaped[F64, "*#batch 3"]) -> None:
        self.wi, self.wo = np.broadcast_arrays(np.asarray(wi, np.float64), np.asarray(wo, np.float64))
        self.shape = self.wi.shape[:-1]

    def values(self, term_document: Mapping[str, Any]) -> Shaped[F64, "channels ..."]:
        """Evaluate a term without its color, in 1/sr, without the cosine; the reference is `eval_brdf`.

        Args:
            term_document: one term of a complete look.
        Returns:
            One channel if all three are equal, else three.
        """
        declared = TERMS[term_document["model"]]
        term, fixed = declared.normalized(term_document), declared.fixed_values(term_document)
        quotient = _quotient(self, declared.model, fixed)
        curved = FrozenTerm.from_document(
            {"model": declared.model, **dict(fixed)},
            params=term_document.get("params"),
            curves=term_document.get("curves"),
        )
        active_curves = term.active_curves(term_document)
        curves = [_curve(curved, fixed, curve.name) for curve in active_curves]
        is_gray = len(quotient) == 1 and all((curve == curve[0]).all() for curve in curves)
        num_channels = 1 if is_gray else 3
        out = np.repeat(quotient, num_channels // len(quotient), axis=0)
        for curve, values in zip(active_curves, curves, strict=True):
            positions = _angle_positions(self, curve.angle, curve.axes)
            for channel in range(num_channels):
                _multiply(positions, values[channel], out[channel])
        return out.reshape(num_channels, *self.shape)


@lru_cache(maxsize=1)
def _angles() -> F64:
    """Angles γ at which curves are evaluated, in radians. (`_STEPS` + 1,)"""
    return (np.pi / 4) * (1 - np.cos(np.linspace(0, np.pi, _STEPS + 1)))


@lru_cache(maxsize=32)
def _curve(term: FrozenTerm, fixed: Fixed, name: str) -> F64:
    """Values of a term's curve at `_angles`. (3, `_STEPS` + 1)"""
    curve = TERMS[term.document["model"]].normalized_by(fixed).curve(name)
    return np.ascontiguousarray(curve_values(term.document, curve, _angles()))


@lru_cache(maxsize=32)
def _angle_positions(pairs: Quadrature, angle: Angle, axes: tuple[float, float, float]) -> F32:
    """Fractional indices into `_angles` of the angles of pairs. (pairs,)"""
    gamma = angles_numpy(angle, pairs.wi, pairs.wo, axes).ravel()
    return np.interp(gamma, _angles(), np.arange(_STEPS + 1)).astype(np.float32)


@lru_cache(maxsize=32)
def _quotient(pairs: Quadrature, model: str, fixed: Fixed) -> F64:
    """The quotient of a term at pairs. (1 or 3, pairs)"""
    values = TERMS[model].normalized_by(fixed).quotients(*np.moveaxis(pairs.wi, -1, 0), *np.moveaxis(pairs.wo, -1, 0))
    return np.ascontiguousarray(values, np.float64).reshape(len(values), -1)


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _multiply(positions, values, out):  # type: ignore[no-untyped-def]
    """Multiply each pair by a curve, with linear interpolation."""
    for n in range(out.shape[0]):
        x = positions[n]
        first = min(np.int64(x), values.shape[0] - 2)
        value = values[first]
        out[n] *= value + np.float64(x - np.float32(first)) * (values[first + 1] - value)
