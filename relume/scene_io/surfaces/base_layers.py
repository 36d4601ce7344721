"""Layers that several surface models share: subsurface, tinted coats, transmission, anisotropic highlights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, Scalar, SurfaceInputs, lerp, scaled
from relume.scene_io.surfaces.surface_parameters import from_microfacet_widths

WHITE: Rgb = (1.0, 1.0, 1.0)
_COAT_IOR = 1.5  # of the term
_VISIBLE_IOR_DIFFERENCE = 0.02


def subsurface_base(inputs: SurfaceInputs, base: Color, weight: float, subsurface: Color) -> Color:
    """The diffuse color that a subsurface layer reflects: mix(base, subsurface, weight).

    Args:
        inputs: get the warning. base, subsurface: colors. weight: of the subsurface layer.
    """
    if weight == 0:
        return base
    inputs.warn_approximated(f"Subsurface scattering of {inputs.label} is shown as diffuse reflection.")
    if isinstance(base, tuple) and isinstance(subsurface, tuple):
        return lerp(base, subsurface, weight)
    return subsurface if weight >= 0.5 else base


def transmissive_base(inputs: SurfaceInputs, base: Color, weight: float, tint: Color) -> Color:
    """The base color of a surface with transmission: glTF has one color for both parts.

    Args:
        inputs: get the warning. base: color of the diffuse part. weight: of the transmission. tint: its color.
    """
    if weight == 0 or base == tint:
        return base
    if weight < 1:
        inputs.warn_approximated(f"Diffuse reflection and transmission of {inputs.label} have a common color.")
    if isinstance(base, tuple) and isinstance(tint, tuple):
        return lerp(base, tint, weight)
    return tint if weight >= 0.5 else base


def coat_tint(inputs: SurfaceInputs, weight: Scalar, ior: float, *, darkens: bool = False) -> Rgb:
    """The factor of the layers below a coat that absorbs light; all approximations of the coat are one warning.

    Args:
        inputs: with the transmittance `coat_color`. weight: of the coat. ior: its index of refraction.
        darkens: reflections between coat and base darken the base.
    """
    if not isinstance(weight, ImageInput) and weight == 0:
        return WHITE
    color = inputs.constant_color("coat_color", WHITE)
    ignored = [f"its index of refraction {ior:g} is shown as {_COAT_IOR}"] * (
        abs(ior - _COAT_IOR) > _VISIBLE_IOR_DIFFERENCE
    )
    ignored += ["it doesn't darken the base"] * darkens
    ignored += ["it is tinted the same from all sides"] * (color != WHITE)
    if ignored:
        inputs.warn_approximated(f"The coat of {inputs.label} is approximated: {', '.join(ignored)}.")
    return WHITE if color == WHITE else lerp(WHITE, color, inputs.mean("the coat", weight)[0])


def warn_rough_diffuse(inputs: SurfaceInputs, roughness: float) -> None:
    """Warn if the diffuse reflection is rough (Oren–Nayar), because it is shown as Lambert's."""
    if roughness > 0:
        inputs.warn_approximated(f"Rough diffuse reflection of {inputs.label} is shown as Lambert's.")


def tinted(color: Color, tint: Rgb) -> Color:
    """A color below a tinted coat."""
    return color if tint == WHITE else scaled(color, tint)


@dataclass(frozen=True)
class TransmissionLayer:
    """Transmission of a surface.

    Attributes:
        weight: fraction of the light that is transmitted.
        depth: the inside transmits `inside` over this distance; infinite if it is clear.
        tint: transmittance of the surface. inside: of the inside.
        thickness: of a solid, for formats without a thickness; 0 of a thin wall.
    """

    weight: Scalar
    depth: float
    tint: Color
    inside: Rgb
    thickness: float

    @staticmethod
    def read(inputs: SurfaceInputs, weight_name: str, thin_name: str) -> TransmissionLayer:
        """Read the inputs that OpenPBR and Standard Surface share.

        Args:
            inputs: of the surface. weight_name, thin_name: their names of the weight and of thin walls.
        """
        weight = inputs.scalar(weight_name, 0.0)
        if weight == 0:
            return TransmissionLayer(0.0, inf, WHITE, WHITE, 0.0)
        if any(inputs.constant_color("transmission_scatter", (0.0, 0.0, 0.0))):
            inputs.warn_unsupported(f"Scattering inside {inputs.label} isn't supported; it is shown clear.")
        depth = inputs.number("transmission_depth", 0.0, 1e6)
        thickness = 0.0 if inputs.number(thin_name, 0.0) > 0 else depth or 1.0
        if depth == 0:
            return TransmissionLayer(weight, inf, inputs.color("transmission_color", WHITE), WHITE, thickness)
        return TransmissionLayer(weight, depth, WHITE, inputs.constant_color("transmission_color", WHITE), thickness)

    def base(self, inputs: SurfaceInputs, weight_name: str, base: Color) -> Color:
        """The base color in glTF. See `transmissive_base`."""
        return (
            base
            if self.weight == 0
            else transmissive_base(inputs, base, inputs.mean(weight_name, self.weight)[0], self.tint)
        )


def anisotropic_highlight(
    inputs: SurfaceInputs, default: float, anisotropy_name: str, widths: Callable[[float, float], tuple[float, float]]
) -> tuple[Scalar, float]:
    """Roughness and strength of anisotropy in glTF.

    Args:
        inputs: of the surface. default: of `specular_roughness`. anisotropy_name: its name.
        widths: α along and across the tangent, of α of an isotropic highlight and of the anisotropy.
    """
    roughness, anisotropy = inputs.scalar("specular_roughness", default), inputs.number(anisotropy_name, 0.0)
    if anisotropy == 0:
        return roughness, 0.0
    along, across = widths(inputs.mean("specular_roughness", roughness)[0] ** 2, anisotropy)
    return from_microfacet_widths(min(along, 1.0), across)
