"""Truth by brute force, for error figures: every texel of the environment, visibility traced, BRDFs at exact angles."""

from relume.reference.image import Truth, reference_image, reference_truth
from relume.reference.radiance import Points, reference_radiance
from relume.reference.texels import Texels, texels_of

__all__ = ["Points", "Texels", "Truth", "reference_image", "reference_radiance", "reference_truth", "texels_of"]
