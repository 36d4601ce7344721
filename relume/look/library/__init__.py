"""Materials to begin from: published fits of measured materials as terms, and Sun's map between them."""

from relume.look.library.materials import Preset, presets
from relume.look.library.navigation import NavigationMap, navigation_map

__all__ = ["NavigationMap", "Preset", "navigation_map", "presets"]
