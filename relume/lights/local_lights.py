"""Local lights: irradiance from a light of unit emission, by one or several samples of it.

    E(x) = Σ_k V_k · w_k · cos θi,k

    point        w = 1 / d²                                        emission W/sr
    spot         w = s² / d²,  s = clamp((cos θ − cos outer) / (cos inner − cos outer), 0, 1)   (KHR_lights_punctual)
    directional  w = 1                                             emission W/m²
    surface      w = A cos θl / (N d²),  N uniform samples         emission W/m²/sr

A surface is a rectangle, or triangles of a mesh or of a shape (`relume.lights.shape_triangles`), chosen by area. A
directional light with an angle is a distant disk. The samples of a surface are stratified and shifted in their strata
per receiver (`relume.lights.light_sampling`), so that the remaining noise is of pixel frequency.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
from relume.lights.shape_triangles import LightTriangles, shape_triangles
from relume.look import LightGeometry
from relume.math.plane_rounding import end_offsets

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

POINT, DIRECTIONAL, SURFACE = 0, 1, 2
_KINDS = {"point": POINT, "spot": POINT, "directional": DIRECTIONAL}  # of lights without a surface
_MIN_DISTANCE = np.float32(1e-12)  # meters, from point lights: so that the falloff is finite
_INFINITE = np.float32(np.inf)
_SEED = 1
# most samples of a mesh face away from a point, or are far from it; half of those of a sphere and a tube face away
_SAMPLE_FACTORS = {"rectangle": 1, "disc": 1, "sphere": 4, "tube": 4, "mesh": 4}
_PI = np.float32(math.pi)
_MIN_CONE_COSINES = 1e-3  # difference of cosines, as in KHR_lights_punctual


class LocalLight(NamedTuple):
    """A light in the layout of the kernels.

    Attributes:
        kind: `POINT` (spots too), `DIRECTIONAL` or `SURFACE`.
        position: position of point lights. axis: unit axis of spots; direction of travel of directional light.
        cone_scale, cone_offset: s = clamp(cone_scale · cos θ + cone_offset, 0, 1).
        corner, edges, normal: corner, edges and normals of parallelograms or triangles; unit normals.
        end_offset: of ray ends from the pieces, see `relume.math.plane_rounding.end_offsets`.
        power_cdf: cumulative power of the pieces. area: area of all pieces, m², weighted by their relative radiance.
        is_rectangle: a parallelogram, else triangles. is_two_sided: emits to both sides.
        sample_factor: number of samples over that of a rectangle; 0 for a light without a surface.
    """

    kind: int
    position: Shaped[F32, " 3"]
    axis: Shaped[F32, " 3"]
    cone_scale: np.float32
    cone_offset: np.float32
    corner: Shaped[F32, "T 3"]
    edges: Shaped[F32, "T 2 3"]
    normal: Shaped[F32, "T 3"]
    end_offset: Shaped[F32, "T 2"]
    power_cdf: Shaped[F32, " T"]
    area: np.float32
    is_rectangle: bool
    is_two_sided: bool
    sample_factor: int


def num_samples(geometry: LightGeometry, num_rectangle_samples: int) -> int:
    """Return the number of samples of a light, given that of a rectangle."""
    return _sample_factor(geometry) * num_rectangle_samples or 1


def _sample_factor(geometry: LightGeometry) -> int:
    if geometry.kind == "directional":
        return int(geometry.angle > 0)
    return _SAMPLE_FACTORS.get(geometry.kind, 0)


def make_light_strata(light: LocalLight, num_rectangle_samples: int) -> LightStrata:
    """Create the samples of a light. num_rectangle_samples: samples of a rectangle, a power of four"""
    num_light_samples = light.sample_factor * num_rectangle_samples or 1
    return make_strata(split_axes(len(light.power_cdf), num_light_samples), _SEED)


def make_emitter_parts(light: LocalLight, strata: LightStrata) -> EmitterParts:
    """Compute the parts of an area light's surface. strata: from `make_light_strata`"""
    split_axis = split_axes(len(light.power_cdf), len(strata.uv))
    return subdivide_emitter(split_axis, light.corner, light.edges, light.power_cdf, is_rectangle=light.is_rectangle)


def prepare_local_lights(geometry: LightGeometry, triangles: LightTriangles | None = None) -> LocalLight:
    """Prepare a light of a look.

    Args:
        geometry: the light.
        triangles: of a light of kind "mesh", which without area emits nothing; or of a sun disk, from `sun_triangles`.
    """
    is_rectangle = geometry.kind == "rectangle"
    triangles = shape_triangles(geometry) if triangles is None else triangles
    corner, edges = _outline(geometry, triangles)
    piece_normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(piece_normals, axis=1) * (1.0 if is_rectangle else 0.5)
    if triangles is not None:
        areas = areas * triangles.relative_radiance
    pieces, area = np.flatnonzero(areas > 0), areas.sum()
    if geometry.kind == "mesh":
        pieces = pieces[morton_order((corner + edges.sum(axis=1) / 3)[pieces])]
    piece_normals = piece_normals[pieces] / np.linalg.norm(piece_normals[pieces], axis=1, keepdims=True)
    scale, offset = _cone(*geometry.cone) if geometry.kind == "spot" else (0.0, 1.0)
    return LocalLight(
        kind=SURFACE if len(pieces) else _KINDS.get(geometry.kind, SURFACE),
        position=np.array(geometry.position, np.float32),
        axis=unit_direction(geometry.direction).astype(np.float32),
        cone_scale=np.float32(scale),
        cone_offset=np.float32(offset),
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


def emitter_geometry(geometry: LightGeometry) -> LightGeometry:
    """Reduce a light to the geometry of its shadows: a spot casts those of a point light."""
    return LightGeometry("point", geometry.position) if geometry.kind == "spot" else geometry


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


def _cone(inner: float, outer: float) -> tuple[float, float]:
    """Return scale and offset of the falloff between two half-angles in degrees."""
    cos_outer = math.cos(math.radians(outer))
    scale = 1 / max(_MIN_CONE_COSINES, math.cos(math.radians(inner)) - cos_outer)
    return scale, -cos_outer * scale


# inlined: a call would count references to all arrays of the light, which threads share, and take 13 times as long
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
        return -light.axis[0], -light.axis[1], -light.axis[2], _INFINITE, unity, zero, zero, zero, zero
    if light.kind == POINT:
        dx, dy, dz = light.position[0] - px, light.position[1] - py, light.position[2] - pz
        distance = max(np.float32(math.sqrt(dx * dx + dy * dy + dz * dz)), _MIN_DISTANCE)
        inverse_distance = unity / distance
        dx, dy, dz = dx * inverse_distance, dy * inverse_distance, dz * inverse_distance
        along = -(dx * light.axis[0] + dy * light.axis[1] + dz * light.axis[2])
        falloff = min(max(light.cone_scale * along + light.cone_offset, zero), unity)
        return dx, dy, dz, distance, falloff * falloff / (distance * distance), zero, zero, zero, zero
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
