"""Layers that several surface models share: subsurface, tinted coats, transmission, anisotropic highlights."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

from relume.scene.validate import MAX_IOR
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Scalar, SurfaceInputs, lerp, scaled
from relume.scene_io.surfaces.surface_parameters import BLACK, WHITE, from_microfacet_widths

MAX_EMISSION = 1e9


def read_ior(inputs: SurfaceInputs, name: str, default: float = 1.5) -> float:
    """An index of refraction; the default with a warning if no dielectric has it.

    Args:
        inputs: of the surface. name: of the input. default: of the model.
    """
    ior = inputs.number(name, default, inf)
    if 0 < ior <= MAX_IOR:
        return ior
    kind = "index of refraction of the coat" if name.startswith("coat") else "index of refraction"
    inputs.warn_unsupported(f"The {kind} {ior:g} of {inputs.label} is out of range; {default:g} is used.")
    return default


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


def coat_tint(inputs: SurfaceInputs, weight: Scalar, **differences: bool) -> Color:
    """The factor of the layers below a coat that absorbs light; all approximations of the coat are one warning.

    Args:
        inputs: with the transmittance `coat_color`. weight: of the coat.
        differences: names of effects on the coat or below it, and whether the document has them.
    """
    if not isinstance(weight, ImageInput) and weight == 0:
        return WHITE
    color = inputs.color("coat_color", WHITE)
    ignored = [_COAT_DIFFERENCES[name] for name, applies in differences.items() if applies]
    ignored += ["it is tinted the same from all sides"] * (color != WHITE)
    if ignored:
        inputs.warn_approximated(f"The coat of {inputs.label} is approximated: {', '.join(ignored)}.")
    if color == WHITE or weight == 1:
        return color
    return lerp(WHITE, inputs.mean("coat_color", color), inputs.mean("the coat", weight)[0])


_COAT_DIFFERENCES = {
    "darkens": "it doesn't darken the base",
    "is_anisotropic": "its highlight is round",
    "blurs": "it doesn't blur the base",
    "deepens": "it doesn't deepen the color of the base",
}


def warn_rough_diffuse(inputs: SurfaceInputs, roughness: float) -> None:
    """Warn if the diffuse reflection is rough (Oren–Nayar), because it is shown as Lambert's."""
    if roughness > 0:
        inputs.warn_approximated(f"Rough diffuse reflection of {inputs.label} is shown as Lambert's.")


def warn_thin_film(inputs: SurfaceInputs, weight: float) -> None:
    """Warn if the highlight has interference colors."""
    if weight > 0:
        message = f"Iridescence on {inputs.label} isn't supported; its highlight has no interference colors."
        inputs.warn_unsupported(message)


def warn_dispersion(inputs: SurfaceInputs, transmission: Scalar, dispersion: float) -> None:
    """Warn if transmitted light is dispersed.

    Args:
        inputs: get the warning. transmission: weight of the transmitted light. dispersion: 0 for none.
    """
    if transmission != 0 and dispersion > 0:
        inputs.warn_unsupported(f"Dispersion on {inputs.label} isn't supported; it refracts all colors alike.")


def tinted(inputs: SurfaceInputs, color: Color, tint: Color) -> Color:
    """A color below a tinted coat; of two images, the mean of the tint.

    Args:
        inputs: get the warning. color: the color. tint: of the coat.
    """
    if tint == WHITE:
        return color
    if isinstance(tint, ImageInput) and not isinstance(color, ImageInput):
        return scaled(tint, color)
    return scaled(color, inputs.mean("coat_color", tint))


def transmission_layer(inputs: SurfaceInputs, weight_name: str, thin_name: str, tint: Color) -> dict[str, Any]:
    """The parameters of transmission, from the inputs that OpenPBR and Standard Surface share.

    Args:
        inputs: of the surface. weight_name, thin_name: their names of the weight and of thin walls.
        tint: of the coat.
    """
    weight = inputs.scalar(weight_name, 0.0)
    if weight == 0:
        return {}
    if any(inputs.constant_color("transmission_scatter", BLACK)):
        inputs.warn_unsupported(f"Scattering inside {inputs.label} isn't supported; it is shown clear.")
    depth = inputs.number("transmission_depth", 0.0, 1e6)
    layer = {"transmission": weight, "thickness": 0.0 if inputs.number(thin_name, 0.0) > 0 else depth or 1.0}
    if depth == 0:
        return {**layer, "transmission_color": tinted(inputs, inputs.color("transmission_color", WHITE), tint)}
    inside = inputs.constant_color("transmission_color", WHITE)
    return {**layer, "transmission_color": tint, "attenuation_distance": depth, "attenuation_color": inside}


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
