"""Planar mirrors, and the lights that points see in them.

A plane with unit normal n mirrors a light in direction d to v = d − 2 (d · n) n. Only this one path leads over the
plane, so random rays miss it if the light is small.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.specular_hits import is_mirror_material
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_PLANES = 4  # per scene
_MIN_FLAT_COSINE = 0.9999  # the least cosine between a face and the normals at its corners
_MIN_RELATIVE_AREA = 1e-4  # of the squared diagonal of the scene
_PLANE_TOLERANCE, _ROUNDING = 1e-4, 2.0**-20  # of the mirrors' extent, and of the largest coordinate
_RAYS_PER_BATCH = 1 << 18


class PlanarMirrors(NamedTuple):
    """Planes of mirrors, the largest first.

    Attributes:
        normal: unit. offset: n · x of the plane. material: index into the scene's materials.
        axes: two unit tangents. low, high: extent of the mirrors along the tangents.
    """

    normal: Shaped[F32, "P 3"]
    offset: Shaped[F32, " P"]
    material: Shaped[NDArray[np.uint16], " P"]
    axes: Shaped[F32, "P 2 3"]
    low: Shaped[F32, "P 2"]
    high: Shaped[F32, "P 2"]

    @property
    def num_planes(self) -> int:
        """Number of planes P."""
        return len(self.offset)

    @property
    def tolerance(self) -> Shaped[F64, " P"]:
        """Distance from each plane within which points lie in it, meters."""
        extent = (self.high - self.low).max(axis=1).astype(np.float64)
        largest = np.abs(np.concatenate([self.offset[:, None], self.low, self.high], axis=1)).max(axis=1)
        return np.asarray(_PLANE_TOLERANCE * extent + _ROUNDING * largest)

    def distance_to_plane(self, plane: NDArray[np.integer] | int, position: NDArray[np.floating]) -> F64:
        """Distance of positions (…, 3) from a plane, or each from its own plane."""
        normal = self.normal[plane].astype(np.float64)
        return np.asarray(np.abs((position * normal).sum(axis=-1) - self.offset[plane]), np.float64)

    def containing_plane(self, position: Shaped[F32, "patches points 3"]) -> Shaped[NDArray[np.uint8], " patches"]:
        """Index of the plane that contains each patch, 255 if there is none.

        Args:
            position: sample points of the patches, as origins of rays.
        """
        plane_index = np.full(len(position), 255, np.uint8)
        for p in reversed(range(self.num_planes)):
            coordinates, tolerance = position @ self.axes[p].T.astype(np.float64), self.tolerance[p]
            inside = (coordinates >= self.low[p] - tolerance) & (coordinates <= self.high[p] + tolerance)
            plane_index[(self.distance_to_plane(p, position) < tolerance).all(axis=1) & inside.all(axis=(1, 2))] = p
        return plane_index


def has_planar_mirrors(scene: Scene) -> bool:
    """True if any mesh has a mirror material without a normal map."""
    return bool(_is_planar_mirror(scene)[[mesh.material for mesh in scene.meshes]].any())


def _is_planar_mirror(scene: Scene) -> NDArray[np.bool_]:
    """True for each mirror material without a normal map."""
    return is_mirror_material(scene.materials) & np.array(
        [material.normal_map is None for material in scene.materials], np.bool_
    )


def find_planar_mirrors(scene: Scene, geometry: SceneBuffers) -> PlanarMirrors:
    """Find the planes of a scene's mirrors. geometry: its triangles"""
    face = np.flatnonzero(_is_planar_mirror(scene)[geometry.face_material])
    normal, corners = geometry.face_normals[face], geometry.faces[face]
    is_curved = np.einsum("fkc,fc->fk", geometry.normals[corners], normal) < _MIN_FLAT_COSINE
    face, normal, corners = (array[~is_curved.any(axis=1)] for array in (face, normal, corners))
    corner_positions, face_material = geometry.positions[corners].astype(np.float64), geometry.face_material[face]
    area = geometry.face_areas[face]
    min_area = _MIN_RELATIVE_AREA * float(np.square(np.ptp(geometry.positions, axis=0)).sum())
    planes, is_unassigned = list[PlanarMirrors](), np.ones(len(face), np.bool_)
    for group in _group_by_plane(normal, corner_positions, face_material, area, min_area):
        if len(planes) == MAX_PLANES:
            break
        seed = group[np.argmax(area[group])]
        if not is_unassigned[seed]:
            continue  # rounding has split a plane that was found before
        plane = _plane_of_triangle(normal[seed], corner_positions[seed], face_material[seed])
        is_tilted = np.abs(normal @ plane.normal[0]) < _MIN_FLAT_COSINE
        is_coplanar = (
            (face_material == face_material[seed])
            & ~is_tilted
            & (plane.distance_to_plane(0, corner_positions) < plane.tolerance[0]).all(axis=1)
        )
        coordinates = corner_positions[is_coplanar].reshape(-1, 3) @ plane.axes[0].T
        planes.append(plane._replace(low=coordinates.min(axis=0)[None], high=coordinates.max(axis=0)[None]))
        is_unassigned &= ~is_coplanar

    def concatenate(name: str, *shape: int) -> F32:
        return np.concatenate([np.empty((0, *shape)), *(getattr(plane, name) for plane in planes)]).astype(np.float32)

    plane_material = np.array([plane.material[0] for plane in planes], np.uint16)
    fields = concatenate("normal", 3), concatenate("offset"), plane_material, concatenate("axes", 2, 3)
    return PlanarMirrors(*fields, concatenate("low", 2), concatenate("high", 2))


