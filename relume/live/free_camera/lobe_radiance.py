"""Mean incident radiance along few lobe rays of each point, while a camera moves.

    L̄ = Σ_r L(ω_r) / N + light of `relume.live.free_camera.lobe_lights`

Rays r are drawn from the inner half of the lobe, so that B = a(θo) L̄ with the directional albedo a. The tail would be
noise: a ray that leaves the scene brings the environment blurred by the core and by the tail, half each.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.environment_lookup import add_environment, blur_level
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_lights import disk_radius
from relume.math.rgb9e5 import unpack_rgb9e5
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import (
    LobePattern,
    lobe_shift,
)
from relume.transport.lobe_hits import lobe_ray_in_pixel, trace_lobe_rays
from relume.transport.lobe_paths import ESCAPE, REFLECTION, TRANSMISSION
from relume.transport.lobe_rays import from_patch, isotropic_at, texels_at
from relume.transport.lobe_scene import LobeScene
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_CORE_BLUR, _TAIL_BLUR = np.float32(0.5), np.float32(2)  # of the environment, by the width of the lobe
_MARGIN = np.float32(1.5)  # around a bright light, which blurred texels exclude


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
        radius = _MARGIN * disk_radius(lights[k, 6])
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
