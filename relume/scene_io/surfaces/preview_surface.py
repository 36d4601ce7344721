"""UsdPreviewSurface 2.6: https://openusd.org/release/spec_usdpreviewsurface.html.

A constant opacity below 1 without a threshold scales the diffuse color and keeps the highlight: light passes as through
thin clear glass. The mode "presence", an image, which is mostly a cut-out, and a metal are blended.
"""

from __future__ import annotations

from math import inf

from relume.scene_io.surfaces.base_layers import MAX_EMISSION, read_ior
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs
from relume.scene_io.surfaces.surface_parameters import BLACK, WHITE, SurfaceParameters

PRESENCE = 1.0  # value of opacityMode


def preview_surface(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `UsdPreviewSurface`; the specular workflow gives f0 directly."""
    has_f0 = inputs.number("useSpecularWorkflow", 0) > 0
    metallic = 0.0 if has_f0 else inputs.scalar("metallic", 0)
    opacity, cutoff = inputs.scalar("opacity", 1), inputs.number("opacityThreshold", 0)
    is_glass = cutoff == 0 and metallic == 0 and inputs.number("opacityMode", 0) != PRESENCE
    transmission = 0.0 if isinstance(opacity, ImageInput) or not is_glass else 1 - opacity
    if inputs.is_image("displacement") or inputs.number("displacement", 0, inf) > 0:
        inputs.warn_unsupported(f"Displacement of {inputs.label} isn't supported; its surface is smooth.")
    return SurfaceParameters(
        base_color=inputs.color("diffuseColor", (0.18, 0.18, 0.18)),
        metallic=metallic,
        roughness=inputs.scalar("roughness", 0.5),
        specular_color=inputs.color("specularColor", BLACK) if has_f0 else WHITE,
        ior=read_ior(inputs, "ior"),
        has_f0=has_f0,
        clearcoat=inputs.scalar("clearcoat", 0),
        clearcoat_roughness=inputs.scalar("clearcoatRoughness", 0.01),
        transmission=transmission,
        transmission_color=WHITE,
        transmission_roughness=0.0,
        emission=inputs.color("emissiveColor", BLACK, MAX_EMISSION),
        alpha=1.0 if transmission > 0 else opacity,
        alpha_mode="MASK" if cutoff > 0 else "BLEND",
        alpha_cutoff=cutoff,
        normal=inputs.normal("normal"),
        has_occlusion=inputs.is_image("occlusion"),
    )
