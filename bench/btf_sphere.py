"""btf.sphere_rmse: a ball that is covered with a BTF of the weave, against the real small geometry wrapped about it.

The plane is wrapped about the ball by the stereographic projection, which turns small squares into squares: texture
coordinates are places of the plane, and the real geometry's heights shrink as its sides do. A black ball lies within,
as nothing is below a BTF. Both are seen by the whole sky. What is compared are pixels whose middles see the ball, but
for a rim; `near` and `rim` are those that see it from less than 60° from its normal, and the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.btf_pictures import covered, traced_by_peer
from bench.figure import Figure, skipped
from bench.indirect import PASSES
from bench.mitsuba import missing
from bench.standard_error import over_passes
from relume.btf.shelf import BtfRecord
from relume.environments.model import Environment
from relume.environments.studio import studio
from relume.render.image import render_image
from relume.scene.archive import make_scene
from relume.scene.demo.still_life import look_at
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.synthetic.make import GEOMETRIES
from relume.synthetic.tile import Tile, levelled, repeated

F64 = NDArray[np.float64]

_RADIUS = 1.25  # periods
_COVERED = np.radians(115.0)  # from the middle of the plane, which is turned to the eye but for some
_TURNED = np.radians(20.0)
_FAR, _ACROSS = 40.0, 2.7  # the eye, and what its picture shows, periods
_RIM = 0.97  # of the radius
_STEPS = 160  # of the smooth ball's grid, along the plane's sides
_NEAR = np.cos(np.radians(60.0))
_BLACK: tuple[dict[str, Any], ...] = ({"model": "lambert", "color": [0.0, 0.0, 0.0]},)


def against_displaced(record: BtfRecord, folder: Path, tiny: bool) -> Figure:
    """Compare a covered ball with the path-traced geometry about it.

    Args:
        record: of the weave. folder: for stores. tiny: whether it is a trial.
    """
    name = "btf.sphere_rmse"
    if (why := missing()) is not None:
        return skipped((name,), "%", why)[0]
    size, spp = ((16, 16), 2) if tiny else ((128, 128), 64)
    smooth, real = _scenes()
    opened, look = covered(smooth, record, size, folder / "sphere.zarr", 60 if tiny else 2000)
    ours = render_image(opened, "eye", look)[..., :3].astype(np.float64)
    theirs = traced_by_peer(real, size, spp, [GEOMETRIES["weave"]().materials[0], _BLACK], folder / "sphere")
    cosine = _cosines(real.cameras[0], size)
    parts = {"all": cosine > 0, "near": cosine > _NEAR, "rim": (cosine > 0) & (cosine <= _NEAR)}
    errors = {part: over_passes(ours[rows][None], theirs[:, rows][:, None]) for part, rows in parts.items()}
    whole = errors["all"]
    context: dict[str, Any] = {
        **{part: errors[part].said for part in ("near", "rim")}, "bias": whole.bias.value, "noise": whole.noise,
        "kept_to": record.error[-1], "periods_across": 2 * _RADIUS, "pixels": int(parts["all"].sum()),
        "spp": PASSES * spp, "size": list(size),
    }  # fmt: skip
    return Figure(name, 100 * whole.error.value, "%", context, 100 * whole.error.standard_error)


def _scenes() -> tuple[Scene, Scene]:
    """The smooth ball and the real geometry about a black one, seen from far away."""
    tile = levelled(GEOMETRIES["weave"]())
    towards = np.array([np.sin(_TURNED) * 0.8, np.sin(_TURNED) * 0.6, np.cos(_TURNED)])
    camera = look_at("eye", tuple(_FAR * towards), (0.0, 0.0, 0.0), 2 * float(np.arctan(0.5 * _ACROSS / _FAR)))
    sky = Environment("sky", np.array(studio().radiance))
    cloth, black = Material("Cloth", tuple(map(dict, tile.materials[0]))), Material("Black", _BLACK)
    lowest = _RADIUS + float(tile.positions[:, 2].min())
    return (
        make_scene("smooth", [_ball(_RADIUS, 0)], (cloth,), [camera], sky),
        make_scene("real", [_wrapped(tile), _ball(0.99 * lowest, 1)], (cloth, black), [camera], sky),
    )


def _about(places: F64) -> tuple[F64, F64, F64]:
    """Where places of the plane (n, 2) lie about the unit ball: normal, axis of x, axis of y. (n, 3) each"""
    p, q = (places / (2 * _RADIUS)).T
    s = 1 + p**2 + q**2
    return (
        np.stack([2 * p, 2 * q, 2 - s], axis=1) / s[:, None],
        np.stack([s - 2 * p**2, -2 * p * q, -2 * p], axis=1) / s[:, None],
        np.stack([-2 * p * q, s - 2 * q**2, -2 * q], axis=1) / s[:, None],
    )


def _reach() -> float:
    """How far the plane is covered, periods."""
    return float(2 * _RADIUS * np.tan(_COVERED / 2))


def _wrapped(tile: Tile) -> Mesh:
    around = repeated(tile, int(np.ceil(_reach())))
    middle = around.positions[around.faces, :2].mean(axis=1)
    faces = around.faces[np.hypot(*middle.T) < _reach()]
    used = np.zeros(len(around.positions), bool)
    used[faces] = True
    faces = (np.cumsum(used) - 1)[faces]
    positions, normals = around.positions[used], around.normals[used]
    n, x, y = _about(positions[:, :2])
    shrunk = 0.5 * (1 + n[:, 2:])  # sides of the plane, on the ball
    turned = normals[:, :1] * x + normals[:, 1:2] * y + normals[:, 2:] * n
    return _mesh((_RADIUS + shrunk * positions[:, 2:]) * n, turned, faces, x, positions[:, :2], 0)


def _ball(radius: float, material: int) -> Mesh:
    """What is covered, smooth."""
    along = np.linspace(-_reach(), _reach(), _STEPS + 1)
    places = np.stack([grid.ravel() for grid in np.meshgrid(along, along)], axis=1)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(_STEPS), np.arange(_STEPS), indexing="ij"))
    a = i * (_STEPS + 1) + j
    faces = np.concatenate([np.stack([a, a + 1, a + _STEPS + 2], 1), np.stack([a, a + _STEPS + 2, a + _STEPS + 1], 1)])
    n, x, _ = _about(places)
    return _mesh(radius * n, n, faces, x, places, material)


def _mesh(positions: F64, normals: F64, faces: NDArray[Any], tangents: F64, places: F64, material: int) -> Mesh:
    """A mesh whose texture coordinates are places of the plane, v down."""
    return Mesh(
        "cloth" if material == 0 else "inside",
        np.ascontiguousarray(positions, np.float32),
        np.ascontiguousarray(normals, np.float32),
        np.ascontiguousarray(np.column_stack([tangents, np.ones(len(tangents))]), np.float32),
        np.ascontiguousarray(places * [1, -1], np.float32),
        np.ascontiguousarray(faces, np.uint32),
        material,
    )


def _cosines(camera: Camera, size: tuple[int, int]) -> F64:
    """Cosine between the eye and the ball's normal where pixels' middles see it; −1 beside it and on its rim. (h, w)"""
    width, height = size
    x, y = np.meshgrid(2 * (np.arange(width) + 0.5) / width - 1, 1 - 2 * (np.arange(height) + 0.5) / height)
    half = np.tan(camera.yfov / 2)
    d = np.stack([x * half, y * half, -np.ones_like(x)], axis=-1) @ np.asarray(camera.to_world, np.float64)[:3, :3].T
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    eye = np.asarray(camera.to_world, np.float64)[:3, 3]
    along = -d @ eye
    beside = np.sqrt(np.maximum(eye @ eye - along**2, 0))
    return np.where(beside < _RIM * _RADIUS, np.sqrt(np.maximum(1 - (beside / _RADIUS) ** 2, 0)), -1.0)
