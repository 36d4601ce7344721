"""A rounded rectangular tray with a raised rim, and its two handles."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.examples.still_life.grids import (
    GridSurface,
    closed_grid_surface,
    grid_faces,
    merge_surfaces,
    normalize,
    sphere,
)

F64 = NDArray[np.float64]

HALF_SIZE = np.array([0.212, 0.140])  # of the flat floor, x and z
CORNER = 0.055
FLOOR = 0.006  # height of the floor above the tray's underside
WALL = 0.0055  # thickness of the rim
FILLET, SLOPE, WALL_LENGTH = 0.010, np.radians(66.0), 0.014
TUBE = 0.0042


def rim_profile() -> Shaped[F64, "rows 2"]:
    """(distance from the floor's outline, height) from the floor's edge over the lip down to the underside."""
    a = np.linspace(0, SLOPE, 9)
    fillet = np.column_stack([FILLET * np.sin(a), FLOOR + FILLET * (1 - np.cos(a))])
    up = np.array([np.cos(SLOPE), np.sin(SLOPE)])
    right = np.array([up[1], -up[0]])
    top = fillet[-1] + WALL_LENGTH * up
    angle = np.linspace(0, np.pi, 11)[:, None]
    lip = top + WALL / 2 * (right - right * np.cos(angle) + up * np.sin(angle))
    down = lip[-1] - lip[-1, 1] / up[1] * np.linspace(0, 1, 5)[1:, None] * up
    wall = fillet[-1] + np.linspace(0, 1, 5)[1:-1, None] * WALL_LENGTH * up
    return np.concatenate([fillet, wall, lip, down])


def floor_outline(num_per_corner: int = 12) -> tuple[Shaped[F64, "points 2"], Shaped[F64, "points 2"]]:
    """Return the floor's boundary and its outward normals, closed (last = first), in (x, z)."""
    points, normals = [], []
    for corner, (sx, sz) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        phi = (corner + np.linspace(0, 1, num_per_corner)) * np.pi / 2
        normal = np.column_stack([np.cos(phi), np.sin(phi)])
        normals.append(normal)
        points.append((HALF_SIZE - CORNER) * (sx, sz) + CORNER * normal)
    outline, outward = np.concatenate(points), np.concatenate(normals)
    return np.concatenate([outline, outline[:1]]), np.concatenate([outward, outward[:1]])


def distance_outside(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Signed distance from the floor's outline, negative inside."""
    q = np.abs(np.stack([x, z], -1)) - (HALF_SIZE - CORNER)
    return np.asarray(np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(-1), 0) - CORNER)


def tray_height(x: Shaped[F64, "*points"], z: Shaped[F64, "*points"]) -> Shaped[F64, "*points"]:
    """Height of the tray's upper side above its underside; -1 outside the tray."""
    profile = rim_profile()
    upper = profile[: int(profile[:, 0].argmax()) + 1]
    return np.interp(distance_outside(x, z), upper[:, 0], upper[:, 1], right=-1.0)


def tray() -> GridSurface:
    """Return the tray, its underside at y = 0, centered at the origin; UV coordinates from above, grain along x."""
    outline, outward = floor_outline()
    profile = rim_profile()
    ring = outline[None] + profile[:, None, :1] * outward[None]
    rim_points = np.stack([ring[..., 0], np.broadcast_to(profile[:, 1:], ring.shape[:2]), ring[..., 1]], -1)
    rim = closed_grid_surface(rim_points, _top_view_uvs(rim_points))
    top = _disc(rim_points[0, :-1], upward=True)
    bottom = _disc(rim_points[-1, :-1], upward=False)
    return merge_surfaces([rim, top, bottom])


def _top_view_uvs(points: F64) -> F64:
    return np.stack([points[..., 0] / 0.5 + 0.5, (points[..., 2] + points[..., 1]) / 0.5 + 0.5], -1)


def _disc(boundary: F64, upward: bool) -> GridSurface:
    """A flat fan inside a convex boundary that runs from +X toward +Z."""
    center = boundary.mean(0, keepdims=True)
    points = np.concatenate([boundary, center])
    index = np.arange(len(boundary))
    next_index = np.roll(index, -1)
    hub = np.full_like(index, len(boundary))
    faces = np.column_stack([hub, next_index, index] if upward else [hub, index, next_index])
    normals = np.broadcast_to([0.0, 1.0 if upward else -1.0, 0.0], points.shape)
    tangents = np.broadcast_to([1.0, 0.0, 0.0], points.shape)
    return GridSurface(points, normals, tangents, _top_view_uvs(points), faces)


def handles() -> GridSurface:
    """Return two curved handles at the short ends, with a knob at each foot."""
    t = np.linspace(0, np.pi, 41)
    flat = np.sign(np.cos(t)) * np.abs(np.cos(t)) ** 0.7
    bow = np.column_stack([0.034 * np.sin(t) ** 0.8, 0.020 * np.sin(t), 0.052 * flat])
    foot = np.array([HALF_SIZE[0] + 0.0165, 0.0155, 0.0])
    rod = tube(bow + foot, TUBE, 14)
    knobs = [sphere(0.0066, 10).transform(np.eye(3), foot + np.array([0.0, 0.0, z])) for z in (-0.052, 0.052)]
    handle = merge_surfaces([rod, *knobs])
    half_turn = np.diag([-1.0, 1.0, -1.0])
    return merge_surfaces([handle, handle.transform(half_turn, (0.0, 0.0, 0.0))])


def tube(path: Shaped[F64, "points 3"], radius: float, num_sides: int) -> GridSurface:
    """Return a tube along a path without vertical segments, open at both ends.

    Args:
        path: center line, meters.
        radius: meters.
        num_sides: number of sides of the polygon that approximates its circle.
    """
    forward = normalize(np.gradient(path, axis=0))
    right = normalize(np.cross(forward, [0.0, 1.0, 0.0]))
    up = np.cross(right, forward)
    phi = np.linspace(0, 2 * np.pi, num_sides + 1)[None, :, None]
    normals = right[:, None] * np.cos(phi) + up[:, None] * np.sin(phi)
    positions = path[:, None] + radius * normals
    tangents = np.broadcast_to(forward[:, None], positions.shape)
    uvs = np.stack(np.broadcast_arrays(phi[..., 0] / (2 * np.pi), np.linspace(0, 1, len(path))[:, None]), -1)
    faces = grid_faces(len(path), num_sides + 1)[:, ::-1]
    return GridSurface(
        positions.reshape(-1, 3), normals.reshape(-1, 3), tangents.reshape(-1, 3), uvs.reshape(-1, 2), faces
    )
