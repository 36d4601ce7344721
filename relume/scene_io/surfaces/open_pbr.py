"""OpenPBR Surface 1.1: https://academysoftwarefoundation.github.io/OpenPBR."""

from __future__ import annotations

from math import sqrt

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


def open_pbr(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `open_pbr_surface`; the radiance of its emission is the luminance times the color."""
    base = inputs.weighted_color(
        "base_weight", inputs.scalar("base_weight", 1), inputs.color("base_color", (0.8, 0.8, 0.8))
    )
    base = subsurface_base(
        inputs, base, inputs.number("subsurface_weight", 0), inputs.color("subsurface_color", (0.8, 0.8, 0.8))
    )
    warn_rough_diffuse(inputs, inputs.number("base_diffuse_roughness", 0))
    coat = inputs.scalar("coat_weight", 0)
    tint = coat_tint(
        inputs,
        coat,
        darkens=inputs.number("coat_darkening", 1) > 0,
        is_anisotropic=inputs.number("coat_roughness_anisotropy", 0) > 0,
    )
    transmission = transmission_layer(inputs, "transmission_weight", "geometry_thin_walled", tint)
    warn_dispersion(inputs, transmission.get("transmission", 0), inputs.number("transmission_dispersion_scale", 0))
    warn_thin_film(inputs, inputs.number("thin_film_weight", 0))
    metallic = inputs.scalar("base_metalness", 0)
    specular = inputs.scalar("specular_weight", 1)
    if metallic != 0 and specular != 1:
        inputs.warn_approximated(
            f"specular_weight of {inputs.label} doesn't scale the reflection of its metallic parts."
        )
    roughness, anisotropy = anisotropic_highlight(inputs, 0.3, "specular_roughness_anisotropy", _widths)
    return SurfaceParameters(
        base_color=tinted(inputs, base, tint),
        metallic=metallic,
        roughness=roughness,
        specular=specular,
        specular_color=tinted(inputs, inputs.color("specular_color", WHITE), tint),
        edge_tint=WHITE if metallic == 0 else inputs.constant_color("specular_color", WHITE),
        ior=read_ior(inputs, "specular_ior"),
        anisotropy=anisotropy,
        clearcoat=coat,
        clearcoat_roughness=inputs.scalar("coat_roughness", 0),
        clearcoat_ior=read_ior(inputs, "coat_ior", 1.6),
        sheen_color=inputs.color("fuzz_color", WHITE),
        sheen_weight=inputs.scalar("fuzz_weight", 0),
        sheen_roughness=inputs.scalar("fuzz_roughness", 0.5),
        emission=inputs.color("emission_color", WHITE),
        emission_strength=inputs.number("emission_luminance", 0, MAX_EMISSION),
        alpha=inputs.scalar("geometry_opacity", 1),
        alpha_mode="BLEND",
        normal=inputs.normal("geometry_normal"),
        **transmission,
    )


def _widths(alpha: float, anisotropy: float) -> tuple[float, float]:
    """α along and across the tangent."""
    along = alpha * sqrt(2 / (1 + (1 - anisotropy) ** 2))
    return along, (1 - anisotropy) * along
