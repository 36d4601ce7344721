"""Parameters of a surface as glTF 2.0 and its extensions define them, each a constant or an image."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf, sqrt

from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, Scalar

BLACK: Rgb = (0.0, 0.0, 0.0)
WHITE: Rgb = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class SurfaceParameters:
    """Parameters of a surface. Colors are linear Rec. 709.

    Attributes:
        base_color: albedo of the dielectric, f0 of the metal.
        has_mesh_colors: the base color and alpha are multiplied by the colors of the mesh.
        metallic, roughness: roughness is perceptual, α = roughness².
        specular, specular_color: factors of the dielectric's f0 and f90, and of its f0.
        ior: index of refraction; 0 for f0 = 1.
        has_f0: `specular_color` is f0 itself, whatever the index of refraction.
        edge_tint: factor of the metal's reflectance near 82° (F82-tint, OpenPBR Surface 1.1, section 3.6).
        anisotropy: strength as in KHR_materials_anisotropy: the width along the tangent is mix(α, 1, strength²).
        anisotropy_rotation: radians, from the tangent toward the bitangent.
        anisotropy_map: as in that extension: a direction in two channels, and a factor of the strength.
        clearcoat, clearcoat_roughness: weight and roughness of a coat.
        clearcoat_ior, clearcoat_color: its index of refraction, and the transmittance for light that passes it twice.
        has_clearcoat_normal: a normal map of the coat is ignored, with a warning.
        sheen_color, sheen_roughness: as in KHR_materials_sheen. sheen_weight: factor of the color.
        transmission: fraction of the light of the diffuse layer that is transmitted.
        transmission_color: tint of the transmitted light; None for the base color.
        transmission_roughness: of the transmitted light; None for that of the highlight.
        thickness: meters; 0 of a thin wall, otherwise the boundary of a solid.
        attenuation_distance, attenuation_color: the solid transmits this color over this distance, meters.
        emission, emission_strength: radiance is their product.
        alpha, alpha_mode, alpha_cutoff: as in glTF.
        normal: vectors in tangent space.
        has_occlusion: an occlusion map is ignored, with a warning.
    """

    base_color: Color = WHITE
    has_mesh_colors: bool = False
    metallic: Scalar = 0.0
    roughness: Scalar = 1.0
    specular: Scalar = 1.0
    specular_color: Color = WHITE
    ior: float = 1.5
    has_f0: bool = False
    edge_tint: Rgb = WHITE
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    anisotropy_map: ImageInput | None = None
    clearcoat: Scalar = 0.0
    clearcoat_roughness: Scalar = 0.0
    clearcoat_ior: float = 1.5
    clearcoat_color: Color = WHITE
    has_clearcoat_normal: bool = False
    sheen_color: Color = BLACK
    sheen_weight: Scalar = 1.0
    sheen_roughness: Scalar = 0.0
    transmission: Scalar = 0.0
    transmission_color: Color | None = None
    transmission_roughness: float | None = None
    thickness: float = 0.0
    attenuation_distance: float = inf
    attenuation_color: Rgb = WHITE
    emission: Color = BLACK
    emission_strength: float = 1.0
    alpha: Scalar = 1.0
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    normal: ImageInput | None = None
    has_occlusion: bool = False

    def black_outside(self) -> list[ImageInput]:
        """Images that are black outside their bounds in the file, where they repeat or extend their edge instead."""
        values = (getattr(self, field.name) for field in fields(self))
        return [value for value in values if isinstance(value, ImageInput) and value.is_black_outside]


def from_microfacet_widths(along: float, across: float) -> tuple[float, float]:
    """Return roughness and anisotropy strength in glTF of the widths α along and across the tangent, along ≥ across."""
    return sqrt(across), sqrt(max(along - across, 0.0) / max(1 - across, 1e-6))
