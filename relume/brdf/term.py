"""What a BRDF term is: a quotient times one-dimensional curves, and the parameters that generate the curves.

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
    """The 1-D parameterisations γ(wi, wo), each an angle in [0, π/2]; computed by `relume.brdf.angles`."""

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
        """Whether curves of it may be narrower than a band, about the direction where it is zero."""
        return self in (Angle.THETA_H, Angle.THETA_R, Angle.LOBE)


@dataclass(frozen=True)
class Parameter:
    """A number that generates curves; a look gives one value, or three for separate R, G, B.

    One that is fixed at freeze (see `Term.fixed`) has one value for all channels.

    Attributes:
        unit: "" where the number has none.
        scale: how a slider moves, "linear" or "log".
        step: values are multiples of it, where it is given.
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
        angle: which angle γ it is a function of; `THETA_O` curves multiply the finished pixel.
        generator: (γ in radians (...,) float64, params) -> f(γ) (...,) float64, finite and not negative.
        parameters: names of the parameters the generator reads.
        num_bands: J, a power of two.
        label: what people read, e.g. "half angle θh".
        axes: what multiplies wo, axis by axis, before the angle is taken; other than ones for `LOBE` only.
        factor: γ in radians (...) -> (3, ...), above zero: where data give the curve, it stands in for the generator.
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
        """Whether it depends on wo alone and so multiplies the finished sample instead of entering the transport."""
        return self.angle is Angle.THETA_O


def _constant(gamma: F64, params: Params) -> F64:
    return np.ones_like(gamma)


VIEW = Curve("theta_o", "view angle θo", Angle.THETA_O, _constant, (), 64)
"""What any term may depend on besides (Ben-Artzi 2006, section 4.4): one at every angle until it is drawn."""


@dataclass(frozen=True)
class Term:
    """One BRDF term, 1/sr without the cosine: quotient(wi, wo) · Π curves.

    Attributes:
        curves: those that are declared, and `VIEW` where none of them is of the outgoing angle; or none at all.
        model: name in look documents.
        quotient: ufunc (wi_x, wi_y, wi_z, wo_x, wo_y, wo_z) -> value, local frame, z = normal; float32 and float64
            loops; zero where either direction is below the horizon. With three channels, three values, channels first.
        source: the equation it is built from.
        texture: the texture channel it takes by default, "diffuse" or "specular".
        fixed: parameters that shape the quotient or an angle, whatever curves read them: changing one freezes anew.
        normalize: `fixed_values` -> the fields of this declaration that they change; as declared they hold for the
            defaults.
        num_channels: of the quotient, 1 or 3.
        is_lambertian: whether the quotient is one value above the horizon.
        is_steep: whether the quotient, times cos θi, varies with the light where no curve tells that anything does.
        data: where documents must name something measured that is kept there; it is fixed at freeze too.
        texels: where each place of a surface has a BRDF of its own, of which the quotient is the mean; from
            `normalize`.
        width: the parameter that maps of roughness scale, and the power of a roughness that it grows with.
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

    def __post_init__(self) -> None:
        if self.curves and not any(curve.depends_on_view for curve in self.curves):
            object.__setattr__(self, "curves", (*self.curves, VIEW))

    def active_curves(self, document: Mapping[str, Any]) -> tuple[Curve, ...]:
        """The curves that make a difference in a term document: not `VIEW` where it is not drawn.

        Args:
            document: a term of a look, complete or not.
        """
        drawn = document.get("curves") or {}
        return tuple(curve for curve in self.curves if curve is not VIEW or VIEW.name in drawn)

    @property
    def needs_data(self) -> bool:
        """Whether documents must name something measured."""
        return self.data is not None

    @property
    def scatters_diffusely(self) -> bool:
        """Whether it scatters light about evenly: those do whose colour is the diffuse one by default."""
        return self.texture == "diffuse"

    def fixed_values(self, document: Mapping[str, Any]) -> tuple[tuple[str, float | str], ...]:
        """Names and values of what a term document fixes at freeze; what it leaves out has its default."""
        given = document.get("params") or {}
        values = tuple((name, float(given.get(name, self.parameter(name).default))) for name in self.fixed)
        return (*values, ("data", str(document["data"]))) if self.needs_data else values

    def normalized(self, document: Mapping[str, Any]) -> Term:
        """This term with its fixed parameters put in: quotient and angles have none left."""
        return self.normalized_by(self.fixed_values(document))

    def normalized_by(self, fixed: tuple[tuple[str, float | str], ...]) -> Term:
        """The same from the `fixed_values` of a document."""
        return self if self.normalize is None else replace(self, **self.normalize(dict(fixed)))

    def quotients(self, *directions: NDArray[np.floating] | float) -> NDArray[Any]:
        """The quotient with its channels first, (1, ...) or (3, ...); directions as it takes them."""
        value = self.quotient(*directions)
        return np.asarray(value) if self.num_channels == 3 else np.asarray(value)[None]

    def parameter(self, name: str) -> Parameter:
        """The declaration of one parameter; KeyError where there is none of that name."""
        return {p.name: p for p in self.parameters}[name]

    def curve(self, name: str) -> Curve:
        """The declaration of one curve; KeyError where there is none of that name."""
        return {c.name: c for c in self.curves}[name]
