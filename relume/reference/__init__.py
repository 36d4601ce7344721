"""Brute-force reference images: every environment texel, traced visibility, BRDFs at exact angles."""

from relume.reference.environment_samples import EnvironmentSamples, environment_texels
from relume.reference.image import ReferenceImage, reference_image, render_reference
from relume.reference.radiance import ReferencePoints, reference_radiance

__all__ = [
    "EnvironmentSamples",
    "ReferenceImage",
    "ReferencePoints",
    "environment_texels",
    "reference_image",
    "reference_radiance",
    "render_reference",
]
