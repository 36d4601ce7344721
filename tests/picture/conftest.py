"""Pictures are followed to the last digits, in bakes of their own: images kept beside others' are shaded otherwise."""

from leaves import by_leaves
from shared_bakes import baked, corner, gathered, transfer, unmeasured

__all__ = ["baked", "by_leaves", "corner", "gathered", "transfer", "unmeasured"]  # fixtures
