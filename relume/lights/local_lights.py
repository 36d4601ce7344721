"""Local lights: irradiance from a light of unit emission, by one or several samples of it.

    E(x) = Σ_k V_k · w_k · cos θi,k

    point        w = 1 / d²                                        emission W/sr
    spot         w = s² / d²,  s = clamp((cos θ − cos outer) / (cos inner − cos outer), 0, 1)   (KHR_lights_punctual)
    directional  w = 1                                             emission W/m²
    with a web or a gobo, point and spot times J(θ, φ), a table (`relume.raytrace.intensity_table`)
    points       w = M pm · w of light m, pm = Im / Σ I            emission W/sr, the mean of its M lights
                 w = M / N · w of light m with more lights than samples, N of them at random by pm
    surface      w = A cos θl / (N d²),  N uniform samples         emission W/m²/sr

A surface is a rectangle, or triangles of a mesh or of a shape (`relume.lights.shape_triangles`), chosen by area. A
directional light with an angle is a distant disk. The samples of a surface are stratified and shifted in their strata
per receiver (`relume.lights.light_sampling`), so that the remaining noise is of pixel frequency.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.light_axes import light_axes, unit_direction
from relume.lights.light_sampling import (
    EmitterParts,
    LightStrata,
    make_strata,
    morton_order,
    split_axes,
    subdivide_emitter,
)
from relume.lights.shape_triangles import LightTriangles, shape_triangles, sun_triangles
from relume.look import LightGeometry
from relume.math.plane_rounding import end_offsets

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

POINT, DIRECTIONAL, SURFACE = 0, 1, 2
_KINDS = {"point": POINT, "spot": POINT, "points": POINT, "directional": DIRECTIONAL}  # of lights without a surface
_MIN_DISTANCE = np.float32(1e-12)  # meters, from point lights: so that the falloff is finite
_INFINITE = np.float32(np.inf)
_SEED = 1
# most samples of a mesh, and of many lights, face away from a point, or are far from it; half of those of a sphere and
# a tube face away
_PI, _TWO_PI = np.float32(math.pi), np.float32(2 * math.pi)
UNIFORM_INTENSITY = np.ones((1, 1), np.float32)
_SAMPLE_FACTORS = {"rectangle": 1, "disc": 1, "sphere": 4, "tube": 4, "mesh": 4}
_SOURCE_FACTOR = 4  # of many lights
_MIN_SUN_ANGLE = 0.05  # degrees, of parallel light in a source of many: a tenth of the sun
_MIN_CONE_COSINES = 1e-3  # difference of cosines, as in KHR_lights_punctual


class LocalLight(NamedTuple):
    """A light in the layout of the kernels.

    Attributes:
        kind: `POINT` (spots too), `DIRECTIONAL` or `SURFACE`.
        position: positions of point lights, meters. axis: unit axes of spots; direction of travel of directional light.
        cone_scale, cone_offset: s = clamp(cone_scale · cos θ + cone_offset, 0, 1).
        intensity_cdf: cumulative intensity of the point lights.
        intensity_table: J at equidistant θ and φ of the only point light; one value for M of them, or without J.
        table_axes: horizontal and upright axis that φ is measured from. table_scale: cells per radian of θ and φ.
        corner, edges, normal: corner, edges and normals of parallelograms or triangles; unit normals.
        end_offset: of ray ends from the pieces, see `relume.math.plane_rounding.end_offsets`.
        power_cdf: cumulative power of the pieces. area: area of all pieces, m², weighted by their relative radiance.
        is_rectangle: a parallelogram, else triangles. is_two_sided: emits to both sides.
        sample_factor: number of samples over that of a rectangle; 0 for a light without a surface.
    """

    kind: int
    position: Shaped[F32, "M 3"]
    axis: Shaped[F32, "M 3"]
    cone_scale: Shaped[F32, " M"]
    cone_offset: Shaped[F32, " M"]
    intensity_cdf: Shaped[F32, " M"]
    intensity_table: Shaped[F32, "polar azimuth"]
    table_axes: Shaped[F32, "2 3"]
    table_scale: Shaped[F32, " 2"]
    corner: Shaped[F32, "T 3"]
    edges: Shaped[F32, "T 2 3"]
    normal: Shaped[F32, "T 3"]
    end_offset: Shaped[F32, "T 2"]
    power_cdf: Shaped[F32, " T"]
    area: np.float32
    is_rectangle: bool
    is_two_sided: bool
    sample_factor: int


class LightPoints(NamedTuple):
    """Point and spot lights of one source.

    Attributes:
        position: meters. direction: of any length, meters. cone: half-angles, degrees; 180° for a point light.
        relative_intensity: intensity of each over the mean of all.
    """

    position: Shaped[F32, "M 3"]
    direction: Shaped[F32, "M 3"]
    cone: Shaped[F32, "M 2"]
    relative_intensity: Shaped[F32, " M"]


def num_samples(geometry: LightGeometry, num_rectangle_samples: int) -> int:
    """Return the largest number of samples of a light, given that of a rectangle."""
    return _sample_factor(geometry) * num_rectangle_samples or 1


def _sample_factor(geometry: LightGeometry) -> int:
    if geometry.kind == "directional":
        return int(geometry.angle > 0)
    return _SOURCE_FACTOR if geometry.is_source else _SAMPLE_FACTORS.get(geometry.kind, 0)


def make_light_strata(light: LocalLight, num_rectangle_samples: int) -> LightStrata:
    """Create the samples of a light: each of its points if they are not more than the samples.

    Args:
        num_rectangle_samples: samples of a rectangle, a power of four.
    """
    num_light_samples, num_points = light.sample_factor * num_rectangle_samples or 1, len(light.position)
    if light.kind != SURFACE and num_points <= num_light_samples:
        zeros = np.zeros((num_points, 2), np.float32)
        return LightStrata(zeros, np.ones(2, np.float32), zeros, _SEED)
    return make_strata(split_axes(max(len(light.power_cdf), len(light.intensity_cdf)), num_light_samples), _SEED)


def make_emitter_parts(light: LocalLight, strata: LightStrata) -> EmitterParts:
    """Compute the parts of an area light's surface. strata: from `make_light_strata`"""
    split_axis = split_axes(len(light.power_cdf), len(strata.uv))
    return subdivide_emitter(split_axis, light.corner, light.edges, light.power_cdf, is_rectangle=light.is_rectangle)


