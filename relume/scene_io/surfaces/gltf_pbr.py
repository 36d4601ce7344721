"""The node `gltf_pbr` of MaterialX: glTF 2.0, appendix B, with extensions."""

from __future__ import annotations

from math import inf

from relume.scene_io.surfaces.base_layers import MAX_EMISSION, warn_dispersion, warn_thin_film
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs
from relume.scene_io.surfaces.surface_parameters import BLACK, WHITE, SurfaceParameters

_ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")


def gltf_pbr(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `gltf_pbr`."""
    transmission = inputs.scalar("transmission", 0)
    warn_thin_film(inputs, inputs.number("iridescence", 0))
    warn_dispersion(inputs, transmission, inputs.number("dispersion", 0, inf))
    return SurfaceParameters(
        base_color=inputs.color("base_color", WHITE),
        metallic=inputs.scalar("metallic", 1),
        roughness=inputs.scalar("roughness", 1),
        specular=inputs.scalar("specular", 1),
        specular_color=inputs.color("specular_color", WHITE, inf),
        ior=inputs.number("ior", 1.5, 1e6),
        anisotropy=inputs.number("anisotropy_strength", 0),
        anisotropy_rotation=inputs.number("anisotropy_rotation", 0, inf),
        clearcoat=inputs.scalar("clearcoat", 0),
        clearcoat_roughness=inputs.scalar("clearcoat_roughness", 0),
        sheen_color=inputs.color("sheen_color", BLACK),
        sheen_roughness=inputs.scalar("sheen_roughness", 0),
        transmission=transmission,
        thickness=inputs.number("thickness", 0, 1e6),
        attenuation_distance=inputs.number("attenuation_distance", inf, inf) or inf,
        attenuation_color=inputs.constant_color("attenuation_color", WHITE),
        emission=inputs.color("emissive", BLACK),
        emission_strength=inputs.number("emissive_strength", 1, MAX_EMISSION),
        alpha=inputs.scalar("alpha", 1),
        alpha_mode=_ALPHA_MODES[round(inputs.number("alpha_mode", 0, 2))],
        alpha_cutoff=inputs.number("alpha_cutoff", 0.5),
        normal=inputs.normal("normal"),
        has_occlusion=inputs.is_image("occlusion"),
    )
