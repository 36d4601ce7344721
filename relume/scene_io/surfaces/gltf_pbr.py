"""The node `gltf_pbr` of MaterialX: glTF 2.0, appendix B, with extensions."""

from __future__ import annotations

from math import inf

from relume.scene_io.surfaces.surface_inputs import SurfaceInputs
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

_ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")
_MAX_STRENGTH = 1e9


def gltf_pbr(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `gltf_pbr`."""
    white = (1.0, 1.0, 1.0)
    return SurfaceParameters(
        base_color=inputs.color("base_color", white),
        metallic=inputs.scalar("metallic", 1),
        roughness=inputs.scalar("roughness", 1),
        specular=inputs.scalar("specular", 1),
        specular_color=inputs.color("specular_color", white, inf),
        ior=inputs.number("ior", 1.5, 1e6),
        anisotropy=inputs.number("anisotropy_strength", 0),
        anisotropy_rotation=inputs.number("anisotropy_rotation", 0, inf),
        clearcoat=inputs.scalar("clearcoat", 0),
        clearcoat_roughness=inputs.scalar("clearcoat_roughness", 0),
        sheen_color=inputs.color("sheen_color", (0.0, 0.0, 0.0)),
        sheen_roughness=inputs.scalar("sheen_roughness", 0),
        transmission=inputs.scalar("transmission", 0),
        thickness=inputs.number("thickness", 0, 1e6),
        attenuation_distance=inputs.number("attenuation_distance", inf, inf) or inf,
        attenuation_color=inputs.constant_color("attenuation_color", white),
        emission=inputs.color("emissive", (0.0, 0.0, 0.0)),
        emission_strength=inputs.number("emissive_strength", 1, _MAX_STRENGTH),
        alpha=inputs.scalar("alpha", 1),
        alpha_mode=_ALPHA_MODES[round(inputs.number("alpha_mode", 0, 2))],
        alpha_cutoff=inputs.number("alpha_cutoff", 0.5),
        normal=inputs.normal("normal"),
        has_occlusion=inputs.is_image("occlusion"),
        iridescence=inputs.number("iridescence", 0),
        dispersion=inputs.number("dispersion", 0, inf),
    )
