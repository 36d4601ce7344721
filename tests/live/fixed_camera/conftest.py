"""Pictures are compared to the last digits, in separate bakes: stored images of other bakes are shaded differently."""

from shared_bakes import baked, corner, gathered, transfer, unmeasured
from subdivided_shading import shade_with_projector

__all__ = ["baked", "corner", "gathered", "shade_with_projector", "transfer", "unmeasured"]  # fixtures
