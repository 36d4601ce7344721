"""Small and local lights in narrow lobes while a camera moves.

    L̄ = Σ_k V_k E_k p(ω_k) + Σ_t V_t L_t P_t

Small lights k, bright ones of the environment, points, spots and distant lights, are no chance hits of lobe rays but
evaluated by the density p of the lobe, averaged over a disk of directions and over the pixel. Triangles t of area
lights cover a share P of the lobe (`relume.live.free_camera.lobe_coverage`). Each has one shadow ray.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Self

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import SURFACE, LocalLight, light_sample, make_emitter_parts
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_coverage import lobe_coverage, nearest_point
from relume.live.free_camera.normal_mapping import normalize
from relume.look.model import Link, Rgb
from relume.math.fast_math import acos_clamped
from relume.math.plane_rounding import end_offsets
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.lobe_directions import LobePattern, angle_at_quantile, lobe_density, lobe_direction, ray_jitter
from relume.raytrace.local_light_visibility import shadow_ray
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)
from relume.transport.lobe_hits import half_vector_spread, jittered_frame
from relume.transport.lobe_scene import LobeScene
from relume.transport.patch_lookup import tangents_of
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PI = np.float32(math.pi)
# normals of a pixel at which a small light is evaluated: most if their spread is larger than light and lobe, one if the
# lobe is much wider than both
_LEAST_JITTERS, _JITTERS_OF_EQUAL, _MOST_JITTERS = np.float32(8), np.float32(16), 64
_MOST_COVERAGES = 16  # normals of a pixel at which the share of a triangle is evaluated
_DIRECTION_SEED = np.uint32(0x27D4EB2F)
_MOST_TRIANGLES, _LEAST_AREA = 128, 1e-12  # of an area light; area relative to its largest triangle
_TINY = 1e-300
_NONE, _NO_TRIANGLES = np.zeros(0), np.zeros((1, 0, 3, 3))
_POINT_RADIUS = np.float32(2e-4)  # of a light without an extent, radians


class LobeEmitter(NamedTuple):
    """A local light of unit emission as narrow lobes see it.

    Attributes:
        light, strata: the light, with its samples.
        triangles: of its surface, meters; empty for none. normal: unit, of each.
        end_offset: of ray ends from each, see `relume.math.plane_rounding.end_offsets`.
        radiance: relative to the emission.
        center, radius: of a sphere around the triangles, meters.
    """

    light: LocalLight
    strata: LightStrata
    triangles: Shaped[F32, "T 3 3"]
    normal: Shaped[F32, "T 3"]
    end_offset: Shaped[F32, "T 2"]
    radiance: Shaped[F32, " T"]
    center: Shaped[F32, " 3"]
    radius: np.float32

    @classmethod
    def from_light(cls, light: LocalLight, strata: LightStrata) -> Self:
        """List the triangles of a light; of a surface with many pieces, those of the parts that its samples stand for.

        Args:
            light: the light. strata: its samples, from `relume.lights.local_lights.make_light_strata`.
        """
        power, triangles = _halves(light, strata) if light.kind == SURFACE else (_NONE, _NO_TRIANGLES)
        normal = np.cross(triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :])
        length = np.linalg.norm(normal, axis=2)
        radiance = light.area * power / np.maximum(length.sum(axis=0) / 2, _TINY)
        is_there = length > _LEAST_AREA * length.max(initial=0)
        corners, normal = triangles[is_there], normal[is_there] / length[is_there, None]
        center = corners.reshape(-1, 3).mean(axis=0) if len(corners) else np.zeros(3)
        return cls(
            light,
            strata,
            triangles=np.ascontiguousarray(corners, np.float32),
            normal=np.asarray(normal, np.float32),
            end_offset=end_offsets(corners),
            radiance=np.broadcast_to(radiance, length.shape)[is_there].astype(np.float32),
            center=np.asarray(center, np.float32),
            radius=np.float32(np.linalg.norm(corners - center, axis=2).max(initial=0)),
        )


def _halves(
    light: LocalLight, strata: LightStrata
) -> tuple[Shaped[NDArray[np.float64], " pieces"], Shaped[NDArray[np.float64], "halves pieces 3 3"]]:
    """Return the share of each piece of a light in its power, and the piece as one or two triangles."""
    power = np.diff(light.power_cdf, prepend=0).astype(np.float64)
    if len(power) > _MOST_TRIANGLES:
        corners = make_emitter_parts(light, strata).corners[-len(strata.uv) :].astype(np.float64)
        return np.full(len(corners), 1 / len(corners)), np.stack([corners[:, :3], corners[:, [0, 2, 3]]])
    corner, edges = light.corner[:, None].astype(np.float64), light.edges.astype(np.float64)
    first = np.concatenate([corner, corner + edges], axis=1)
    if not light.is_rectangle:
        return power, first[None]
    opposite = corner + edges.sum(axis=1, keepdims=True)
    return power, np.stack([first, np.concatenate([opposite, first[:, 2:], first[:, 1:2]], axis=1)])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def mirror_direction(points, p, wo):  # type: ignore[no-untyped-def]
    """Mirror direction of a point, a tuple. points, p: the point. wo: view directions. (n, 3)"""
    n, o = points.normal[p], wo[p]
    twice = _TWO * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
    return twice * n[0] - o[0], twice * n[1] - o[1], twice * n[2] - o[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _chord(r, d):  # type: ignore[no-untyped-def]
    """Distance of two unit directions: hardly less than their angle if that is small, and never more."""
    return np.float32(math.sqrt(max(_TWO - _TWO * (r[0] * d[0] + r[1] * d[1] + r[2] * d[2]), _ZERO)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def disk_radius(variance):  # type: ignore[no-untyped-def]
    """Radius of a disk of directions, radians. variance: 1 − R, with the length R of their mean"""
    return _TWO * np.float32(math.sqrt(max(variance, np.float32(1e-8))))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _density(pattern, wi, wo):  # type: ignore[no-untyped-def]
    """Density p of one ray in a direction, per steradian. wi, wo: local, tuples"""
    if wi[2] <= 0:
        return _ZERO
    if pattern.is_half_angle:
        hx, hy, hz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
        length = np.float32(math.sqrt(hx * hx + hy * hy + hz * hz)) + np.float32(1e-6)
        angle, cos_theta_d = acos_clamped(hz / length), _HALF * length
    else:
        angle, cos_theta_d = acos_clamped(wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1]), _ONE
    band = min(int(pattern.scale * angle), pattern.band_density.shape[1] - 1)
    return lobe_density(pattern, 0, band, cos_theta_d) / np.float32(pattern.uv.shape[0])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _local(frame, d):  # type: ignore[no-untyped-def]
    """Direction d in a frame of tangent, bitangent and normal, tuples."""
    t, b, n = frame
    return (
        t[0] * d[0] + t[1] * d[1] + t[2] * d[2],
        b[0] * d[0] + b[1] * d[1] + b[2] * d[2],
        n[0] * d[0] + n[1] * d[1] + n[2] * d[2],
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _mean_density(points, p, wo, footprint, pattern, widths, direction, radius, spread, chord):  # type: ignore[no-untyped-def]
    """Mean density p of a disk of directions over the part of a pixel that a point shows, per steradian.

    Whichever is wider, lobe or disk, is evaluated at directions from the other.

    Args:
        points, p: the point. wo: view directions. footprint: of each point, or one. pattern: `LobePattern`.
        widths: median and 99.9th percentile of the angles of ωi to the mirror direction, radians.
        direction: center of the disk, a tuple. radius: radians. spread: from `half_vector_spread`.
        chord: from the mirror direction of the point to that direction.
    """
    normal, seed, part = points.normal[p], points.seed[p], footprint[min(p, footprint.shape[0] - 1)]
    # the density varies over its width, or over the distance of its peak where that is larger
    scale = max(widths[0], chord - radius - _TWO * spread)
    is_wide, ratio = scale > radius, spread / max(scale, radius)
    least = _ONE + _JITTERS_OF_EQUAL * (radius / scale) ** 2 if is_wide else _LEAST_JITTERS
    num = min(int(least + _JITTERS_OF_EQUAL * ratio * ratio), _MOST_JITTERS)
    d_t, d_b = tangents_of(direction)
    sin_radius, half_chord, total = np.float32(math.sin(radius)), np.float32(math.sin(_HALF * radius)), _ZERO
    chord_squared = np.float32(4) * half_chord * half_chord  # by π the solid angle: 2π (1 − cos ρ) = 4π sin² ρ/2
    for k in range(num):
        u, v = ray_jitter(k, seed) if num > 1 else (_HALF, _HALF)
        (t, b, n), o = jittered_frame(normal, points.tangent[p], wo[p], part, u - _HALF, v - _HALF)
        r, azimuth = ray_jitter(k, np.uint32(seed) ^ _DIRECTION_SEED) if num > 1 else (_ZERO, _ZERO)
        if is_wide:
            r, azimuth = sin_radius * np.float32(math.sqrt(r)), _TWO * _PI * azimuth
            x, y = r * np.float32(math.cos(azimuth)), r * np.float32(math.sin(azimuth))
            d = (
                direction[0] + x * d_t[0] + y * d_b[0],
                direction[1] + x * d_t[1] + y * d_b[1],
                direction[2] + x * d_t[2] + y * d_b[2],
            )
            total += _density(pattern, _local((t, b, n), normalize(d)), o)
        else:
            angle = angle_at_quantile(pattern.quantile, 0, r)
            (x, y, z), is_valid = lobe_direction(pattern.is_half_angle, angle, azimuth, o[0], o[1], o[2])
            local = _local((t, b, n), direction)
            dx, dy, dz = x - local[0], y - local[1], z - local[2]
            if is_valid and z > 0 and dx * dx + dy * dy + dz * dz < chord_squared:
                total += _ONE
    scale = _ONE if is_wide else _ONE / (_PI * chord_squared)
    return scale * total / np.float32(num)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_bright_lights(tracer, points, wo, footprint, pattern, widths, environment, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the bright lights of the environment at points [start, stop). tracer: of shadows. out: added to. (n, 3)"""
    packet, lights = new_packet(tracer), environment.bright_lights
    (density, spread), mirrored = np.empty((2, LANES), np.float32), np.empty((LANES, 3), np.float32)
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for lane in range(width):
            mirrored[lane, 0], mirrored[lane, 1], mirrored[lane, 2] = mirror_direction(points, first + lane, wo)
            spread[lane] = half_vector_spread(footprint, first + lane)
        for k in range(lights.shape[0]):
            d, radius, num_lit = (lights[k, 0], lights[k, 1], lights[k, 2]), disk_radius(lights[k, 6]), 0
            for lane in range(LANES):
                p, r = first + min(lane, width - 1), mirrored[min(lane, width - 1)]
                position, reach = points.position[p], radius + widths[1] + _TWO * spread[min(lane, width - 1)]
                density[lane], chord = 0, _chord(r, d)
                if lane < width and chord < reach:
                    density[lane] = _mean_density(
                        points, p, wo, footprint, pattern, widths, d, radius, spread[lane], chord
                    )
                set_origin(packet, lane, position[0], position[1], position[2])
                set_direction(packet, lane, d[0], d[1], d[2], np.float32(np.inf))
                enable_lane(packet, lane, density[lane] > 0)
                num_lit += density[lane] > 0
            if num_lit == 0:
                continue
            trace_shadows(packet)
            for lane in range(width):
                if density[lane] > 0 and is_unoccluded(packet, lane):
                    for channel in range(3):
                        weight = density[lane] * environment.gain[channel]
                        out[first + lane, channel] += weight * lights[k, 3 + channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_small_light(tracer, points, wo, footprint, pattern, widths, emitter, gain, start, stop, out):  # type: ignore[no-untyped-def]
    """Add a light without a surface at points [start, stop).

    Args:
        tracer: of shadows. emitter: `LobeEmitter`. gain: on its unit emission. (3,)
        out: added to. (n, 3)
    """
    packet, irradiance = new_packet(tracer), np.empty(LANES, np.float32)
    for sample in range(emitter.strata.uv.shape[0]):
        _add_small_sample(
            packet, irradiance, points, wo, footprint, pattern, widths, emitter, sample, gain, start, stop, out
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_small_sample(  # type: ignore[no-untyped-def]
    packet, irradiance, points, wo, footprint, pattern, widths, emitter, sample, gain, start, stop, out
):
    """Add one sample of a light without a surface. irradiance: scratch memory, a value for each lane"""
    for first in range(start, stop, LANES):
        width, num_lit = min(LANES, stop - first), 0
        for lane in range(width):
            p = first + lane
            x, y, z = points.position[p, 0], points.position[p, 1], points.position[p, 2]
            dx, dy, dz, distance, weight, nx, ny, nz, lift = light_sample(
                emitter.light, emitter.strata, sample, _ZERO, _ZERO, x, y, z
            )
            irradiance[lane], spread = 0, half_vector_spread(footprint, p)
            chord = _chord(mirror_direction(points, p, wo), (dx, dy, dz))
            if weight > 0 and chord < _POINT_RADIUS + widths[1] + _TWO * spread:
                irradiance[lane] = weight * _mean_density(
                    points, p, wo, footprint, pattern, widths, (dx, dy, dz), _POINT_RADIUS, spread, chord
                )
            along_x, along_y, along_z, far = shadow_ray(dx, dy, dz, distance, nx, ny, nz, lift)
            set_origin(packet, lane, x, y, z)
            set_direction(packet, lane, along_x, along_y, along_z, far)
            num_lit += irradiance[lane] > 0
        if num_lit == 0:
            continue
        for lane in range(LANES):
            enable_lane(packet, lane, lane < width and irradiance[min(lane, width - 1)] > 0)
        trace_shadows(packet)
        for lane in range(width):
            if irradiance[lane] > 0 and is_unoccluded(packet, lane):
                for channel in range(3):
                    out[first + lane, channel] += irradiance[lane] * gain[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _can_reflect(points, p, wo, footprint, widths, center, radius):  # type: ignore[no-untyped-def]
    """Return whether the lobe of a point meets a sphere. center: (3,) radius: meters. Others: as in `_mean_density`."""
    position, r = points.position[p], mirror_direction(points, p, wo)
    dx, dy, dz = center[0] - position[0], center[1] - position[1], center[2] - position[2]
    distance = np.float32(math.sqrt(dx * dx + dy * dy + dz * dz))
    if distance <= radius:
        return True
    reach = np.float32(math.asin(radius / distance)) + widths[1] + _TWO * half_vector_spread(footprint, p)
    return reach > _HALF * _PI or acos_clamped((dx * r[0] + dy * r[1] + dz * r[2]) / distance) < reach


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _mean_coverage(points, p, wo, footprint, pattern, widths, triangle):  # type: ignore[no-untyped-def]
    """Share of the lobe that a triangle covers, averaged over the part of a pixel that a point shows.

    Args:
        points, p, wo, footprint, pattern, widths: as in `_mean_density`. triangle: its corners, meters. (3, 3)
    """
    part, position = footprint[min(p, footprint.shape[0] - 1)], points.position[p]
    ratio, total = half_vector_spread(footprint, p) / widths[0], _ZERO
    num = 1 + min(int(_JITTERS_OF_EQUAL * ratio * ratio), _MOST_COVERAGES - 1)
    a, b, c = (
        (triangle[0, 0] - position[0], triangle[0, 1] - position[1], triangle[0, 2] - position[2]),
        (triangle[1, 0] - position[0], triangle[1, 1] - position[1], triangle[1, 2] - position[2]),
        (triangle[2, 0] - position[0], triangle[2, 1] - position[1], triangle[2, 2] - position[2]),
    )
    for k in range(num):
        u, v = ray_jitter(k, points.seed[p])
        u, v = (_HALF, _HALF) if num == 1 else (u, v)
        frame, o = jittered_frame(points.normal[p], points.tangent[p], wo[p], part, u - _HALF, v - _HALF)
        total += lobe_coverage(pattern, (_local(frame, a), _local(frame, b), _local(frame, c)), o)
    return total / np.float32(num)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_triangle(packet, points, wo, footprint, pattern, widths, emitter, t, gain, first, width, lit, out):  # type: ignore[no-untyped-def]
    """Add a triangle of an area light at points [first, first + width).

    Args:
        packet: of shadow rays. t: the triangle. lit: points whose lobe may meet the light. (lanes,)
        emitter, gain, out: as in `_add_small_light`.
    """
    triangle, normal, num_lit = emitter.triangles[t], emitter.normal[t], 0
    coverage = np.zeros(LANES, np.float32)
    for lane in range(width):
        if not lit[lane]:
            continue
        p = first + lane
        position = points.position[p]
        facing = _ZERO
        for axis in range(3):
            facing += normal[axis] * (position[axis] - triangle[0, axis])
        if facing <= 0 and not emitter.light.is_two_sided:
            continue
        coverage[lane] = _mean_coverage(points, p, wo, footprint, pattern, widths, triangle)
        if coverage[lane] > 0:
            num_lit += 1
            x, y, z = nearest_point(triangle, normal, position, mirror_direction(points, p, wo))
            span = math.sqrt((x - position[0]) ** 2 + (y - position[1]) ** 2 + (z - position[2]) ** 2)
            lift = emitter.end_offset[t, 0] + emitter.end_offset[t, 1] * np.float32(span)
            lift = lift if facing > 0 else -lift
            set_origin(packet, lane, position[0], position[1], position[2])
            set_direction(
                packet, lane, x + lift * normal[0] - position[0], y + lift * normal[1] - position[1],
                z + lift * normal[2] - position[2], _ONE,
            )  # fmt: skip
    if num_lit == 0:
        return
    for lane in range(LANES):
        enable_lane(packet, lane, coverage[lane] > 0)
    trace_shadows(packet)
    for lane in range(width):
        if coverage[lane] > 0 and is_unoccluded(packet, lane):
            for channel in range(3):
                out[first + lane, channel] += coverage[lane] * emitter.radiance[t] * gain[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_area_light(tracer, points, wo, footprint, pattern, widths, emitter, gain, start, stop, out):  # type: ignore[no-untyped-def]
    """Add an area light at points [start, stop). Arguments as in `_add_small_light`."""
    packet, lit = new_packet(tracer), np.zeros(LANES, np.uint8)
    for first in range(start, stop, LANES):
        width, num_lit = min(LANES, stop - first), 0
        for lane in range(width):
            lit[lane] = _can_reflect(points, first + lane, wo, footprint, widths, emitter.center, emitter.radius)
            num_lit += lit[lane]
        if num_lit > 0:
            for t in range(emitter.triangles.shape[0]):
                _add_triangle(packet, points, wo, footprint, pattern, widths, emitter, t, gain, first, width, lit, out)


class LobeLight(NamedTuple):
    """A local light of a look in narrow lobes.

    Attributes:
        emitter: of unit emission. gain: per channel.
        casters: the triangles that cast its shadows. link: the surfaces that it lights.
    """

    emitter: LobeEmitter
    gain: Rgb
    casters: EmbreeScene
    link: Link | None


def add_direct_lights(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    pattern: LobePattern,
    local_lights: Sequence[LobeLight],
    radiance: Shaped[F32, "n 3"],
) -> None:
    """Add the direct light of bright lights of the environment, and of local lights.

    Args:
        scene: that casts shadows. environment: with the gain of all its light. receivers: the points.
        footprint: of each point, see `relume.transport.lobe_hits.trace_lobe_rays`. pattern: of the whole lobe.
        local_lights: the local lights. radiance: L̄ of each point, added to.
    """
    points = receivers.points
    args = points, receivers.wo, footprint, pattern, lobe_widths(pattern)

    def add_linked(add: Callable[..., None], casters: EmbreeScene, link: Link | None, *light_args: Any) -> None:
        tracer, out = casters.shadow_tracer(coherent=True), radiance if link is None else np.zeros_like(radiance)
        parallel_for_chunks(lambda start, stop: add(tracer, *args, *light_args, start, stop, out), points.num_points)
        if link is not None:
            scene.links.darken(link, points, out)
            np.add(radiance, out, out=radiance)

    add_linked(_add_bright_lights, scene.geometry.embree, scene.links.environment, environment)
    for emitter, gain, casters, link in local_lights:
        add_light = _add_area_light if emitter.light.kind == SURFACE else _add_small_light
        add_linked(add_light, casters, link, emitter, np.array(gain, np.float32))


def lobe_widths(pattern: LobePattern) -> Shaped[F32, " 2"]:
    """Return the median and the 99.9th percentile of the angles of ωi to the mirror direction, radians."""
    last = pattern.quantile.shape[1] - 1
    angle = pattern.quantile[0, [last // 2, int(0.999 * last)]] * (2 if pattern.is_half_angle else 1)
    return np.asarray(angle, np.float32)