def _group_by_plane(
    normal: F32, corner_positions: F64, material: NDArray[np.integer], area: F64, min_area: float
) -> Iterator[NDArray[np.intp]]:
    """Group triangles that lie roughly in one plane, the largest area first, down to `min_area`."""
    sign = np.where(normal @ np.array([1.0, 1e-2, 1e-4]) < 0, -1, 1)  # a plane has two sides
    offset = sign * np.einsum("fc,fc->f", corner_positions.mean(axis=1), normal)
    size = max(float(np.abs(corner_positions).max(initial=0)), 1e-30)
    keys = [material, *np.rint(500 * sign * normal.T), np.rint(2000 / size * offset)]
    _, group = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)
    total = np.bincount(group.ravel(), area)
    for group_index in np.argsort(-total, kind="stable"):
        if total[group_index] <= min_area:
            return
        yield np.flatnonzero(group.ravel() == group_index)


def _plane_of_triangle(normal: F32, corners: F64, material: int) -> PlanarMirrors:
    """Make the plane of one triangle. normal: (3,). corners: (3, 3)"""
    unit_normal = normal.astype(np.float64) / np.linalg.norm(normal.astype(np.float64))
    tangent = any_tangent(unit_normal[None])[0].astype(np.float64)
    axes, offset = np.stack([tangent, np.cross(unit_normal, tangent)])[None], np.array([(corners @ unit_normal).mean()])
    coordinates = corners @ axes[0].T
    low, high = coordinates.min(axis=0)[None], coordinates.max(axis=0)[None]
    return PlanarMirrors(unit_normal[None], offset, np.array([material]), axes, low, high)


def mirrored_lights(normal: Shaped[F32, "P 3"], directions: Shaped[F32, "T 3"]) -> Shaped[F32, "P T 3"]:
    """Mirror directions to lights at planes. normal: unit normals of the planes. directions: unit, to the lights"""
    twice_cosine = 2 * normal.astype(np.float64) @ directions.T
    return np.asarray(directions[None] - twice_cosine[..., None] * normal[:, None], np.float32)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _mark_candidates(position, normal, mirrors, mirrored_directions, start, stop, is_candidate):  # type: ignore[no-untyped-def]
    """Mark lights whose path from points [start, stop) crosses a plane within the mirrors. is_candidate: (n, P T)"""
    planes, offset, axes, low, high = mirrors
    num = mirrored_directions.shape[1]
    for n in range(start, stop):
        for p in range(planes.shape[0]):
            height = np.float32(0)
            for axis in range(3):
                height += planes[p, axis] * position[n, axis]
            height -= offset[p]
            for t in range(num):
                slope = cos_theta = np.float32(0)
                for axis in range(3):
                    slope += planes[p, axis] * mirrored_directions[p, t, axis]
                    cos_theta += normal[n, axis] * mirrored_directions[p, t, axis]
                if cos_theta <= 0 or slope * height >= 0:
                    continue
                distance, is_inside = -height / slope, True
                for k in range(2):
                    coordinate = np.float32(0)
                    for axis in range(3):
                        coordinate += axes[p, k, axis] * (
                            position[n, axis] + distance * mirrored_directions[p, t, axis]
                        )
                    is_inside &= low[p, k] <= coordinate <= high[p, k]
                is_candidate[n, p * num + t] = is_inside


