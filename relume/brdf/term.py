"""Declaration of a BRDF term: a quotient times one-dimensional curves, and the parameters that generate the curves.

Eqs. 7 and 9, Ben-Artzi 2006. A term's own file declares one `Term`; the registry lists them; sliders, validation and
`GET /api/models` are generated from the declaration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.asset_store import AssetStore

F64 = NDArray[np.float64]
Params = Mapping[str, float]


class Angle(IntEnum):
    """1-D parameterizations γ(wi, wo), each an angle in [0, π/2]; computed by `relume.brdf.angles`."""

    THETA_I = 0
    THETA_H = 1
    THETA_D = 2
    THETA_R = 3
    ALPHA = 4
    BETA = 5
    THETA_O = 6
    LOBE = 7
    TILT_X = 8
    TILT_Y = 9

    @property
    def has_highlights(self) -> bool:
        """True if curves of this angle may have a peak at zero that is narrower than a band."""
        return self in (Angle.THETA_H, Angle.THETA_R, Angle.LOBE)


@dataclass(frozen=True)
class Parameter:
    """A number that generates curves; a look gives one value, or three for separate R, G, B.

    A parameter in `Term.fixed` has one value for all channels.

    Attributes:
        unit: "" if the number has none.
        scale: scale of the slider, "linear" or "log".
        step: values are multiples of it, if given.
    """

    name: str
    label: str
    minimum: float
    maximum: float
    default: float
    unit: str
    scale: str
    help: str
    step: float | None = None


@dataclass(frozen=True)
class Curve:
    """An editable factor f(γ) of a term.

    Attributes:
        angle: argument γ of the curve; `THETA_O` curves multiply the finished pixel.
        generator: (γ in radians (...,) float64, params) -> f(γ) (...,) float64, finite and not negative.
        parameters: names of the parameters that the generator reads.
        num_bands: J, a power of two.
        label: text in the UI, e.g. "half angle θh".
        axes: factors of the components of wo before the angle is computed; other than ones for `LOBE` only.
        factor: γ in radians (...) -> (3, ...), above zero: replaces the generator if the curve is measured.
    """

    name: str
    label: str
    angle: Angle
    generator: Callable[[F64, Params], F64]
    parameters: tuple[str, ...]
    num_bands: int
    axes: tuple[float, float, float] = (1.0, 1.0, 1.0)
    factor: Callable[[F64], F64] | None = None

    @property
    def depends_on_view(self) -> bool:
        """True if it depends on wo alone and so multiplies the finished sample instead of entering the transport."""
        return self.angle is Angle.THETA_O


def _constant(gamma: F64, params: Params) -> F64:
    return np.ones_like(gamma)


VIEW = Curve("theta_o", "view angle θo", Angle.THETA_O, _constant, (), 64)
"""Additional factor of any term (Ben-Artzi 2006, section 4.4): one at every angle until it is drawn."""


@dataclass(frozen=True)
class Term:
    """One BRDF term, 1/sr without the cosine: quotient(wi, wo) · Π curves.

    Attributes:
        curves: the declared curves, plus `VIEW` if none of them has the view angle; or none at all.
        model: name in look documents.
        quotient: ufunc (wi_x, wi_y, wi_z, wo_x, wo_y, wo_z) -> value, local frame, z = normal; float32 and float64
            loops; zero if either direction is below the horizon. With three channels, three values, channels first.
        source: the equation and its paper.
        texture: the default texture channel, "diffuse" or "specular".
        fixed: parameters of the quotient or an angle, whatever curves read them: a change needs a new operator.
        normalize: `fixed_values` -> the fields of this declaration that they change; the declared fields hold for the
            defaults.
        num_channels: number of channels of the quotient, 1 or 3.
        is_lambertian: true if the quotient is constant above the horizon.
        is_steep: true if the quotient times cos θi varies with the light direction although no curve does.
        data: store of the measured data that documents must name, if any; the name is fixed too.
        texels: for a BTF, the BRDFs per texel, whose mean is the quotient; from `normalize`.
        width: the parameter that roughness maps scale, and its exponent in terms of roughness.
        convolves_slopes: curves of the width read the slope variance of normals, `relume.brdf.curves.SLOPE_VARIANCE`.
    """

    model: str
    label: str
    parameters: tuple[Parameter, ...]
    curves: tuple[Curve, ...]
    quotient: Callable[..., Any]
    source: str
    texture: str
    help: str
    fixed: tuple[str, ...] = ()
    normalize: Callable[[Mapping[str, Any]], dict[str, Any]] | None = None
    num_channels: int = 1
    is_lambertian: bool = False
    is_steep: bool = False
    data: AssetStore | None = None
    texels: Any = None
    width: tuple[str, float] | None = None
    convolves_slopes: bool = False

    def __post_init__(self) -> None:
        if self.curves and not any(curve.depends_on_view for curve in self.curves):
            object.__setattr__(self, "curves", (*self.curves, VIEW))

    def active_curves(self, document: Mapping[str, Any]) -> tuple[Curve, ...]:
        """Return the curves that affect a term document: all but an undrawn `VIEW`.

        Args:
            document: a term of a look, complete or not.
        """
        drawn = document.get("curves") or {}
        return tuple(curve for curve in self.curves if curve is not VIEW or VIEW.name in drawn)

    @property
    def needs_data(self) -> bool:
        """True if documents must name measured data."""
        return self.data is not None

    @property
    def scatters_diffusely(self) -> bool:
        """True if the term is nearly diffuse: those terms use the diffuse color by default."""
        return self.texture == "diffuse"

    def fixed_values(self, document: Mapping[str, Any]) -> tuple[tuple[str, float | str], ...]:
        """Names and values of a document's fixed parameters; missing parameters have their defaults."""
        given = document.get("params") or {}
        values = tuple((name, float(given.get(name, self.parameter(name).default))) for name in self.fixed)
        return (*values, ("data", str(document["data"]))) if self.needs_data else values

    def normalized(self, document: Mapping[str, Any]) -> Term:
        """Return this term with its fixed parameters applied to the quotient and the angles."""
        return self.normalized_by(self.fixed_values(document))

    def normalized_by(self, fixed: tuple[tuple[str, float | str], ...]) -> Term:
        """Return this term with the `fixed_values` of a document applied."""
        return self if self.normalize is None else replace(self, **self.normalize(dict(fixed)))

    def quotients(self, *directions: NDArray[np.floating] | float) -> NDArray[Any]:
        """Evaluate the quotient with channels first, (1, ...) or (3, ...); arguments as for `quotient`."""
        value = self.quotient(*directions)
        return np.asarray(value) if self.num_channels == 3 else np.asarray(value)[None]

    def parameter(self, name: str) -> Parameter:
        """The declaration of one parameter; KeyError if there is none of that name."""
        return {p.name: p for p in self.parameters}[name]

    def curve(self, name: str) -> Curve:
        """The declaration of one curve; KeyError if there is none of that name."""
        return {c.name: c for c in self.curves}[name]