def prepare_local_lights(
    geometry: LightGeometry,
    triangles: LightTriangles | None = None,
    points: LightPoints | None = None,
    intensity_table: Shaped[F32, "polar azimuth"] = UNIFORM_INTENSITY,
) -> LocalLight:
    """Prepare a light of a look.

    Args:
        geometry: the light.
        triangles: of a mesh or a source of many lights with surfaces, which without area emits nothing; or of a sun
            disk, from `sun_triangles`.
        points: the lights of kind "points".
        intensity_table: of a point or a spot, from `relume.raytrace.intensity_table`.
    """
    is_rectangle = geometry.kind == "rectangle"
    triangles = shape_triangles(geometry) if triangles is None else triangles
    corner, edges = _outline(geometry, triangles)
    piece_normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(piece_normals, axis=1) * (1.0 if is_rectangle else 0.5)
    if triangles is not None:
        areas = areas * triangles.relative_radiance
    pieces, area = np.flatnonzero(areas > 0), areas.sum()
    if geometry.kind == "mesh" or geometry.is_source:
        pieces = pieces[morton_order((corner + edges.sum(axis=1) / 3)[pieces])]
    piece_normals = piece_normals[pieces] / np.linalg.norm(piece_normals[pieces], axis=1, keepdims=True)
    return LocalLight(
        kind=SURFACE if len(pieces) else _KINDS.get(geometry.kind, SURFACE),
        **_point_fields(_single_point(geometry) if points is None else points),
        **_table_fields(geometry, intensity_table),
        corner=corner[pieces].astype(np.float32),
        edges=edges[pieces].astype(np.float32),
        normal=piece_normals.astype(np.float32),
        end_offset=end_offsets(np.concatenate([corner[:, None], corner[:, None] + edges], axis=1)[pieces]),
        power_cdf=(np.cumsum(areas[pieces]) / max(area, 1e-300)).astype(np.float32),
        area=np.float32(area),
        is_rectangle=is_rectangle,
        is_two_sided=triangles is not None and triangles.is_two_sided,
        sample_factor=_sample_factor(geometry),
    )


