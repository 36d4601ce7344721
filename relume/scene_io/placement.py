"""Placement of an imported scene by the import options: up axis, unit and origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, by_severity
from relume.math.bounding_box import bounding_box
from relume.scene.collect_lights import mesh_area
from relume.scene.model import Camera, Light, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.scene_io.gltf.cameras import framing_camera
from relume.scene_io.gltf.geometry import MAX_COORDINATE
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.origin import choose_origin, moved_warning

F64 = NDArray[np.float64]
TO_Y_UP = {
    "file": np.eye(3),
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotations to +Y up; +X stays."""
METERS = {"file": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
LARGE = 100.0  # meters: a scene whose longest side is larger was not modeled in the unit that was tried


def place(scene: Scene, options: ImportOptions) -> Scene:
    """Rotate, scale and recenter a scene that a reader made, with its cameras and lights.

    Args:
        scene: of a reader, in the axes and unit of the file.
        options: what the user says of the file; stored with the scene.
    Raises:
        SceneError: the scene would be too large.
    """
    warnings: list[ImporterWarning] = []
    low, high = bounds(scene)
    rotation = TO_Y_UP[options.up]
    meters = _guess_unit(high - low, warnings) if options.unit == "auto" else METERS[options.unit]
    has_moved = any(scene.offset)  # by a reader, before rounding
    origin = np.zeros(3) if has_moved else choose_origin(low, high, options.recenter)
    if np.array_equal(rotation, np.eye(3)) and meters == 1 and not origin.any() and not warnings:
        return replace(scene, import_options=options.document())
    if meters * float(np.maximum(np.abs(low - origin), np.abs(high - origin)).max()) > MAX_COORDINATE:
        raise SceneError("the scene is larger than 10,000 km; choose a smaller unit")
    warnings.extend(moved_warning(origin))
    meshes = [_place_mesh(mesh, rotation, meters, origin) for mesh in scene.meshes]
    is_framed = np.array_equal(scene.cameras[0].to_world, framing_camera(scene.meshes, "").to_world)
    has_view = len(scene.cameras) == 1 and is_framed  # made by the reader: the file has no camera
    cameras = [_place_camera(camera, rotation, meters, origin) for camera in scene.cameras]
    offset = meters * rotation @ (np.array(scene.offset) + origin)
    placed = make_scene(
        scene.name,
        meshes,
        [_place_material(material, meters) for material in scene.materials],
        [framing_camera(meshes, scene.cameras[0].name)] if has_view else cameras,
        scene.environment,
        by_severity([*warnings, *scene.warnings]),
        {name: _place_look(look, meters) for name, look in scene.variants.items()},
        [_place_light(light, rotation, meters, origin) for light in scene.lights],
        (float(offset[0]), float(offset[1]), float(offset[2])),
    )
    return replace(placed, import_options=options.document())


def bounds(scene: Scene) -> tuple[Shaped[F64, " 3"], Shaped[F64, " 3"]]:
    """Return the lowest and the highest coordinates of a scene's vertices."""
    low, high = bounding_box(np.concatenate([bounding_box(mesh.positions) for mesh in scene.meshes]))
    return low.astype(np.float64), high.astype(np.float64)


def area(scene: Scene) -> float:
    """Area of all triangles of a scene, m²."""
    return sum(mesh_area(mesh) for mesh in scene.meshes)


def _guess_unit(sides: F64, warnings: list[ImporterWarning]) -> float:
    """The largest of m, cm and mm that makes the longest side at most `LARGE`."""
    longest = float(sides.max())
    unit = next((unit for unit in ("m", "cm") if longest * METERS[unit] <= LARGE), "mm")
    size = f"its longest side is {longest:,.4g}, so that it is {longest * METERS[unit]:,.4g} m"
    warnings.append(approximated(f"The unit of the file was guessed as {unit}: {size}."))
    return METERS[unit]


def _place_mesh(mesh: Mesh, rotation: F64, meters: float, origin: F64) -> Mesh:
    positions = (mesh.positions.astype(np.float64) - origin) @ rotation.T * meters
    tangents = np.concatenate([mesh.tangents[:, :3] @ rotation.T, mesh.tangents[:, 3:]], axis=1)
    turned = positions.astype(np.float32), (mesh.normals @ rotation.T).astype(np.float32), tangents.astype(np.float32)
    return replace(mesh, positions=turned[0], normals=turned[1], tangents=turned[2])


def _place_camera(camera: Camera, rotation: F64, meters: float, origin: F64) -> Camera:
    to_world = camera.to_world.copy()
    to_world[:3, :3] = rotation @ to_world[:3, :3]
    to_world[:3, 3] = meters * rotation @ (to_world[:3, 3] - origin)
    return replace(camera, to_world=to_world, lens=camera.lens and camera.lens.scaled(meters))


def _place_light(light: Light, rotation: F64, meters: float, origin: F64) -> Light:
    fields = dict(light.fields)
    if "position" in fields:
        fields["position"] = (meters * rotation @ (np.array(fields["position"]) - origin)).tolist()
    if "direction" in fields:
        fields["direction"] = (rotation @ np.array(fields["direction"])).tolist()
    if "size" in fields:
        fields["size"] = [side * meters for side in fields["size"]]
    members = light.members
    if members is not None:
        position = (meters * (members.position.astype(np.float64) - origin) @ rotation.T).astype(np.float32)
        direction = (members.direction @ rotation.T).astype(np.float32)
        size = (members.size * meters).astype(np.float32)
        members = members._replace(position=position, direction=direction, size=size)
    return replace(light, fields=fields, members=members)


def _place_material(material: Material, meters: float) -> Material:
    if material.glass is None:
        return material
    red, green, blue = material.glass.absorbed
    absorbed = (red / meters, green / meters, blue / meters)
    return replace(
        material, glass=replace(material.glass, thickness=material.glass.thickness * meters, absorbed=absorbed)
    )


def _place_look(look: Mapping[str, Any], meters: float) -> dict[str, Any]:
    """A partial look with the absorption of its glasses per meter."""
    placed = dict(look)
    if "materials" in placed:
        placed["materials"] = {name: _place_glass(fields, meters) for name, fields in placed["materials"].items()}
    return placed


def _place_glass(fields: Mapping[str, Any], meters: float) -> dict[str, Any]:
    glass = fields.get("glass")
    if not glass or "absorption" not in glass:
        return dict(fields)
    return {**fields, "glass": {**glass, "absorption": [rate / meters for rate in glass["absorption"]]}}
