"""Implicit shapes of UsdGeom as polygons: Cube, Plane, Sphere, Cylinder, Cone and Capsule."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene_io.usd.polygon_mesh import PolygonMesh

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
SEGMENTS = 64  # around an axis
_TO_AXIS = {
    "X": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "Z": np.eye(3),
}
"""Rotations of Z to an axis; the width of a plane stays along X, or becomes that along Z, as its schema says."""


def shape_mesh(prim: Any, time: Any) -> PolygonMesh | None:
    """Make the polygons of an implicit shape; None if the prim is none, or has no size.

    Args:
        prim: a UsdPrim. time: a UsdTimeCode.
    """

    def number(*names: str) -> float:
        value = next((value for name in names if (value := prim.GetAttribute(name).Get(time)) is not None), 0.0)
        return float(value) if np.isfinite(value) else 0.0

    kind = str(prim.GetTypeName()).removesuffix("_1")
    height = number("height")
    if kind == "Cube":
        mesh = _cube(number("size"))
    elif kind == "Plane":
        mesh = _plane(number("width"), number("length"))
    elif kind == "Sphere":
        mesh = _revolve(_arc(number("radius"), 0.0, -np.pi / 2, np.pi / 2))
    elif kind in ("Cylinder", "Cone"):
        bottom, top = number("radiusBottom", "radius"), 0.0 if kind == "Cone" else number("radiusTop", "radius")
        mesh = _revolve(np.array([[0, -height / 2], [bottom, -height / 2], [top, height / 2], [0, height / 2]]))
    elif kind == "Capsule":
        lower = _arc(number("radiusBottom", "radius"), -height / 2, -np.pi / 2, 0)
        mesh = _revolve(np.concatenate([lower, _arc(number("radiusTop", "radius"), height / 2, 0, np.pi / 2)]))
    else:
        return None
    axis = prim.GetAttribute("axis").Get(time) if prim.HasAttribute("axis") else "Z"
    points = mesh.points @ _TO_AXIS.get(str(axis), _TO_AXIS["Z"]).T
    return PolygonMesh(points, mesh.lengths, mesh.vertex, mesh.face, is_smooth=True) if np.ptp(points) > 0 else None


def _cube(size: float) -> PolygonMesh:
    points = (np.indices((2, 2, 2)).reshape(3, -1).T.astype(np.float64) - 0.5) * size  # z changes fastest
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return PolygonMesh(points, np.full(6, 4), faces.reshape(-1), np.arange(6))


def _plane(width: float, length: float) -> PolygonMesh:
    """A rectangle whose normal is +Z."""
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * np.array([width / 2, length / 2, 0])
    return PolygonMesh(corners, np.array([4]), np.arange(4), np.arange(1))


def _arc(radius: float, height: float, low: float, high: float) -> Shaped[F64, "points 2"]:
    """Points (radius, height) of a circle's arc about a center on the axis; angles are elevations, radians."""
    angle = np.linspace(low, high, 1 + round(SEGMENTS * (high - low) / (2 * np.pi)))
    return np.stack([np.round(radius * np.cos(angle), 12), height + radius * np.sin(angle)], axis=1)


def _revolve(profile: Shaped[F64, "points 2"]) -> PolygonMesh:
    """The surface of a profile (radius, height), from bottom to top, that rotates about Z; poles are one point."""
    angle = np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points, rows = list[F64](), list[I64]()
    num_points = 0
    for radius, height in profile:
        count = SEGMENTS if radius > 0 else 1
        rows.append(num_points + np.arange(SEGMENTS) % count)
        num_points += count
        points.append(np.column_stack([radius * circle[:count], np.full(count, height)]))
    faces, lengths = list[I64](), list[I64]()
    for below, above in pairwise(rows):
        quads = np.stack([below, np.roll(below, -1), np.roll(above, -1), above], axis=1)
        is_corner = np.ones(4, np.bool_)
        is_corner[1], is_corner[2] = below[0] != below[1], above[0] != above[1]
        if is_corner.sum() >= 3:
            faces.append(quads[:, is_corner].reshape(-1))
            lengths.append(np.full(SEGMENTS, is_corner.sum()))
    count = sum(len(block) for block in lengths)
    empty = [np.zeros(0, np.int64)]
    vertex, counts = (np.concatenate([*empty, *blocks]).astype(np.int64) for blocks in (faces, lengths))
    return PolygonMesh(np.concatenate(points), counts, vertex, np.arange(count))
