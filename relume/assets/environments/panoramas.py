"""Conversion of panoramas in other projections to equirectangular maps.

Directions are those of `relume.assets.environments.equirect`: the front, at the center of a map, is +X, and its right
is +Z. Faces of cubes show the view from inside. Their layouts are:

    horizontal cross:           vertical cross:     six faces in a column or a row:
            up                       up             Direct3D and OpenGL: right, left, up, down, front, back
      left front right back     left front right    OpenEXR (ImfEnvmap.h): left, right, up, down, front, back,
           down                     down                where up and down are turned by half a turn
                                    back, turned by half a turn

An angular map is the light probe of Debevec (1998): a disk with the front at its center, where the distance from the
center is proportional to the angle θ from the front, up to 180° at the edge. In a mirror ball, which an orthographic
camera faces, the distance is sin(θ / 2). Pixels do not tell one from the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup, uv_to_direction
from relume.image_io.downsample import downsample

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Indices = NDArray[np.intp]

Lookup = Callable[[Shaped[F32, "height width 3"], Shaped[F32, "n 3"]], Shaped[F32, "n 3"]]


class Panorama(NamedTuple):
    """A projection.

    Attributes:
        name: in messages. lookup: radiance of an image in unit directions.
        width: of an equirectangular map with texels as fine as those of the image.
    """

    name: str
    lookup: Lookup
    width: int


class _CubeLayout(NamedTuple):
    """Faces of a cube in a grid of cells.

    Attributes:
        frames: right, up and forward of each face's image, as rows. (6, 3, 3)
        cells: row and column of each face. (6, 2)
    """

    name: str
    frames: Shaped[F64, "6 3 3"]
    cells: Shaped[Indices, "6 2"]


_FRONT = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0]])
_RIGHT = np.array([[-1, 0, 0], [0, 1, 0], [0, 0, 1]])
_BACK = np.array([[0, 0, -1], [0, 1, 0], [-1, 0, 0]])
_LEFT = np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1]])
_UP = np.array([[0, 0, 1], [-1, 0, 0], [0, 1, 0]])
_DOWN = np.array([[0, 0, 1], [1, 0, 0], [0, -1, 0]])
_HALF_TURN = np.diag([-1, -1, 1])

_CROSS_CELLS = {(0, 1): _UP, (1, 0): _LEFT, (1, 1): _FRONT, (1, 2): _RIGHT, (2, 1): _DOWN}
_GRAPHICS_API_FACES = (_RIGHT, _LEFT, _UP, _DOWN, _FRONT, _BACK)
_OPENEXR_FACES = (_LEFT, _RIGHT, _HALF_TURN @ _UP, _HALF_TURN @ _DOWN, _FRONT, _BACK)


def _cube_layout(name: str, faces: Mapping[tuple[int, int], NDArray[np.int_]]) -> _CubeLayout:
    return _CubeLayout(name, np.stack(list(faces.values())).astype(np.float64), np.array(list(faces)))


def _six_faces(shape: str, cells: Sequence[tuple[int, int]]) -> tuple[_CubeLayout, _CubeLayout]:
    orders = {"OpenEXR": _OPENEXR_FACES, "Direct3D and OpenGL": _GRAPHICS_API_FACES}
    first, second = (
        _cube_layout(f"{shape} of six cube faces in the order of {order}", dict(zip(cells, faces, strict=True)))
        for order, faces in orders.items()
    )
    return first, second


_CUBE_LAYOUTS: Mapping[tuple[int, int], Sequence[_CubeLayout]] = {
    (4, 3): (_cube_layout("a horizontal cross of cube faces", {**_CROSS_CELLS, (1, 3): _BACK}),),
    (3, 4): (_cube_layout("a vertical cross of cube faces", {**_CROSS_CELLS, (3, 1): _HALF_TURN @ _BACK}),),
    (6, 1): _six_faces("a row", [(0, k) for k in range(6)]),
    (1, 6): _six_faces("a column", [(k, 0) for k in range(6)]),
}
"""Layouts by columns and rows of cells."""

ANGULAR_MAP = "an angular map"
_MIN_ALMOST_HEIGHT, _MAX_ROWS_OFF = 64, 2
_MAX_BLANK_RANGE = 0.01  # of unused texels, relative to the mean of all
_MIN_BLANK_RADIUS = 1.04  # relative to the disk, whose edge may be smooth
_SEAM_SAMPLES, _SEAM_OFFSET = 64, 0.02
_STRIP_ROWS = 16


def is_panorama_size(width: int, height: int) -> bool:
    """True if an image of this size may be a panorama."""
    is_cube = any(width * rows == height * columns for columns, rows in _CUBE_LAYOUTS)
    return is_cube or width == height or _is_almost_equirectangular(width, height)


def find_panorama(
    image: Shaped[F32, "height width 3"], *, is_openexr_cube: bool, is_mirror_ball: bool
) -> Panorama | None:
    """Find the projection of an image that is not 2:1; None if it shows none.

    Six faces have two orders; the one whose neighboring faces agree better is taken. In crosses and disks the rest of
    the image must be blank, unlike in photographs of the same shape.

    Args:
        is_openexr_cube: the file says that it has cube faces in the order of OpenEXR.
        is_mirror_ball: a disk is a mirror ball, not an angular map.
    """
    height, width, _ = image.shape
    if _is_almost_equirectangular(width, height):
        return Panorama("an equirectangular map", lookup, width // 2 * 2)
    if width == height:
        is_map = _is_blank(image, _radius(width) > _MIN_BLANK_RADIUS)
        name, radius = ("a mirror ball", _mirror_radius) if is_mirror_ball else (ANGULAR_MAP, _angular_radius)
        return Panorama(name, partial(_look_up_disk, radius), 2 * width) if is_map else None
    columns, rows = next(ratio for ratio in _CUBE_LAYOUTS if width * ratio[1] == height * ratio[0])
    layouts = _CUBE_LAYOUTS[columns, rows]
    size = width // columns
    is_unused = np.ones((rows, columns), bool)
    is_unused[tuple(layouts[0].cells.T)] = False
    if not _is_blank(image, np.kron(is_unused, np.ones((size, size), bool))):
        return None
    layout = layouts[0] if is_openexr_cube else min(layouts, key=lambda layout: _seam_contrast(layout, image))
    return Panorama(layout.name, partial(_look_up_cube, layout), 4 * size)


def to_equirectangular(
    panorama: Panorama, image: Shaped[F32, "height width 3"], width: int
) -> Shaped[F32, "rows columns 3"]:
    """Resample an image to an equirectangular map; texels are means of at least 2 × 2 samples of each source texel.

    Args:
        panorama: projection of the image.
        width: of the map, even.
    """
    scale = 2 * -(-panorama.width // width)
    height = width // 2
    u = (np.arange(width * scale) + 0.5) / (width * scale)
    radiance = np.empty((height, width, 3), np.float32)
    for first in range(0, height, _STRIP_ROWS):
        rows = min(_STRIP_ROWS, height - first)
        v = (np.arange(first * scale, (first + rows) * scale) + 0.5) / (height * scale)
        directions = uv_to_direction(*np.meshgrid(u, v)).reshape(-1, 3).astype(np.float32)
        samples = panorama.lookup(image, directions).reshape(rows * scale, width * scale, 3)
        radiance[first : first + rows] = downsample(samples, (width, rows))
    return radiance


def _is_almost_equirectangular(width: int, height: int) -> bool:
    return width == 2 * height or (height >= _MIN_ALMOST_HEIGHT and abs(width - 2 * height) <= 2 * _MAX_ROWS_OFF)


def _is_blank(image: F32, mask: NDArray[np.bool_]) -> bool:
    """True if masked texels have one color."""
    texels = image[mask]
    return len(texels) == 0 or bool(np.ptp(texels, axis=0).max() <= _MAX_BLANK_RANGE * image.mean())


def _radius(size: int) -> Shaped[F64, "size size"]:
    """Distance of texels from the center of a disk of radius 1."""
    x = (2 * np.arange(size) + 1) / size - 1
    return np.hypot(x[:, None], x)


def _angular_radius(angle: F64) -> F64:
    return np.asarray(angle / np.pi)


def _mirror_radius(angle: F64) -> F64:
    return np.asarray(np.sin(angle / 2))


def _look_up_disk(radius_of: Callable[[F64], F64], image: F32, directions: F32) -> F32:
    """Radiance of a disk. radius_of: distance from its center, from the angle to the front, radians"""
    size = len(image)
    forward, up, right = np.asarray(directions, np.float64).T
    radius = np.minimum(radius_of(np.arctan2(np.hypot(up, right), forward)), 1 - 2 / size)
    azimuth = np.arctan2(up, right)
    x, y = 1 + radius * np.cos(azimuth), 1 - radius * np.sin(azimuth)
    return _bilinear(image, 0.5 * size * x, 0.5 * size * y, size)


def _look_up_cube(layout: _CubeLayout, image: F32, directions: F32) -> F32:
    size = image.shape[0] // (layout.cells[:, 0].max() + 1)
    face = (directions @ layout.frames[:, 2].T).argmax(axis=1)
    right, up, forward = np.einsum("nij,nj->in", layout.frames[face], directions)
    x, y = 0.5 * size * (1 + right / forward), 0.5 * size * (1 - up / forward)
    return _bilinear(image, x, y, size, *(size * layout.cells[face].T))


def _bilinear(
    image: F32,
    x: F64,
    y: F64,
    size: int,
    first_row: NDArray[np.intp] | int = 0,
    first_column: NDArray[np.intp] | int = 0,
) -> F32:
    """Interpolate within squares of the image. x, y: texels from their left and top edge"""
    x, y = np.clip(x - 0.5, 0, size - 1), np.clip(y - 0.5, 0, size - 1)
    left, upper = x.astype(np.intp), y.astype(np.intp)
    fx, fy = (x - left)[:, None], (y - upper)[:, None]
    columns = [first_column + left, first_column + np.minimum(left + 1, size - 1)]
    top, bottom = (
        image[row, columns[0]] * (1 - fx) + image[row, columns[1]] * fx
        for row in (first_row + upper, first_row + np.minimum(upper + 1, size - 1))
    )
    return np.asarray(top * (1 - fy) + bottom * fy, np.float32)


def _seam_contrast(layout: _CubeLayout, image: F32) -> float:
    """Mean relative difference of radiance across the edges of the cube."""
    a, b, along = (
        grid.ravel() for grid in np.meshgrid([-1.0, 1.0], [-1.0, 1.0], np.linspace(-0.9, 0.9, _SEAM_SAMPLES))
    )
    sides = [
        np.concatenate([np.roll(np.stack([p * a, q * b, along], axis=-1), axis, axis=1) for axis in range(3)])
        for p, q in ((1 - _SEAM_OFFSET, 1), (1, 1 - _SEAM_OFFSET))
    ]
    near, far = (_look_up_cube(layout, image, side) for side in sides)
    return float(np.mean(np.abs(near - far) / (near + far + np.float32(1e-30))))
