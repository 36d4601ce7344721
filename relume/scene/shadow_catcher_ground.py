"""A ground under a scene: products come floating, and a shadow says where they stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.scene.model import Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.scene.unique_names import unique_name

F64 = NDArray[np.float64]

_RADIUS_FACTOR = 10.0  # than the ball about the scene: there a shadow is less than a thousandth
_CORNERS = 96
_RELATIVE_DEPTH = 1e-4  # of the ball's radius: surfaces that lie flat on it do not lie in it
_GRAY = {"model": "lambert", "color": [0.5, 0.5, 0.5], "texture": None}


def with_ground(scene: Scene, name: str | None = None) -> Scene:
    """The scene on a large disc below its lowest point, which catches shadows and is a material of its own.

    Args:
        name: of the new scene; that of the old one where None.
    Raises:
        SceneError: it has a ground already, or no room for another material.
    """
    if any(material.shadow_catcher for material in scene.materials):
        raise SceneError("the scene stands on a ground already; use it as it is")
    ground_name = unique_name("Ground", {material.name: 1 for material in scene.materials})
    material = Material(ground_name, (_GRAY,), shadow_catcher=True)
    mesh = _disc(ground_name, *_ball(scene), material=len(scene.materials))
    return make_scene(
        name or scene.name,
        (*scene.meshes, mesh),
        (*scene.materials, material),
        scene.cameras,
        scene.environment,
        scene.warnings,
        scene.variants,
        scene.lights,
    )


def _ball(scene: Scene) -> tuple[F64, float]:
    """The lowest point below the middle of all that there is, and the radius of the ball about it."""
    low = np.min([mesh.positions.min(axis=0) for mesh in scene.meshes], axis=0).astype(np.float64)
    high = np.max([mesh.positions.max(axis=0) for mesh in scene.meshes], axis=0).astype(np.float64)
    middle = (low + high) / 2
    return np.array([middle[0], low[1], middle[2]]), max(float(np.linalg.norm(high - low)) / 2, 1e-6)


def _disc(name: str, center: F64, radius: float, *, material: int) -> Mesh:
    """A disc that faces up, triangles about its middle."""
    angle = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
    boundary = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1) * _RADIUS_FACTOR * radius
    positions = np.concatenate([[[0.0, 0.0, 0.0]], boundary]) + center - [0.0, _RELATIVE_DEPTH * radius, 0.0]
    index = np.arange(_CORNERS)
    faces = np.stack([0 * index, 1 + index, 1 + (index + 1) % _CORNERS], axis=1)
    up, along = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0, 1.0])
    return Mesh(
        name,
        positions.astype(np.float32),
        np.tile(up, (len(positions), 1)).astype(np.float32),
        np.tile(along, (len(positions), 1)).astype(np.float32),
        np.zeros((len(positions), 2), np.float32),
        faces.astype(np.uint32),
        material,
    )