class ReflectedLight(NamedTuple):
    """Lights that n points see in planar mirrors.

    Attributes:
        visible: light t in plane p is bit k & 7 of byte k >> 3, k = p T + t.
        num_rays: number of traced rays.
    """

    visible: Shaped[NDArray[np.uint8], "n bytes"]
    num_rays: int


def lights_visible_in_mirrors(
    geometry: SceneBuffers, mirrors: PlanarMirrors, points: SurfacePoints, directions: Shaped[F32, "T 3"]
) -> ReflectedLight:
    """Find the lights that points see in planar mirrors. geometry: the scene's. directions: to the lights, unit"""
    mirrored_directions = mirrored_lights(mirrors.normal, directions)
    is_candidate = np.zeros((points.num_points, mirrors.num_planes * len(directions)), np.bool_)
    mirror_arrays = mirrors.normal, mirrors.offset, mirrors.axes, mirrors.low, mirrors.high
    args = points.position, points.normal, mirror_arrays, mirrored_directions
    parallel_for_chunks(lambda start, stop: _mark_candidates(*args, start, stop, is_candidate), len(is_candidate))
    point_index, light_index = np.nonzero(is_candidate)
    num_rays = 0
    for start in range(0, len(point_index), _RAYS_PER_BATCH):
        batch = slice(start, start + _RAYS_PER_BATCH)
        is_visible, num_traced = _trace_mirror_paths(
            geometry, mirrors, points.rows(point_index[batch]), light_index[batch], directions, mirrored_directions
        )
        is_candidate[point_index[batch], light_index[batch]] = is_visible
        num_rays += num_traced
    return ReflectedLight(np.packbits(is_candidate, axis=1, bitorder="little"), num_rays)


def _trace_mirror_paths(
    geometry: SceneBuffers,
    mirrors: PlanarMirrors,
    points: SurfacePoints,
    candidate: NDArray[np.intp],
    directions: F32,
    mirrored_directions: F32,
) -> tuple[NDArray[np.bool_], int]:
    """True if a path from a point over a mirror to a light is unoccluded; and the number of traced rays."""
    plane, light_index = np.divmod(candidate, len(directions))
    to_mirror = mirrored_directions[plane, light_index]
    hits = trace_rays(geometry.embree, points.position, to_mirror, points.alpha_sample)
    rows = np.flatnonzero(hits.face >= 0)
    mirror_position = points.position[rows] + hits.distance[rows, None].astype(np.float64) * to_mirror[rows]
    is_same_material = geometry.face_material[hits.face[rows]] == mirrors.material[plane[rows]]
    rows = rows[
        is_same_material & (mirrors.distance_to_plane(plane[rows], mirror_position) < mirrors.tolerance[plane[rows]])
    ]
    is_unoccluded = np.zeros(len(to_mirror), np.bool_)
    mirror_hits, to_light = hits.rows(rows), directions[light_index[rows]]
    normal = mirrors.normal[plane[rows]]
    normal = normal * np.sign(np.einsum("nc,nc->n", normal, to_light))[:, None]
    alpha_sample = points.alpha_sample if len(points.alpha_sample) == 1 else points.alpha_sample[rows]
    light_hits = trace_rays(
        geometry.embree, positions_on_faces(geometry, mirror_hits.face, mirror_hits.uv, normal), to_light, alpha_sample
    )
    is_unoccluded[rows] = light_hits.face < 0
    return is_unoccluded, len(to_mirror) + len(rows)
