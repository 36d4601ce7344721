"""Truth by brute force, for error figures: every texel of the environment, visibility traced, BRDFs at exact angles."""

from relume.reference.image import ReferenceImage, reference_image, render_reference
from relume.reference.radiance import ReferencePoints, reference_radiance
from relume.reference.texels import EnvironmentSamples, environment_texels

__all__ = [
    "EnvironmentSamples",
    "ReferenceImage",
    "ReferencePoints",
    "environment_texels",
    "reference_image",
    "reference_radiance",
    "render_reference",
]
