"""Mean incident radiance along few lobe rays of each point, while a camera moves.

    L̄ = Σ_r L(ω_r) / N + Σ_k V_k E_k p(ω_k)

Rays r are drawn from the inner half of the lobe with density p, so that B = a(θo) L̄ with the directional albedo a. The
tail would be noise: a ray that leaves the scene brings the environment blurred by the core and by the tail, half each.
Small bright lights k of the environment, and local lights, are no chance hits of rays but evaluated by p, with one
shadow ray each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.environment_lookup import add_environment, blur_level
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.normal_mapping import normalize
from relume.math.fast_math import acos_clamped
from relume.math.rgb9e5 import unpack_rgb9e5
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import (
    LobePattern,
    angle_at_quantile,
    lobe_density,
    lobe_direction,
    lobe_shift,
    ray_jitter,
)
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)
from relume.transport.lobe_hits import half_vector_spread, jittered_frame, lobe_ray_in_pixel, trace_lobe_rays
from relume.transport.lobe_paths import ESCAPE, REFLECTION, TRANSMISSION
from relume.transport.lobe_rays import from_patch, isotropic_at, texels_at
from relume.transport.lobe_scene import LobeScene
from relume.transport.patch_lookup import tangents_of
from relume.transport.shading_points import LocalRays, ShadingPoints, build_ray_lists

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PI = np.float32(math.pi)
# normals of a pixel at which a bright light is evaluated: most if their spread is larger than light and lobe
_LEAST_JITTERS, _JITTERS_OF_EQUAL, _MOST_JITTERS = 8, np.float32(16), 64
_CORE_BLUR, _TAIL_BLUR = np.float32(0.5), np.float32(2)  # of the environment, by the width of the lobe
_DIRECTION_SEED = np.uint32(0x27D4EB2F)
_MARGIN = np.float32(1.5)  # around a bright light, which blurred texels exclude


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _radius(variance):  # type: ignore[no-untyped-def]
    """Radius of a disk of directions, radians. variance: 1 − R, with the length R of their mean"""
    return _TWO * np.float32(math.sqrt(max(variance, np.float32(1e-8))))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_escaping(environment, sigma, world, gain, scratch, out):  # type: ignore[no-untyped-def]
    """Add the environment along a ray, without its bright lights.

    Args:
        environment: `PrefilteredEnvironment`. sigma: two blurs that are averaged, radians. world: direction.
        gain: three factors. scratch, out: (3,)
    """
    level, lights = blur_level(sigma[0]), environment.bright_lights
    for k in range(lights.shape[0]):
        cosine = lights[k, 0] * world[0] + lights[k, 1] * world[1] + lights[k, 2] * world[2]
        radius = _MARGIN * _radius(lights[k, 6])
        if cosine > _ONE - _HALF * radius * radius:
            level = max(level, _ONE)
    scratch[0] = scratch[1] = scratch[2] = 0
    add_environment(environment.environment, environment.rotation, world, level, _HALF, scratch)
    level = max(level, blur_level(sigma[1]))
    add_environment(environment.environment, environment.rotation, world, level, _HALF, scratch)
    for channel in range(3):
        out[channel] += gain[channel] * environment.gain[channel] * scratch[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_path(paths, first, last, light_args, environment, direct, scratch, out):  # type: ignore[no-untyped-def]
    """Add the light along a path, its entries [first, last).

    Args:
        light_args: outgoing, textured, emission and surfaces of `LobeScene`. environment: `PrefilteredEnvironment`.
        direct: radiance of the environment along the ray. (3,) scratch, out: (3,)
    """
    outgoing, textured, emission, surfaces = light_args
    for entry in range(first, last):
        kind, patch, lobe, d = paths.kind[entry], paths.patch[entry], paths.lobe[entry], paths.direction[entry]
        gain, world, emitter = paths.throughput[entry], (d[0], d[1], d[2]), paths.emitter[entry]
        if kind == ESCAPE:
            blur = surfaces.blur[lobe]
            _add_escaping(environment, (blur, blur), world, (gain[0], gain[1], gain[2]), scratch, out)
        elif kind == TRANSMISSION:
            for channel in range(3):
                out[channel] += gain[channel] * direct[channel]
        elif kind != REFLECTION and patch != NO_PATCH:
            light = from_patch(outgoing, textured, patch, texels_at(textured, paths.texture[entry]), world)
            for channel in range(3):
                out[channel] += gain[channel] * light[channel]
        if emitter < emission.shape[0]:
            image = unpack_rgb9e5(paths.emission[entry])
            for channel in range(3):
                out[channel] += gain[channel] * emission[emitter, channel] * image[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _mean_radiance(points, wo, footprint, hits, pattern, light_args, environment, sigma, is_direct, start, stop, out):  # type: ignore[no-untyped-def]
    """Average the light of the rays of points [start, stop).

    Args:
        points: `SurfacePoints`. wo: view directions. footprint: of each point, or one. hits: fields of `LobeHits`.
        pattern: `LobePattern`. light_args: outgoing, textured, emission, surfaces and broad_share of `LobeScene`.
        environment: `PrefilteredEnvironment`. sigma: its blurs for core and tail, radians.
        is_direct: whether rays that leave the scene at once bring light. out: written. (n, 3)
    """
    (patch, escapes, texture, paths), (outgoing, textured, emission, surfaces, broad_share) = hits, light_args
    light, direct, scratch = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    gain = (_ONE, _ONE, _ONE) if is_direct else (_ZERO, _ZERO, _ZERO)
    for p in range(start, stop):
        shift, path, last_path, num = lobe_shift(pattern, points.seed[p]), paths.first[p], paths.first[p + 1], 0
        light[0] = light[1] = light[2] = 0
        for ray in range(patch.shape[1]):
            first_entry = path
            while path < last_path and paths.ray[path] == ray:
                path += 1
            world, is_traced = lobe_ray_in_pixel(
                pattern, 0, ray, shift, points.normal[p], points.tangent[p], wo[p],
                footprint[min(p, footprint.shape[0] - 1)], points.seed[p],
            )  # fmt: skip
            num += is_traced
            hit = patch[p, ray]
            if not is_traced:
                continue
            if (escapes[p, ray >> 3] >> (ray & 7)) & 1:
                _add_escaping(environment, sigma, world, gain, scratch, light)
            elif path > first_entry:
                direct[0] = direct[1] = direct[2] = 0
                if paths.kind[path - 1] == TRANSMISSION:
                    _add_escaping(environment, sigma, world, gain, scratch, direct)
                path_args = (outgoing, textured, emission, surfaces), environment, direct
                _add_path(paths, first_entry, path, *path_args, scratch, light)
                from_hit = isotropic_at(textured, hit, texels_at(textured, texture[:, p, ray]))
                for channel in range(3):
                    light[channel] += broad_share[hit] * from_hit[channel]
            elif hit != NO_PATCH:
                from_hit = from_patch(outgoing, textured, hit, texels_at(textured, texture[:, p, ray]), world)
                for channel in range(3):
                    light[channel] += from_hit[channel]
        scale = _ONE / np.float32(max(num, 1))
        for channel in range(3):
            out[p, channel] = scale * light[channel]


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
def _mean_density(points, p, wo, footprint, pattern, widths, direction, radius):  # type: ignore[no-untyped-def]
    """Mean density p of a disk of directions over the part of a pixel that a point shows, per steradian.

    Whichever is wider, lobe or disk, is evaluated at directions from the other.

    Args:
        points, p: the point. wo: view directions. footprint: of each point, or one. pattern: `LobePattern`.
        widths: median and 99.9th percentile of the angles of ωi to the mirror direction, radians.
        direction: center of the disk, a tuple. radius: radians.
    """
    normal, spread, seed = points.normal[p], half_vector_spread(footprint, p), points.seed[p]
    part = footprint[min(p, footprint.shape[0] - 1)]
    cosine = normal[0] * wo[p, 0] + normal[1] * wo[p, 1] + normal[2] * wo[p, 2]
    mirrored = _ZERO
    for axis in range(3):
        mirrored += direction[axis] * (_TWO * cosine * normal[axis] - wo[p, axis])
    if acos_clamped(mirrored) > radius + widths[1] + _TWO * spread:
        return _ZERO
    is_wide, ratio = widths[0] > radius, spread / max(widths[0], radius)
    num = min(int(_LEAST_JITTERS + _JITTERS_OF_EQUAL * ratio * ratio), _MOST_JITTERS)
    d_t, d_b = tangents_of(direction)
    sin_radius, half_chord, total = np.float32(math.sin(radius)), np.float32(math.sin(_HALF * radius)), _ZERO
    chord_squared = np.float32(4) * half_chord * half_chord  # by π the solid angle: 2π (1 − cos ρ) = 4π sin² ρ/2
    for k in range(num):
        u, v = ray_jitter(k, seed)
        (t, b, n), o = jittered_frame(normal, points.tangent[p], wo[p], part, u - _HALF, v - _HALF)
        r, azimuth = ray_jitter(k, np.uint32(seed) ^ _DIRECTION_SEED)
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
    density = np.empty(LANES, np.float32)
    for k in range(lights.shape[0]):
        d, radius = (lights[k, 0], lights[k, 1], lights[k, 2]), _radius(lights[k, 6])
        for first in range(start, stop, LANES):
            width, num_lit = min(LANES, stop - first), 0
            for lane in range(LANES):
                p = first + min(lane, width - 1)
                position = points.position[p]
                density[lane] = (
                    _mean_density(points, p, wo, footprint, pattern, widths, d, radius) if lane < width else _ZERO
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
def _add_local(pattern, listed, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the light of listed rays at points [start, stop). listed: `ListedRays`. out: added to. (n, 3)"""
    for p in range(start, stop):
        for ray in range(listed.first[p - start], listed.first[p - start + 1]):
            wi = listed.wi[0, ray], listed.wi[1, ray], listed.wi[2, ray]
            wo = listed.wo[0, ray], listed.wo[1, ray], listed.wo[2, ray]
            density = _density(pattern, wi, wo) / max(wi[2], np.float32(1e-3))
            for channel in range(3):
                out[p, channel] += density * listed.irradiance[channel, ray]


