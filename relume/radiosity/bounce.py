"""Bounces between patches along gather hits, starting from direct light; no matrix is built or inverted.

    L_0 = ρ/π E,   L_{b+1}(g) = ρ(g) · mean over the gather rays r of g of L_b(hit(g, r)),   L = Σ_b L_b

ρ is the reflectance of a patch, of all terms over all directions, and E its direct irradiance. Rays with density
cos θ / π make the mean an estimate of ∫ L cos θ dω / π; rays that leave the scene count as black, since the environment
is included in E.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.lights.spherical_triangles import TriangleLights
from relume.patches.patch_kdtree import NO_PATCH

F32 = NDArray[np.float32]

_POINTS_PER_RANGE = 2048
_PREVIEW_BOUNCES = 6  # the error in a Cornell box is then a thousandth
_MAX_BOUNCE_RATIO = 0.999


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _irradiance(normal, visible, directions, normal_irradiance, start, stop, out):  # type: ignore[no-untyped-def]
    for p in range(start, stop):
        red = green = blue = 0.0
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        for m in range(directions.shape[0]):
            if (visible[p, m >> 3] >> (m & 7)) & 1:
                cosine = max(nx * directions[m, 0] + ny * directions[m, 1] + nz * directions[m, 2], np.float32(0))
                red += cosine * normal_irradiance[m, 0]
                green += cosine * normal_irradiance[m, 1]
                blue += cosine * normal_irradiance[m, 2]
        out[p, 0], out[p, 1], out[p, 2] = red, green, blue


def irradiance(
    normal: Shaped[F32, "n 3"], visible: Shaped[NDArray[np.uint8], "n bytes"], lights: TriangleLights
) -> Shaped[F32, "n 3"]:
    """Return the irradiance of points, with the cosine of each light's mean direction.

    Args:
        normal: normal of the points, unit. visible: light m of a point in bit m & 7 of byte m >> 3.
        lights: the environment's triangles.
    """
    out = np.empty((len(normal), 3), np.float32)
    args = (normal, visible, lights.direction, lights.irradiance)
    for_ranges(lambda start, stop: _irradiance(*args, start, stop, out), len(normal), _POINTS_PER_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True)
def _bounce_kernel(gather_hits, reflectance, radiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute one bounce. radiance: four channels, added as one vector; black in row `NO_PATCH`."""
    ray_weight = np.float32(1 / gather_hits.shape[1])
    total = np.empty(4, np.float32)
    for patch in range(start, stop):
        total[:] = 0
        for ray in range(gather_hits.shape[1]):
            hit_radiance = radiance[gather_hits[patch, ray]]
            for channel in range(4):
                total[channel] += hit_radiance[channel]
        for channel in range(3):
            out[patch, channel] = reflectance[patch, channel] * total[channel] * ray_weight


def one_bounce(
    gather_hits: Shaped[NDArray[np.uint16], "patches rays"],
    reflectance: Shaped[F32, "patches 3"],
    radiance: Shaped[F32, "patches 3"],
) -> Shaped[F32, "patches 3"]:
    """Compute one bounce between patches: L_{b+1} from L_b. O(patches · rays) random reads from the cache.

    Args:
        gather_hits: patch that each ray of a patch hits. reflectance: in [0, 1]. radiance: L_b.
    """
    out = np.empty_like(radiance)
    padded = np.zeros((NO_PATCH + 1, 4), np.float32)
    padded[: len(radiance), :3] = radiance
    parallel_for_chunks(
        lambda start, stop: _bounce_kernel(gather_hits, reflectance, padded, start, stop, out), len(gather_hits)
    )
    return out


def bounces(
    gather_hits: Shaped[NDArray[np.uint16], "patches rays"],
    reflectance: Shaped[F32, "patches 3"],
    direct: Shaped[F32, "patches 3"],
    num_bounces: int,
) -> Shaped[F32, "patches 3"]:
    """Return the outgoing radiance Σ_b L_b of patches after up to `num_bounces` bounces, with L_0.

    Args:
        gather_hits, reflectance: as in `one_bounce`. direct: L_0. num_bounces: at least 0.
    """
    total = direct.astype(np.float64)
    radiance = direct
    for _ in range(num_bounces):
        radiance = one_bounce(gather_hits, reflectance, radiance)
        total += radiance
    return total.astype(np.float32)


def preview_bounces(
    gather_hits: Shaped[NDArray[np.uint16], "patches rays"],
    few_rays: Shaped[NDArray[np.uint16], "patches few"],
    reflectance: Shaped[F32, "patches 3"],
    direct: Shaped[F32, "patches 3"],
    num_bounces: int,
) -> Shaped[F32, "patches 3"]:
    """Approximate `bounces` for an active edit: after a few bounces, the ratio of successive ones is kept constant.

    The bounces are a power iteration: their shape soon converges, and then only their magnitude changes.

    Args:
        gather_hits: all rays, for the first bounce.
        few_rays: a subset for further bounces, whose light is smooth. Their noise is independent per patch, and gather
            rays average over many patches.
        reflectance, direct, num_bounces: as in `bounces`.
    """
    num_exact = min(num_bounces, _PREVIEW_BOUNCES)
    total, radiance, previous = direct.astype(np.float64), direct, direct
    for k in range(num_exact):
        radiance, previous = one_bounce(gather_hits if k == 0 else few_rays, reflectance, radiance), radiance
        total += radiance
    size, previous_size = (np.sqrt(np.square(a, dtype=np.float64).sum(axis=0)) for a in (radiance, previous))
    bounce_ratio = np.minimum(size / np.maximum(previous_size, 1e-30), _MAX_BOUNCE_RATIO)
    total += radiance * (bounce_ratio * (1 - bounce_ratio ** (num_bounces - num_exact)) / (1 - bounce_ratio))
    return total.astype(np.float32)
