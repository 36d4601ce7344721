"""Autodesk Standard Surface 1.0.1: https://autodesk.github.io/standard-surface."""

from __future__ import annotations

from math import inf, pi, sqrt

from relume.scene_io.surfaces.base_layers import (
    WHITE,
    TransmissionLayer,
    anisotropic_highlight,
    coat_tint,
    subsurface_base,
    tinted,
    warn_rough_diffuse,
)
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

_MAX_EMISSION = 1e9


def standard_surface(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `standard_surface`."""
    base = inputs.weighted_color("base", inputs.scalar("base", 1), inputs.color("base_color", (0.8, 0.8, 0.8)))
    base = subsurface_base(inputs, base, inputs.number("subsurface", 0), inputs.color("subsurface_color", WHITE))
    warn_rough_diffuse(inputs, inputs.number("diffuse_roughness", 0))
    coat = inputs.scalar("coat", 0)
    tint = coat_tint(inputs, coat, inputs.number("coat_IOR", 1.5, 10))
    transmission = TransmissionLayer.read(inputs, "transmission", "thin_walled")
    base = transmission.base(inputs, "transmission", base)
    roughness, anisotropy = anisotropic_highlight(inputs, 0.2, "specular_anisotropy", _widths)
    return SurfaceParameters(
        base_color=tinted(base, tint),
        metallic=inputs.scalar("metalness", 0),
        roughness=roughness,
        specular=inputs.scalar("specular", 1),
        specular_color=tinted(inputs.color("specular_color", WHITE), tint),
        ior=inputs.number("specular_IOR", 1.5, 10),
        anisotropy=anisotropy,
        anisotropy_rotation=2 * pi * inputs.number("specular_rotation", 0),
        clearcoat=coat,
        clearcoat_roughness=inputs.scalar("coat_roughness", 0.1),
        sheen_color=inputs.weighted_color("sheen", inputs.scalar("sheen", 0), inputs.color("sheen_color", WHITE)),
        sheen_roughness=inputs.scalar("sheen_roughness", 0.3),
        transmission=transmission.weight,
        thickness=transmission.thickness,
        attenuation_distance=transmission.depth,
        attenuation_color=transmission.inside,
        emission=inputs.color("emission_color", WHITE),
        emission_strength=inputs.number("emission", 0, _MAX_EMISSION),
        alpha=inputs.scalar("opacity", 1),
        alpha_mode="BLEND",
        normal=inputs.normal("normal"),
        iridescence=float(inputs.number("thin_film_thickness", 0, inf) > 0),
        dispersion=inputs.number("transmission_dispersion", 0, inf) if transmission.weight else 0.0,
    )


def _widths(alpha: float, anisotropy: float) -> tuple[float, float]:
    """α along and across the tangent."""
    aspect = sqrt(1 - 0.9 * anisotropy)
    return alpha / aspect, alpha * aspect