def mean_lobe_radiance(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    core: LobePattern,
    lobe_width: np.float32,
    *,
    is_direct: bool,
) -> Shaped[F32, "n 3"]:
    """Trace few lobe rays and average their light, without bright and local lights.

    Args:
        scene: that is met. environment: behind it; its gain is of all its light.
        receivers: the points; only positions, frames, seeds and wo are read.
        footprint: of each point, see `relume.transport.lobe_hits.trace_lobe_rays`.
        core: rays of every point, from the inner half of the lobe. lobe_width: of the lobe, from `lobe_widths`.
        is_direct: whether direct light is shown.
    """
    points, wo = receivers.points, receivers.wo
    point_args = points, wo, footprint
    hits = trace_lobe_rays(scene.geometry, scene.lookup, scene.surfaces, *point_args, None, core)
    out = np.empty((points.num_points, 3), np.float32)
    sigma = _CORE_BLUR * lobe_width, _TAIL_BLUR * lobe_width
    light_args = scene.outgoing, scene.textured, scene.emission, scene.surfaces, scene.broad_share
    args = (
        *point_args,
        (hits.patch, hits.escapes, hits.texture, hits.paths),
        core,
        light_args,
        environment,
        sigma,
        is_direct,
    )
    parallel_for_chunks(lambda start, stop: _mean_radiance(*args, start, stop, out), points.num_points)
    return out


