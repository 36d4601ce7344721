"""The built-in scene: a still life made by code, after Ben-Artzi's Teatray and Earrings."""

from __future__ import annotations

from functools import cache

from relume.environments.studio import studio
from relume.scene.archive import make_scene
from relume.scene.demo.materials import materials
from relume.scene.demo.still_life import cameras, meshes
from relume.scene.model import Scene


@cache
def demo_scene() -> Scene:
    """Teapot, tray, pearls, bowl and linen in a studio; the same content, and id, every time."""
    return make_scene("Still life", meshes(), materials(), cameras(), studio())
