"""Scenes that are hard to plan: a tuft of thin blades, in which nearly every pixel is an edge."""

from __future__ import annotations

import numpy as np

from relume.scene.model import Camera, Environment, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene

_LENGTH, _WIDTH = 0.3, 0.004


def tuft(num_blades: int = 60_000) -> Scene:
    """Thin quads with random orientations in a cube, seen by one camera; a pixel sees several."""
    rng = np.random.default_rng(5)
    center = rng.uniform(-1, 1, (num_blades, 3))
    along, random_direction = rng.normal(size=(2, num_blades, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, random_direction)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    half, side = _LENGTH / 2 * along, _WIDTH / 2 * across
    corners = np.stack([center - half - side, center - half + side, center + half + side, center + half - side], axis=1)
    faces = 4 * np.arange(num_blades)[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    num_corners = 4 * num_blades
    mesh = Mesh(
        "blades",
        corners.reshape(num_corners, 3).astype(np.float32),
        np.repeat(np.cross(side, half), 4, axis=0).astype(np.float32) / np.float32(_LENGTH * _WIDTH / 4),
        np.zeros((num_corners, 4), np.float32),
        np.zeros((num_corners, 2), np.float32),
        faces.reshape(-1, 3).astype(np.uint32),
        0,
    )
    to_world = np.eye(4)
    to_world[2, 3] = 4.0
    radiance = rng.random((16, 32, 3), np.float32)
    material = Material("Blade", ({"model": "lambert", "color": [0.2, 0.5, 0.1]},))
    return make_scene("Tuft", [mesh], [material], [Camera("front", to_world, 0.5)], Environment("sky", radiance))
