"""Pictures are followed to the last digits, in bakes of their own: images kept beside others' are shaded otherwise."""

from shared_bakes import baked, corner, gathered, transfer, unmeasured
from subdivided_shading import shade_with_projector

__all__ = ["baked", "corner", "gathered", "shade_with_projector", "transfer", "unmeasured"]  # fixtures
