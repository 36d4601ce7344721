"""measured_lv, measured_hd, measured_hf: a measured material as editable curves times a residual quotient.

    M = ρd + ρs     ρd = min(M, g g) = qd g(θi) g(θo)     ρs = M − ρd = qs f(θh) f'(θd)     eq. 18, Ben-Artzi 2006
    M = q P(θi) Q(θh) P(θo)                                                                 eq. 17, McCool 2001

M is the interpolated table of the material, per channel. Its import fits the curves; the quotients hold the rest, so
that unedited terms add up to M exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Shaped

from relume.assets.measured.interpolate import (
    NUM_KNOTS,
    THETA_D,
    THETA_H,
    THETA_I,
    THETA_O,
    QuotientKind,
    measured_over_model,
)
from relume.assets.measured.measured_store import STORE, load_material
from relume.brdf.term import F64, Angle, Curve, Params, Term
from relume.core.cache import asset_cached
from relume.core.errors import ParameterError
from relume.math.angle_bands import MAX_ANGLE

_ROWS = {Angle.THETA_I: THETA_I, Angle.THETA_H: THETA_H, Angle.THETA_D: THETA_D, Angle.THETA_O: THETA_O}


@dataclass(frozen=True, eq=False)
class MeasuredFactor:
    """A measured curve, linear between its knots; along θh in the root of the angle, like the MERL grid.

    Attributes:
        knots: one row per channel.
    """

    angle: Angle
    knots: Shaped[F64, "3 knots"]

    def __call__(self, gamma: F64) -> F64:
        """Evaluate the curve: γ in radians (...) -> (3, ...)."""
        fraction = np.clip(gamma / MAX_ANGLE, 0.0, 1.0)
        position = NUM_KNOTS * (np.sqrt(fraction) if self.angle is Angle.THETA_H else fraction)
        return np.stack([np.interp(position, np.arange(NUM_KNOTS), channel) for channel in self.knots])


def _constant(gamma: F64, params: Params) -> F64:
    """Return one at every angle: the curve of a term without data."""
    return np.ones_like(gamma)


def _without_data(*directions: object) -> NoReturn:
    raise ParameterError("data", None, "the data of a measured material that was imported")


_CURVES = {
    "theta_i": Curve("theta_i", "light angle θi", Angle.THETA_I, _constant, (), 64),
    "theta_h": Curve("theta_h", "half angle θh", Angle.THETA_H, _constant, (), 256),
    "theta_d": Curve("theta_d", "difference angle θd", Angle.THETA_D, _constant, (), 64),
    "theta_o": Curve("theta_o", "view angle θo", Angle.THETA_O, _constant, (), 64),
}


@asset_cached("measured quotient")
def _normalize(kind: QuotientKind, data: str) -> dict[str, Any]:
    """Return the quotient and curves of one material."""
    measured = load_material(data)
    knots = measured.homomorphic if kind is QuotientKind.HOMOMORPHIC else measured.lobes
    curves = tuple(replace(c, factor=MeasuredFactor(c.angle, knots[_ROWS[c.angle]])) for c in _declared_curves(kind))
    return {"quotient": partial(measured_over_model, kind, measured.table, knots), "curves": curves}


def _make_normalize(kind: QuotientKind) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    return lambda fixed: _normalize(kind, fixed["data"])


def _declared_curves(kind: QuotientKind) -> tuple[Curve, ...]:
    names = {
        QuotientKind.DIFFUSE: ("theta_i", "theta_o"),
        QuotientKind.SPECULAR: ("theta_h", "theta_d"),
        QuotientKind.HOMOMORPHIC: ("theta_h", "theta_i", "theta_o"),
    }
    return tuple(_CURVES[name] for name in names[kind])


def _term(model: str, label: str, kind: QuotientKind, source: str, texture: str, text: str) -> Term:
    return Term(
        model=model,
        label=label,
        parameters=(),
        curves=_declared_curves(kind),
        quotient=_without_data,
        source=source,
        texture=texture,
        help=text,
        normalize=_make_normalize(kind),
        num_channels=3,
        data=STORE,
    )


MEASURED_LV = _term(
    "measured_lv",
    "Measured, diffuse-like",
    QuotientKind.DIFFUSE,
    "Ben-Artzi 2006, eq. 18: ρd = q g(θi) g(θo)",
    "diffuse",
    "The component of a measured material that hardly depends on the azimuth; the rest is measured_hd.",
)
MEASURED_HD = _term(
    "measured_hd",
    "Measured, specular-like",
    QuotientKind.SPECULAR,
    "Ben-Artzi 2006, eq. 18: ρs = q f(θh) f'(θd)",
    "specular",
    "The highlight of a measured material; the rest is measured_lv.",
)
MEASURED_HF = _term(
    "measured_hf",
    "Measured, one product",
    QuotientKind.HOMOMORPHIC,
    "McCool 2001, Ben-Artzi 2006, eq. 17: ρ = q P(θi) Q(θh) P(θo)",
    "specular",
    "A whole measured material as one product; for cloth and other materials without two lobes.",
)