def add_direct_lights(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    pattern: LobePattern,
    local_rays: Sequence[LocalRays],
    radiance: Shaped[F32, "n 3"],
) -> None:
    """Add the direct light of bright lights of the environment, and of local lights.

    Args:
        scene, environment, receivers, footprint: as in `mean_lobe_radiance`. pattern: of the whole lobe.
        local_rays: of local lights to the points. radiance: L̄ of each point, added to.
    """
    tracer = scene.geometry.embree.shadow_tracer(coherent=True)
    args = tracer, receivers.points, receivers.wo, footprint, pattern, lobe_widths(pattern), environment

    def kernel(start: int, stop: int) -> None:
        _add_bright_lights(*args, start, stop, radiance)
        for rays in local_rays:
            _add_local(pattern, build_ray_lists(rays, receivers, start, stop), start, stop, radiance)

    parallel_for_chunks(kernel, receivers.points.num_points)


def lobe_widths(pattern: LobePattern) -> Shaped[F32, " 2"]:
    """Return the median and the 99.9th percentile of the angles of ωi to the mirror direction, radians."""
    last = pattern.quantile.shape[1] - 1
    angle = pattern.quantile[0, [last // 2, int(0.999 * last)]] * (2 if pattern.is_half_angle else 1)
    return np.asarray(angle, np.float32)
