"""Preset materials: published fits of measured materials as terms, and the navigation map between them."""

from relume.look.library.materials import Preset, presets
from relume.look.library.navigation_map import MapTable, NavigationMap, navigation_map

__all__ = ["MapTable", "NavigationMap", "Preset", "navigation_map", "presets"]
