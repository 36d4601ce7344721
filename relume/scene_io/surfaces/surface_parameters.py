"""Parameters of a surface as glTF 2.0 and its extensions define them, each a constant or an image."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, Scalar


@dataclass(frozen=True)
class SurfaceParameters:
    """Parameters of a surface. Colors are linear Rec. 709.

    Attributes:
        base_color: albedo of the dielectric, f0 of the metal.
        metallic, roughness: roughness is perceptual, α = roughness².
        specular, specular_color: factors of the dielectric's f0 and f90, and of its f0.
        ior: index of refraction.
        anisotropy: strength as in KHR_materials_anisotropy: the width along the tangent is mix(α, 1, strength²).
        anisotropy_rotation: radians, from the tangent toward the bitangent.
        clearcoat, clearcoat_roughness: weight and roughness of a coat with an index of refraction of 1.5.
        sheen_color, sheen_roughness: as in KHR_materials_sheen.
        transmission: fraction of the light of the diffuse layer that is transmitted, tinted by the base color.
        thickness: meters; 0 of a thin wall, otherwise the boundary of a solid.
        attenuation_distance, attenuation_color: the solid transmits this color over this distance, meters.
        emission, emission_strength: radiance is their product.
        alpha, alpha_mode, alpha_cutoff: as in glTF.
        normal: tangent-space normals; the factor is the scale of x and y.
        has_occlusion: an occlusion map is ignored, with a warning.
        iridescence, dispersion: as in the extensions of these names.
    """

    base_color: Color = (1.0, 1.0, 1.0)
    metallic: Scalar = 0.0
    roughness: Scalar = 1.0
    specular: Scalar = 1.0
    specular_color: Color = (1.0, 1.0, 1.0)
    ior: float = 1.5
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    clearcoat: Scalar = 0.0
    clearcoat_roughness: Scalar = 0.0
    sheen_color: Color = (0.0, 0.0, 0.0)
    sheen_roughness: Scalar = 0.0
    transmission: Scalar = 0.0
    thickness: float = 0.0
    attenuation_distance: float = inf
    attenuation_color: Rgb = (1.0, 1.0, 1.0)
    emission: Color = (0.0, 0.0, 0.0)
    emission_strength: float = 1.0
    alpha: Scalar = 1.0
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    normal: ImageInput | None = None
    has_occlusion: bool = False
    iridescence: float = 0.0
    dispersion: float = 0.0


def from_microfacet_widths(along: float, across: float) -> tuple[float, float]:
    """Return roughness and anisotropy strength in glTF of the widths α along and across the tangent, along ≥ across."""
    return sqrt(across), sqrt(max(along - across, 0.0) / max(1 - across, 1e-6))
