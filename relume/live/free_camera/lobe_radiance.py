"""Mean incident radiance along few lobe rays of each point, while a camera moves.

    L̄ = Σ_r L(ω_r) / N + light of `relume.live.free_camera.lobe_lights`

Rays r are drawn from the inner half of the lobe, so that B = a(θo) L̄ with the directional albedo a. The tail would be
noise. A ray that leaves the scene brings the environment about the mirror direction of its point, blurred by lobe and
pixel, without noise: rays decide how much of it is seen.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.environment_lookup import add_environment, blur_level
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_lights import disk_radius, mirror_direction
from relume.live.free_camera.reflected_lights import add_reflected_lights
from relume.math.rgb9e5 import unpack_rgb9e5
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import (
    LobePattern,
    lobe_shift,
    lobe_vector,
)
from relume.transport.lobe_hits import half_vector_spread, lobe_ray_in_pixel, trace_lobe_rays
from relume.transport.lobe_paths import ESCAPE, REFLECTION, TRANSMISSION
from relume.transport.lobe_rays import from_patch, isotropic_at, texels_at
from relume.transport.lobe_scene import LobeScene
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PIXEL_BLUR = np.float32(1 / math.sqrt(3))  # of mirror directions that fill a square, by half its side
_LEAST_BLUR = np.float32(1e-6)  # so that bright lights light all lobes that rays meet: few rays would meet them
_MARGIN = np.float32(1.5)  # around a bright light, which blurred texels exclude


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_environment(environment, sigma, share, world, gain, scratch, out):  # type: ignore[no-untyped-def]
    """Add the blurred environment in a direction, without its bright lights.

    Args:
        environment: `PrefilteredEnvironment`. sigma: two blurs, radians, ascending. share: of the first.
        world: direction. gain: three factors. scratch, out: (3,)
    """
    level, lights = blur_level(sigma[0]), environment.bright_lights
    for k in range(lights.shape[0]):
        cosine = lights[k, 0] * world[0] + lights[k, 1] * world[1] + lights[k, 2] * world[2]
        radius = _MARGIN * disk_radius(lights[k, 6])
        if cosine > _ONE - _HALF * radius * radius:
            level = max(level, _ONE)
    scratch[0] = scratch[1] = scratch[2] = 0
    add_environment(environment.environment, environment.rotation, world, level, share, scratch)
    if share < 1:
        level = max(level, blur_level(sigma[1]))
        add_environment(environment.environment, environment.rotation, world, level, _ONE - share, scratch)
    for channel in range(3):
        out[channel] += gain[channel] * environment.gain[channel] * scratch[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_path(paths, first, last, light_args, environment, direct, scratch, out):  # type: ignore[no-untyped-def]
    """Add the light along a path, its entries [first, last).

    Args:
        light_args: outgoing, textured, emission and surfaces of `LobeScene`. environment: `PrefilteredEnvironment`.
        direct: radiance of the environment behind the point. (3,) scratch, out: (3,)
    """
    outgoing, textured, emission, surfaces = light_args
    for entry in range(first, last):
        kind, patch, lobe, d = paths.kind[entry], paths.patch[entry], paths.lobe[entry], paths.direction[entry]
        gain, world, emitter = paths.throughput[entry], (d[0], d[1], d[2]), paths.emitter[entry]
        if kind == ESCAPE:
            blur = surfaces.blur[lobe]
            _add_environment(environment, (blur, blur), _ONE, world, (gain[0], gain[1], gain[2]), scratch, out)
        elif kind == TRANSMISSION:
            for channel in range(3):
                out[channel] += gain[channel] * direct[channel]
        elif kind == REFLECTION:
            if paths.kind[min(entry + 1, last - 1)] == ESCAPE:  # what the ray meets stands for the visibility of all
                add_reflected_lights(environment.bright_lights, environment.gain, surfaces, paths, entry, out)
        elif patch != NO_PATCH:
            light = from_patch(outgoing, textured, patch, texels_at(textured, paths.texture[entry]), world)
            for channel in range(3):
                out[channel] += gain[channel] * light[channel]
        if emitter < emission.shape[0]:
            image = unpack_rgb9e5(paths.emission[entry])
            for channel in range(3):
                out[channel] += gain[channel] * emission[emitter, channel] * image[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _mean_radiance(points, wo, footprint, hits, pattern, light_args, environment, blur, is_direct, start, stop, out):  # type: ignore[no-untyped-def]
    """Average the light of the rays of points [start, stop).

    Args:
        points: `SurfacePoints`. wo: view directions. footprint: of each point, or one. hits: fields of `LobeHits`.
        pattern: `LobePattern`. light_args: outgoing, textured, emission, surfaces and broad_share of `LobeScene`.
        environment: `PrefilteredEnvironment`. blur: of `TracedLobe`.
        is_direct: whether rays that leave the scene at once bring light. out: written. (n, 3)
    """
    (patch, escapes, texture, paths), (outgoing, textured, emission, surfaces, broad_share) = hits, light_args
    light, direct, scratch = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    gain, path_args = (_ONE, _ONE, _ONE), ((outgoing, textured, emission, surfaces), environment, direct)
    for p in range(start, stop):
        shift, path, last_path, num = lobe_shift(pattern, points.seed[p]), paths.first[p], paths.first[p + 1], 0
        light[0] = light[1] = light[2] = direct[0] = direct[1] = direct[2] = 0
        if is_direct:
            pixel = _PIXEL_BLUR * half_vector_spread(footprint, p)
            sigma = (
                np.float32(math.sqrt(blur[0] * blur[0] + pixel * pixel)),
                np.float32(math.sqrt(blur[1] * blur[1] + pixel * pixel)),
            )
            _add_environment(environment, sigma, blur[2], mirror_direction(points, p, wo), gain, scratch, direct)
        for ray in range(patch.shape[1]):
            first_entry = path
            while path < last_path and paths.ray[path] == ray:
                path += 1
            vector, _ = lobe_vector(pattern, 0, ray, shift)
            world, is_traced = lobe_ray_in_pixel(
                pattern, vector, ray, points.normal[p], points.tangent[p], wo[p],
                footprint[min(p, footprint.shape[0] - 1)], points.seed[p],
            )  # fmt: skip
            num += is_traced
            hit = patch[p, ray]
            if not is_traced:
                continue
            if (escapes[p, ray >> 3] >> (ray & 7)) & 1:
                for channel in range(3):
                    light[channel] += direct[channel]
            elif path > first_entry:
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


def mean_lobe_radiance(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    core: LobePattern,
    blur: tuple[np.float32, np.float32, np.float32],
    *,
    is_direct: bool,
) -> Shaped[F32, "n 3"]:
    """Trace few lobe rays and average their light, without bright and local lights.

    Args:
        scene: that is met. environment: behind it; its gain is of all its light.
        receivers: the points; only positions, frames, seeds and wo are read.
        footprint: of each point, see `relume.transport.lobe_hits.trace_lobe_rays`.
        core: rays of every point, from the inner half of the lobe. blur: of `TracedLobe`.
        is_direct: whether direct light is shown.
    """
    points, wo = receivers.points, receivers.wo
    point_args = points, wo, footprint
    surfaces = scene.surfaces._replace(blur=np.maximum(scene.surfaces.blur, _LEAST_BLUR))
    hits = scene.links.lit_hits(
        trace_lobe_rays(scene.geometry, scene.lookup, surfaces, *point_args, None, core), points
    )
    out = np.empty((points.num_points, 3), np.float32)
    light_args = scene.outgoing, scene.textured, scene.emission, surfaces, scene.broad_share
    args = (
        *point_args,
        (hits.patch, hits.escapes, hits.texture, hits.paths),
        core,
        light_args,
        environment,
        blur,
        is_direct,
    )
    parallel_for_chunks(lambda start, stop: _mean_radiance(*args, start, stop, out), points.num_points)
    return out