def outer_angle(geometry: LightGeometry) -> float:
    """Return the half-angle of the cone of a point or a spot, degrees."""
    return geometry.cone[1] if geometry.kind == "spot" else 180.0


def _table_fields(geometry: LightGeometry, table: Shaped[F32, "polar azimuth"]) -> dict[str, F32]:
    """Fields of `LocalLight` for a table; its only azimuth is repeated, so that kernels interpolate."""
    if table.shape[1] == 1 < len(table):
        table = np.repeat(table, 2, axis=1)
    cells_per_radian = (np.array(table.shape) - 1) / np.radians([outer_angle(geometry), 360.0])
    return {
        "intensity_table": table,
        "table_axes": light_axes(geometry.direction, geometry.rotation)[:2].astype(np.float32),
        "table_scale": cells_per_radian.astype(np.float32),
    }


def _single_point(geometry: LightGeometry) -> LightPoints:
    cone = geometry.cone if geometry.kind == "spot" else (180.0, 180.0)
    position, direction, cone_angles = (
        np.array([field], np.float32) for field in (geometry.position, geometry.direction, cone)
    )
    return LightPoints(position, direction, cone_angles, np.ones(1, np.float32))


def _point_fields(points: LightPoints) -> dict[str, F32]:
    """Fields of `LocalLight` for points, along a Morton curve, so that samples are stratified in space."""
    order = morton_order(points.position.astype(np.float64))
    scale, offset = _cones(points.cone[order].astype(np.float64))
    intensity = np.cumsum(points.relative_intensity[order].astype(np.float64))
    return {
        "position": points.position[order],
        "axis": np.array([unit_direction(direction) for direction in points.direction[order]], np.float32),
        "cone_scale": scale.astype(np.float32),
        "cone_offset": offset.astype(np.float32),
        "intensity_cdf": (intensity / intensity[-1]).astype(np.float32),
    }


def emitter_geometry(geometry: LightGeometry) -> LightGeometry:
    """Reduce a light to the geometry of its shadows: a point casts the same in all directions, and a spot its own."""
    if geometry.kind not in ("point", "spot"):
        return geometry
    return LightGeometry("point", geometry.position, link=geometry.link, shadow_link=geometry.shadow_link)


def _outline(geometry: LightGeometry, triangles: LightTriangles | None) -> tuple[F64, F64]:
    """Return a corner (T, 3) and two edges (T, 2, 3) of each piece of a surface."""
    if geometry.kind == "rectangle":
        corner, edges = rectangle(geometry)
        return corner[None], edges[None]
    corners = np.zeros((0, 3, 3)) if triangles is None else triangles.corners.astype(np.float64)
    return corners[:, 0], corners[:, 1:] - corners[:, :1]


def rectangle(geometry: LightGeometry) -> tuple[Shaped[F64, " 3"], Shaped[F64, "2 3"]]:
    """Return a corner and the edges of a rectangle, whose cross product points to its emitting side; meters."""
    edges = np.array(geometry.size)[:, None] * light_axes(geometry.direction, geometry.rotation)[:2]
    return np.array(geometry.position, np.float64) - edges.sum(axis=0) / 2, edges


