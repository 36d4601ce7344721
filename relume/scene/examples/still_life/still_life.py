"""Arrangement of the objects and cameras in the demo scene."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.examples.still_life import cloth, pearls, tray
from relume.scene.examples.still_life.grids import GridSurface, merge_surfaces, rotation_y
from relume.scene.examples.still_life.teapot import teapot
from relume.scene.model import Camera, Mesh

F64 = NDArray[np.float64]

TRAY_Y = cloth.THICKNESS + pearls.GAP
FLOOR_Y = TRAY_Y + tray.FLOOR + pearls.GAP
TEAPOT_HEIGHT, TEAPOT_POSITION, TEAPOT_ANGLE_DEG = 0.150, (-0.048, -0.032), -26.0
BOWL_POSITION = (0.143, 0.050)


def meshes() -> tuple[Mesh, ...]:
    """Return all objects in world space; material indices as in `relume.scene.examples.still_life.palette`."""
    pot = teapot(14, TEAPOT_HEIGHT).transform(
        rotation_y(TEAPOT_ANGLE_DEG), (TEAPOT_POSITION[0], FLOOR_Y, TEAPOT_POSITION[1])
    )
    lift = (0.0, TRAY_Y, 0.0)
    objects: list[tuple[str, GridSurface]] = [
        ("Teapot", pot),
        ("Tray", tray.tray().transform(np.eye(3), lift)),
        ("Handles", tray.handles().transform(np.eye(3), lift)),
        ("Pearls", _pearls()),
        ("Bowl", pearls.bowl().transform(np.eye(3), (BOWL_POSITION[0], FLOOR_Y, BOWL_POSITION[1]))),
        ("Cloth", cloth.cloth()),
        ("Table", cloth.stage()),
    ]
    return tuple(surface.mesh(name, material) for material, (name, surface) in enumerate(objects))


def cameras() -> tuple[Camera, ...]:
    """Return two cameras for 4:3 images, with a focal length of about 55 mm on a full-frame sensor."""
    yfov = float(np.radians(24.0))
    return (
        look_at("front", (0.09, 0.350, 0.91), (0.008, 0.050, 0.030), yfov),
        look_at("left", (-0.72, 0.29, 0.60), (0.005, 0.050, 0.025), yfov),
    )


def look_at(name: str, position: tuple[float, float, float], target: tuple[float, float, float], yfov: float) -> Camera:
    """Return a level camera at `position` with `target` in the center of its image.

    Args:
        name: name of the view.
        position, target: world space, meters; the view direction must not be vertical.
        yfov: vertical field of view, radians.
    """
    backward = np.subtract(position, target)
    backward /= np.linalg.norm(backward)
    right = np.cross([0.0, 1.0, 0.0], backward)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3] = np.column_stack([right, np.cross(backward, right), backward, position])
    return Camera(name, to_world, yfov)


def ground_height(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Height of the tray, cloth and table combined."""
    return np.maximum(cloth.cloth_height(x, z), tray.tray_height(x, z) + TRAY_Y)


def _pearls() -> GridSurface:
    groups = [pearls.pearls(*_string()), pearls.pearls(*_heap()), pearls.pearls(*_loose())]
    return merge_surfaces(groups)


def _string() -> tuple[F64, F64]:
    """A graduated string: from behind the bowl, around the teapot's foot, over the tray's rim and onto the cloth."""
    corners = np.array(
        [
            [0.178, -0.045], [0.120, -0.035], [0.082, 0.020], [0.070, 0.078], [0.018, 0.092], [-0.040, 0.118],
            [-0.058, 0.170], [-0.020, 0.215], [0.040, 0.212], [0.075, 0.190],
        ]
    )  # fmt: skip
    path = smooth_path(corners)
    num_pearls = 52
    middle = np.abs(np.linspace(-1, 1, num_pearls))
    radii = 0.0072 - 0.0026 * middle**1.5
    centers = pearls.place_along_path(ground_height, path, radii)
    return centers, radii[: len(centers)]


def _heap() -> tuple[F64, F64]:
    radii = np.random.default_rng(3).uniform(0.0070, 0.0098, 30)
    height = _shift_height(pearls.bowl_height, BOWL_POSITION, FLOOR_Y)
    return pearls.pour_heap(height, BOWL_POSITION, 0.034, radii, seed=11), radii


def _loose() -> tuple[F64, F64]:
    """Three large, scattered pearls."""
    radii = np.array([0.0135, 0.0105, 0.0085])
    positions = ((0.150, 0.205), (0.182, 0.193), (-0.168, 0.090))
    centers = [
        (x, pearls.contact_height(ground_height, x, z, r), z) for (x, z), r in zip(positions, radii, strict=True)
    ]
    return np.array(centers), radii


def _shift_height(
    height: Callable[[F64, F64], F64], position: tuple[float, float], lift: float
) -> Callable[[F64, F64], F64]:
    return lambda x, z: height(x - position[0], z - position[1]) + lift


def smooth_path(corners: Shaped[F64, "corners 2"]) -> Shaped[F64, "points 2"]:
    """Interpolate corners by a Catmull–Rom spline."""
    padded = np.concatenate([2 * corners[:1] - corners[1:2], corners, 2 * corners[-1:] - corners[-2:-1]])
    t = np.linspace(0, 1, 24, endpoint=False)[:, None]
    spans = []
    for a, b, c, d in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        cubic = 2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3
        spans.append(cubic / 2)
    return np.concatenate([*spans, corners[-1:]])
