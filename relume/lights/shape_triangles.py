"""Discs, spheres, tubes and sun disks as triangles of equal power, so that all kernels treat them as emissive meshes.

    disc    concentric map of a grid of squares (Shirley and Chiu 1997)
    sphere  octants, each divided into 16
    tube    sides of a prism
    sun     a disc at a distance at which directions from all points of the scene are equal

A triangle carries the power of the equal part of the curved surface that it stands for. All are scaled to the area of
that surface. Triangles are ordered by halves, quarters and so on, see `relume.lights.light_sampling`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.light_axes import light_axes
from relume.look import LightGeometry

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SUN_DISTANCE = 1e4  # in units of the radius of the scene: directions differ by 1e-4 from each other
_QUADRANT_SIDE = 2  # squares along each axis of a quarter of a disc
_TUBE_SIDES, _MAX_TUBE_SEGMENTS = 16, 4
_OCTANT_HALVINGS = 2  # of its edges
_EQUAL_AREA_EXPONENT = 0.75  # of barycentric coordinates: areas of the triangles differ by a tenth


class LightTriangles(NamedTuple):
    """Emissive triangles.

    Attributes:
        corners: corners of the triangles, meters; from the emitting side counterclockwise.
        relative_radiance: radiance of each over the light's emission.
        is_two_sided: emits to both sides.
    """

    corners: Shaped[F32, "T 3 3"]
    relative_radiance: Shaped[F32, " T"]
    is_two_sided: bool


def shape_triangles(geometry: LightGeometry) -> LightTriangles | None:
    """Return the triangles of a disc, sphere or tube; None for other kinds."""
    axes, radius = light_axes(geometry.direction), geometry.radius
    match geometry.kind:
        case "disc":
            return _equal_power(radius * _disc() @ axes, geometry.position, math.pi * radius**2)
        case "sphere":
            return _equal_power(radius * _sphere(), geometry.position, 4 * math.pi * radius**2)
        case "tube":
            area = 2 * math.pi * radius * geometry.length
            return _equal_power(_tube(radius, geometry.length) @ axes, geometry.position, area)
    return None


def sun_triangles(geometry: LightGeometry, center: Shaped[F64, " 3"], radius: float) -> LightTriangles | None:
    """Return the disk of a directional light with an angle, of unit irradiance perpendicular to it; None without one.

    Args:
        geometry: the light. center, radius: of a sphere around the scene, meters.
    """
    if geometry.kind != "directional" or geometry.angle == 0:
        return None
    half_angle, distance = math.radians(geometry.angle / 2), SUN_DISTANCE * max(radius, 1.0)
    axes, disk_radius = light_axes(geometry.direction), distance * math.tan(half_angle)
    position = center - distance * axes[2]
    triangles = _equal_power(disk_radius * _disc() @ axes, position, math.pi * disk_radius**2)
    radiance = np.float32(1 / (math.pi * math.sin(half_angle) ** 2))
    return triangles._replace(relative_radiance=radiance * triangles.relative_radiance)


def _equal_power(corners: F64, position: Shaped[F64, " 3"] | tuple[float, float, float], area: float) -> LightTriangles:
    """Scale triangles around the origin to an area, move them, and give each the same power."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    scaled = math.sqrt(area / areas.sum()) * corners + np.asarray(position, np.float64)
    relative_radiance = areas.mean() / areas
    return LightTriangles(scaled.astype(np.float32), relative_radiance.astype(np.float32), False)


def _grid_triangles(columns: int, rows: int) -> F64:
    """Return the triangles of a grid of the unit square, counterclockwise, two a cell, cells in Morton order.

    columns, rows: powers of two. (T, 3, 2)
    """
    column, row = np.divmod(np.arange(columns * rows), rows)
    order = np.argsort([_interleave(c, r) for c, r in zip(column.tolist(), row.tolist(), strict=True)])
    low = np.stack([column, row], axis=1)[order, None, None]
    cell = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    return np.asarray((low + cell).reshape(-1, 3, 2) / (columns, rows))


def _interleave(column: int, row: int) -> int:
    """Morton number of a cell."""
    return sum((column >> bit & 1) << 2 * bit + 1 | (row >> bit & 1) << 2 * bit for bit in range(8))


def _disc() -> F64:
    """Triangles of the unit disc, facing +Z: each ring of the grid is a polygon of the area of its circle. (T, 3, 3)"""
    x, y = np.moveaxis(_grid_triangles(_QUADRANT_SIDE, _QUADRANT_SIDE), -1, 0)
    radius = np.maximum(x, y)
    ratio = np.divide(np.minimum(x, y), radius, out=np.zeros_like(x), where=radius > 0)
    azimuth = math.pi / 4 * np.where(x > y, ratio, 2 - ratio)
    side_angle = math.pi / 4 / np.maximum(_QUADRANT_SIDE * radius, 1)
    quadrant = radius * np.sqrt(side_angle / np.sin(side_angle)) * np.exp(1j * azimuth)
    disc = np.concatenate([1j**k * quadrant for k in range(4)])
    corners = np.stack([disc.real, disc.imag, np.zeros(disc.shape)], axis=-1)
    # samples lie at equal fractions of all triangles: their first corners differ, or errors of equal triangles add up
    return np.stack([np.roll(triangle, k, axis=0) for k, triangle in enumerate(corners)])


def _sphere() -> F64:
    """Triangles of the unit sphere. (T, 3, 3)"""
    corners = np.eye(3)[None]
    for _ in range(_OCTANT_HALVINGS):
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = (
            np.stack([[a, ab, ca], [ab, bc, ca], [ab, b, bc], [ca, bc, c]]).transpose(2, 0, 1, 3).reshape(-1, 3, 3)
        )
    corners = corners**_EQUAL_AREA_EXPONENT
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    signs = np.array([[x, y, z] for z in (1, -1) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
    # a reflection turns triangles around
    return np.concatenate([sign * (corners if sign.prod() > 0 else corners[:, ::-1]) for sign in signs])


def _tube(radius: float, length: float) -> F64:
    """Triangles of the side of a cylinder about Z. (T, 3, 3)"""
    proportion = length / max(2 * math.pi * radius / _TUBE_SIDES, 1e-30)
    segments = 2 ** round(math.log2(min(max(proportion, 1), _MAX_TUBE_SEGMENTS)))
    u, v = np.moveaxis(_grid_triangles(_TUBE_SIDES, segments), -1, 0)
    # sides as far from the axis that their area is that of the cylinder
    outer = radius * (math.pi / _TUBE_SIDES) / math.sin(math.pi / _TUBE_SIDES)
    angle = 2 * math.pi * u
    return np.stack([outer * np.cos(angle), outer * np.sin(angle), length * (v - 0.5)], axis=-1)