def source_triangles(lights: Sequence[Mapping[str, Any]], center: Shaped[F64, " 3"], radius: float) -> LightTriangles:
    """Return area lights, or directional lights as sun disks, as triangles.

    Args:
        lights: fields as in a look, with an emission of one channel. center, radius: of a sphere around the scene,
            meters.
    """
    corners, radiance = [], []
    for light in lights:
        geometry = LightGeometry(**{field: value for field, value in light.items() if field != "emission"})
        triangles, _ = area_triangles(geometry, center, radius)
        corners.append(triangles.corners)
        radiance.append(triangles.relative_radiance * np.float32(light["emission"][0]))
    return LightTriangles(np.concatenate(corners), np.concatenate(radiance), is_two_sided=False)


def area_triangles(
    geometry: LightGeometry, center: Shaped[F64, " 3"], radius: float
) -> tuple[LightTriangles, LightGeometry]:
    """Return the triangles of an area light or a sun disk, and its geometry, which has an angle if it is a sun.

    Args:
        geometry: the light. center, radius: see `source_triangles`.
    """
    if geometry.kind == "directional":
        geometry = geometry._replace(angle=max(geometry.angle, _MIN_SUN_ANGLE))
    triangles = shape_triangles(geometry) or sun_triangles(geometry, center, radius)
    if triangles is not None:
        return triangles, geometry
    corner, (e, f) = rectangle(geometry)
    halves = np.array([(corner, corner + e, corner + e + f), (corner, corner + e + f, corner + f)], np.float32)
    return LightTriangles(halves, np.ones(2, np.float32), is_two_sided=False), geometry


def _cones(cone: Shaped[F64, "M 2"]) -> tuple[F64, F64]:
    """Return scales and offsets of the falloff between two half-angles in degrees; 0 and 1 without a cone."""
    cos_inner, cos_outer = np.cos(np.radians(cone)).T
    scale = np.where(cone[:, 1] > 90, 0, 1 / np.maximum(_MIN_CONE_COSINES, cos_inner - cos_outer))
    return scale, np.where(cone[:, 1] > 90, 1, -cos_outer * scale)


