"""The built-in scene: a still life made by code, after Ben-Artzi's Teatray and Earrings."""

from __future__ import annotations

from functools import cache

from relume.assets.environments.studio import studio
from relume.scene.examples.still_life.palette import materials
from relume.scene.examples.still_life.still_life import cameras, meshes
from relume.scene.model import Scene
from relume.scene.scene_folder import make_scene


@cache
def demo_scene() -> Scene:
    """Teapot, tray, pearls, bowl and linen in a studio; the same content, and id, every time."""
    return make_scene("Still life", meshes(), materials(), cameras(), studio())
