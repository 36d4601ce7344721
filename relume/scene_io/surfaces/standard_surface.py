"""Autodesk Standard Surface 1.0.1: https://autodesk.github.io/standard-surface."""

from __future__ import annotations

from math import inf, pi, sqrt

from relume.scene_io.surfaces.base_layers import (
    MAX_EMISSION,
    anisotropic_highlight,
    coat_tint,
    read_ior,
    subsurface_base,
    tinted,
    transmission_layer,
    warn_dispersion,
    warn_rough_diffuse,
    warn_thin_film,
)
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs
from relume.scene_io.surfaces.surface_parameters import WHITE, SurfaceParameters


def standard_surface(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `standard_surface`."""
    base = inputs.weighted_color("base", inputs.scalar("base", 1), inputs.color("base_color", (0.8, 0.8, 0.8)))
    base = subsurface_base(inputs, base, inputs.number("subsurface", 0), inputs.color("subsurface_color", WHITE))
    warn_rough_diffuse(inputs, inputs.number("diffuse_roughness", 0))
    coat = inputs.scalar("coat", 0)
    tint = coat_tint(
        inputs,
        coat,
        is_anisotropic=inputs.number("coat_anisotropy", 0) > 0,
        blurs=inputs.number("coat_affect_roughness", 0) > 0,
        deepens=inputs.number("coat_affect_color", 0) > 0,
    )
    transmission = transmission_layer(inputs, "transmission", "thin_walled", tint)
    warn_dispersion(inputs, transmission.get("transmission", 0), inputs.number("transmission_dispersion", 0, inf))
    warn_thin_film(inputs, inputs.number("thin_film_thickness", 0, inf))
    metallic = inputs.scalar("metalness", 0)
    if metallic != 0 and (inputs.scalar("specular", 1) != 1 or inputs.color("specular_color", WHITE) != WHITE):
        inputs.warn_approximated(
            f"The edge color of the metallic parts of {inputs.label} isn't supported; it is white."
        )
    roughness, anisotropy = anisotropic_highlight(inputs, 0.2, "specular_anisotropy", _widths)
    return SurfaceParameters(
        base_color=tinted(inputs, base, tint),
        metallic=metallic,
        roughness=roughness,
        specular=inputs.scalar("specular", 1),
        specular_color=tinted(inputs, inputs.color("specular_color", WHITE), tint),
        ior=read_ior(inputs, "specular_IOR"),
        anisotropy=anisotropy,
        anisotropy_rotation=2 * pi * inputs.number("specular_rotation", 0),
        clearcoat=coat,
        clearcoat_roughness=inputs.scalar("coat_roughness", 0.1),
        clearcoat_ior=read_ior(inputs, "coat_IOR"),
        sheen_color=inputs.color("sheen_color", WHITE),
        sheen_weight=inputs.scalar("sheen", 0),
        sheen_roughness=inputs.scalar("sheen_roughness", 0.3),
        emission=inputs.color("emission_color", WHITE),
        emission_strength=inputs.number("emission", 0, MAX_EMISSION),
        alpha=inputs.scalar("opacity", 1),
        alpha_mode="BLEND",
        normal=inputs.normal("normal"),
        **transmission,
    )


def _widths(alpha: float, anisotropy: float) -> tuple[float, float]:
    """α along and across the tangent."""
    aspect = sqrt(1 - 0.9 * anisotropy)
    return alpha / aspect, alpha * aspect
