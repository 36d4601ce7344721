"""btf.sphere_rmse: a ball covered with a BTF of the weave, against the actual small geometry wrapped around it.

The plane is wrapped around the ball by the stereographic projection, which maps small squares to squares: texture
coordinates are points of the plane, and the heights of the geometry shrink with its sides. A black ball is inside,
because nothing is below a BTF. Both are lit by the whole environment. Compared are pixels whose centers are on the
ball, except near its silhouette; `near` and `rim` are those viewed at less than 60° from the normal, and the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.btf_store import BtfRecord
from relume.assets.environments.environment import Environment
from relume.assets.environments.studio import studio
from relume.output.render_image import render_image
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume.synthetic_btf.tileable_geometry import Tile, centered_height, repeat_tile
from relume_bench.btf_pictures import bake_with_btf, traced_by_peer
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import missing
from relume_bench.standard_error import compare_with_passes

F64 = NDArray[np.float64]

_RADIUS = 1.25  # periods
_VISIBLE_ANGLE = np.radians(115.0)  # from the center of the plane, which is almost turned to the camera
_SPHERE_ROTATION = np.radians(20.0)
_FAR, _ACROSS = 40.0, 2.7  # camera distance and extent of the image, periods
_MAX_RADIUS = 0.97  # of the radius
_STEPS = 160  # grid of the smooth ball, along the plane's sides
_NEAR_COSINE = np.cos(np.radians(60.0))
_BLACK: tuple[dict[str, Any], ...] = ({"model": "lambert", "color": [0.0, 0.0, 0.0]},)


def against_displaced(record: BtfRecord, folder: Path, tiny: bool) -> Figure:
    """Compare a covered ball with the path-traced geometry around it.

    Args:
        record: record of the weave. folder: for stores. tiny: a trial run.
    """
    name = "btf.sphere_rmse"
    if (why := missing()) is not None:
        return skipped((name,), "%", why)[0]
    size, spp = ((16, 16), 2) if tiny else ((128, 128), 64)
    smooth, displaced_scene = _make_scenes()
    bake, look = bake_with_btf(smooth, record, size, folder / "sphere.zarr", 60 if tiny else 2000)
    rendered = render_image(bake, "camera", look)[..., :3].astype(np.float64)
    reference_passes = traced_by_peer(
        displaced_scene, size, spp, [GEOMETRIES["weave"]().materials[0], _BLACK], folder / "sphere"
    )
    cosine = _cosines(displaced_scene.cameras[0], size)
    row_masks = {"all": cosine > 0, "near": cosine > _NEAR_COSINE, "rim": (cosine > 0) & (cosine <= _NEAR_COSINE)}
    errors = {
        label: compare_with_passes(rendered[rows][None], reference_passes[:, rows][:, None])
        for label, rows in row_masks.items()
    }
    whole = errors["all"]
    context: dict[str, Any] = {
        **{label: errors[label].summary for label in ("near", "rim")}, "bias": whole.bias.value, "noise": whole.noise,
        "compression_error": record.error[-1], "periods_across": 2 * _RADIUS, "pixels": int(row_masks["all"].sum()),
        "spp": PASSES * spp, "size": list(size),
    }  # fmt: skip
    return Figure(name, 100 * whole.error.value, "%", context, 100 * whole.error.standard_error)


def _make_scenes() -> tuple[Scene, Scene]:
    """The smooth ball, and the actual geometry around a black one, viewed from far away."""
    tile = centered_height(GEOMETRIES["weave"]())
    towards = np.array([np.sin(_SPHERE_ROTATION) * 0.8, np.sin(_SPHERE_ROTATION) * 0.6, np.cos(_SPHERE_ROTATION)])
    camera = look_at("camera", tuple(_FAR * towards), (0.0, 0.0, 0.0), 2 * float(np.arctan(0.5 * _ACROSS / _FAR)))
    environment = Environment("sky", np.array(studio().radiance))
    cloth, black = Material("Cloth", tuple(map(dict, tile.materials[0]))), Material("Black", _BLACK)
    lowest = _RADIUS + float(tile.positions[:, 2].min())
    return (
        make_scene("smooth", [_make_sphere(_RADIUS, 0)], (cloth,), [camera], environment),
        make_scene("real", [_wrap_tile(tile), _make_sphere(0.99 * lowest, 1)], (cloth, black), [camera], environment),
    )


def _project_to_sphere(uvs: F64) -> tuple[F64, F64, F64]:
    """Map points of the plane (n, 2) to the unit ball: normal, x axis, y axis. (n, 3) each"""
    p, q = (uvs / (2 * _RADIUS)).T
    s = 1 + p**2 + q**2
    return (
        np.stack([2 * p, 2 * q, 2 - s], axis=1) / s[:, None],
        np.stack([s - 2 * p**2, -2 * p * q, -2 * p], axis=1) / s[:, None],
        np.stack([-2 * p * q, s - 2 * q**2, -2 * q], axis=1) / s[:, None],
    )


def _reach() -> float:
    """Half width of the covered plane, periods."""
    return float(2 * _RADIUS * np.tan(_VISIBLE_ANGLE / 2))


def _wrap_tile(tile: Tile) -> Mesh:
    repeated_tile = repeat_tile(tile, int(np.ceil(_reach())))
    middle = repeated_tile.positions[repeated_tile.faces, :2].mean(axis=1)
    faces = repeated_tile.faces[np.hypot(*middle.T) < _reach()]
    used = np.zeros(len(repeated_tile.positions), bool)
    used[faces] = True
    faces = (np.cumsum(used) - 1)[faces]
    positions, normals = repeated_tile.positions[used], repeated_tile.normals[used]
    n, x, y = _project_to_sphere(positions[:, :2])
    shrunk = 0.5 * (1 + n[:, 2:])  # sides of the plane, on the ball
    rotated_normals = normals[:, :1] * x + normals[:, 1:2] * y + normals[:, 2:] * n
    return _mesh((_RADIUS + shrunk * positions[:, 2:]) * n, rotated_normals, faces, x, positions[:, :2], 0)


def _make_sphere(radius: float, material: int) -> Mesh:
    """The smooth covered ball."""
    along = np.linspace(-_reach(), _reach(), _STEPS + 1)
    uvs = np.stack([grid.ravel() for grid in np.meshgrid(along, along)], axis=1)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(_STEPS), np.arange(_STEPS), indexing="ij"))
    a = i * (_STEPS + 1) + j
    faces = np.concatenate([np.stack([a, a + 1, a + _STEPS + 2], 1), np.stack([a, a + _STEPS + 2, a + _STEPS + 1], 1)])
    n, x, _ = _project_to_sphere(uvs)
    return _mesh(radius * n, n, faces, x, uvs, material)


def _mesh(positions: F64, normals: F64, faces: NDArray[Any], tangents: F64, uvs: F64, material: int) -> Mesh:
    """A mesh whose texture coordinates are points of the plane, v down."""
    return Mesh(
        "cloth" if material == 0 else "inside",
        np.ascontiguousarray(positions, np.float32),
        np.ascontiguousarray(normals, np.float32),
        np.ascontiguousarray(np.column_stack([tangents, np.ones(len(tangents))]), np.float32),
        np.ascontiguousarray(uvs * [1, -1], np.float32),
        np.ascontiguousarray(faces, np.uint32),
        material,
    )


def _cosines(camera: Camera, size: tuple[int, int]) -> F64:
    """Cosine between view direction and normal at pixel centers; −1 beside the ball and near its silhouette. (h, w)"""
    width, height = size
    x, y = np.meshgrid(2 * (np.arange(width) + 0.5) / width - 1, 1 - 2 * (np.arange(height) + 0.5) / height)
    half = np.tan(camera.yfov / 2)
    d = np.stack([x * half, y * half, -np.ones_like(x)], axis=-1) @ np.asarray(camera.to_world, np.float64)[:3, :3].T
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    camera_position = np.asarray(camera.to_world, np.float64)[:3, 3]
    along = -d @ camera_position
    perpendicular = np.sqrt(np.maximum(camera_position @ camera_position - along**2, 0))
    return np.where(
        perpendicular < _MAX_RADIUS * _RADIUS, np.sqrt(np.maximum(1 - (perpendicular / _RADIUS) ** 2, 0)), -1.0
    )
