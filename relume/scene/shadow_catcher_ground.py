"""A shadow-catching ground plane for scenes without one, such as product models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.scene.model import Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.scene.unique_names import unique_name

F64 = NDArray[np.float64]

_RADIUS_FACTOR = 10.0  # times the scene's bounding radius: at that distance a shadow is below a thousandth
_CORNERS = 96
_RELATIVE_DEPTH = 1e-4  # of the bounding radius; keeps the ground below coplanar surfaces
_GRAY = {"model": "lambert", "color": [0.5, 0.5, 0.5], "texture": None}


def with_ground(scene: Scene, name: str | None = None) -> Scene:
    """Add a large disc below the lowest point of a scene, with a material of its own that can be a shadow catcher.

    Args:
        name: name of the new scene; None for the old name.
    Raises:
        SceneError: the scene has a ground already, or too many materials.
    """
    if any(material.shadow_catcher for material in scene.materials):
        raise SceneError("the scene already has a ground; use it as it is")
    ground_name = unique_name("Ground", {material.name: 1 for material in scene.materials})
    material = Material(ground_name, (_GRAY,), shadow_catcher=True)
    mesh = _disc(ground_name, *_ball(scene), material=len(scene.materials))
    grounded = make_scene(
        name or scene.name,
        (*scene.meshes, mesh),
        (*scene.materials, material),
        scene.cameras,
        scene.environment,
        scene.warnings,
        scene.variants,
        scene.lights,
        scene.offset,
    )
    return replace(grounded, import_options=scene.import_options, ies_files=scene.ies_files)


def _ball(scene: Scene) -> tuple[F64, float]:
    """Center of the scene projected to its lowest point, and the bounding radius."""
    low = np.min([mesh.positions.min(axis=0) for mesh in scene.meshes], axis=0).astype(np.float64)
    high = np.max([mesh.positions.max(axis=0) for mesh in scene.meshes], axis=0).astype(np.float64)
    middle = (low + high) / 2
    return np.array([middle[0], low[1], middle[2]]), max(float(np.linalg.norm(high - low)) / 2, 1e-6)


def _disc(name: str, center: F64, radius: float, *, material: int) -> Mesh:
    """A disc that faces up, as a triangle fan."""
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