@nb.njit(nogil=True, cache=True, inline="always")
def _table_lookup(table, axes, scale, along, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Interpolate J(θ, φ) bilinearly.

    Args:
        table, axes, scale: see `LocalLight`. along: cos θ. dx, dy, dz: unit direction toward the light.
    """
    unity = np.float32(1)
    x = -(dx * axes[0, 0] + dy * axes[0, 1] + dz * axes[0, 2])
    y = -(dx * axes[1, 0] + dy * axes[1, 1] + dz * axes[1, 2])
    polar = scale[0] * np.float32(math.atan2(math.sqrt(x * x + y * y), along))
    azimuth = np.float32(math.atan2(y, x))
    azimuth = scale[1] * (azimuth if azimuth >= 0 else azimuth + _TWO_PI)
    row, column = min(int(polar), table.shape[0] - 2), min(int(azimuth), table.shape[1] - 2)
    s, t = min(polar - np.float32(row), unity), min(azimuth - np.float32(column), unity)
    low = table[row, column] + t * (table[row, column + 1] - table[row, column])
    high = table[row + 1, column] + t * (table[row + 1, column + 1] - table[row + 1, column])
    return low + s * (high - low)


# inlined by Numba: LLVM rounds its sums differently in each kernel, and irradiance of a moving light must equal that of
# a resting one
@nb.njit(nogil=True, cache=True, inline="always")
def light_sample(light, strata, sample, shift_u, shift_v, px, py, pz):  # type: ignore[no-untyped-def]
    """Evaluate a sample of a light at a point.

    Args:
        light: a `LocalLight`. strata: its samples, from `make_light_strata`. sample: its index.
        shift_u, shift_v: the point's shift within the strata, from `cranley_patterson_offset`. px, py, pz: the point,
            meters.
    Returns:
        Unit direction toward the sample (three), distance, w, the surface normal on the point's side (three; zeros if
        it has no surface), and the offset of a ray's end from the surface, meters.
    """
    zero, unity = np.float32(0), np.float32(1)
    if light.kind == DIRECTIONAL:
        return -light.axis[0, 0], -light.axis[0, 1], -light.axis[0, 2], _INFINITE, unity, zero, zero, zero, zero
    if light.kind == POINT:
        num_points, num_samples = light.position.shape[0], strata.uv.shape[0]
        point, scale = sample, np.float32(num_points) / np.float32(num_samples)
        if num_samples != num_points:
            u = strata.uv[sample, 0] + shift_u
            u = strata.corner[sample, 0] + strata.size[0] * (u - np.float32(u >= unity))
            point = min(np.searchsorted(light.intensity_cdf, u, side="right"), num_points - 1)
        elif num_points > 1:
            start = light.intensity_cdf[point - 1] if point > 0 else zero
            scale = np.float32(num_points) * (light.intensity_cdf[point] - start)
        dx, dy, dz = light.position[point, 0] - px, light.position[point, 1] - py, light.position[point, 2] - pz
        distance = max(np.float32(math.sqrt(dx * dx + dy * dy + dz * dz)), _MIN_DISTANCE)
        inverse_distance = unity / distance
        dx, dy, dz = dx * inverse_distance, dy * inverse_distance, dz * inverse_distance
        along = -(dx * light.axis[point, 0] + dy * light.axis[point, 1] + dz * light.axis[point, 2])
        falloff = min(max(light.cone_scale[point] * along + light.cone_offset[point], zero), unity)
        weight = scale * falloff * falloff / (distance * distance)
        if light.intensity_table.shape[0] > 1:
            weight *= _table_lookup(light.intensity_table, light.table_axes, light.table_scale, along, dx, dy, dz)
        return dx, dy, dz, distance, weight, zero, zero, zero, zero
    if light.area == 0:
        return unity, zero, zero, unity, zero, zero, zero, zero, zero
    u, v = strata.uv[sample, 0] + shift_u, strata.uv[sample, 1] + shift_v
    u = strata.corner[sample, 0] + strata.size[0] * (u - np.float32(u >= unity))
    v = strata.corner[sample, 1] + strata.size[1] * (v - np.float32(v >= unity))
    piece = 0
    if not light.is_rectangle:
        piece = min(np.searchsorted(light.power_cdf, u, side="right"), light.power_cdf.shape[0] - 1)
        piece_start = light.power_cdf[piece - 1] if piece > 0 else zero
        root = np.float32(math.sqrt(min((u - piece_start) / (light.power_cdf[piece] - piece_start), unity)))
        u, v = root * (unity - v), root * v
    e, f = light.edges[piece, 0], light.edges[piece, 1]
    dx = light.corner[piece, 0] + u * e[0] + v * f[0] - px
    dy = light.corner[piece, 1] + u * e[1] + v * f[1] - py
    dz = light.corner[piece, 2] + u * e[2] + v * f[2] - pz
    distance = max(np.float32(math.sqrt(dx * dx + dy * dy + dz * dz)), np.float32(1e-20))
    inverse_distance = unity / distance
    dx, dy, dz = dx * inverse_distance, dy * inverse_distance, dz * inverse_distance
    nx, ny, nz = light.normal[piece, 0], light.normal[piece, 1], light.normal[piece, 2]
    cosine = -(dx * nx + dy * ny + dz * nz)
    if cosine < 0 and light.is_two_sided:
        nx, ny, nz, cosine = -nx, -ny, -nz, -cosine
    area = light.area / np.float32(strata.uv.shape[0])
    # a sample's area at a distance below its width fills the half space: w is clamped
    weight = area * max(cosine, zero) / max(distance * distance, area / _PI)
    lift = light.end_offset[piece, 0] + light.end_offset[piece, 1] * distance
    return dx, dy, dz, distance, weight, nx, ny, nz, lift
