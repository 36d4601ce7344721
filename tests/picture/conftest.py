"""Pictures are followed to the last digits."""

from leaves import by_leaves

__all__ = ["by_leaves"]  # a fixture
