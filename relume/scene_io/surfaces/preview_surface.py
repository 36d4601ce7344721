"""UsdPreviewSurface 2.6: https://openusd.org/release/spec_usdpreviewsurface.html.

An opacity below 1 without a threshold keeps the highlight, as thin glass does, unless its mode is "presence" or it is
an image, which is mostly a cut-out. The specular workflow gives f0 directly; with a black diffuse color it is a metal.
"""

from __future__ import annotations

from math import inf

from relume.scene_io.surfaces.base_layers import WHITE, transmissive_base
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Rgb, SurfaceInputs, scaled
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

_BLACK: Rgb = (0.0, 0.0, 0.0)
_DIELECTRIC = 0.04  # f0 of the index of refraction 1.5
_PRESENCE = 1  # value of opacityMode


def preview_surface(inputs: SurfaceInputs) -> SurfaceParameters:
    """Convert the inputs of `UsdPreviewSurface`."""
    base, metallic = inputs.color("diffuseColor", (0.18, 0.18, 0.18)), inputs.scalar("metallic", 0)
    ior = inputs.number("ior", 1.5, 1e6)
    specular_color: Color = WHITE
    if inputs.number("useSpecularWorkflow", 0) > 0:
        base, metallic, ior, specular_color = _specular_workflow(inputs, base)
    opacity, cutoff = inputs.scalar("opacity", 1), inputs.number("opacityThreshold", 0)
    is_glass = cutoff == 0 and inputs.number("opacityMode", 0) != _PRESENCE
    transmission = 0.0 if isinstance(opacity, ImageInput) or not is_glass else 1 - opacity
    if inputs.is_image("displacement") or inputs.number("displacement", 0, inf) > 0:
        inputs.warn_unsupported(f"Displacement of {inputs.label} isn't supported.")
    return SurfaceParameters(
        base_color=transmissive_base(inputs, base, transmission, WHITE),
        metallic=metallic,
        roughness=inputs.scalar("roughness", 0.5),
        specular_color=specular_color,
        ior=ior,
        clearcoat=inputs.scalar("clearcoat", 0),
        clearcoat_roughness=inputs.scalar("clearcoatRoughness", 0.01),
        transmission=transmission,
        emission=inputs.color("emissiveColor", _BLACK, 1e9),
        alpha=1.0 if transmission > 0 else opacity,
        alpha_mode="MASK" if cutoff > 0 else "BLEND",
        alpha_cutoff=cutoff,
        normal=inputs.normal("normal"),
        has_occlusion=inputs.is_image("occlusion"),
    )


def _specular_workflow(inputs: SurfaceInputs, base: Color) -> tuple[Color, float, float, Color]:
    """Base color, metallic, index of refraction and specular color of a surface that is given by f0."""
    f0 = inputs.color("specularColor", _BLACK)
    if base == _BLACK:
        return f0, 1.0, 1.5, WHITE
    factor = 1 / _DIELECTRIC
    return base, 0.0, 1.5, scaled(f0, (factor, factor, factor))
