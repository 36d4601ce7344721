"""Reflected light on gather cells: direct light, then bounce after bounce along links; never a matrix, never inverted.

    L_0 = ρ/π E,   L_{b+1}(g) = ρ(g) · mean over the gather rays r of g of L_b(link(g, r)),   L = Σ_b L_b

with ρ the reflectance of a cell, of all its terms over all directions, and E its irradiance from the environment. Rays
of density cos θ / π make the mean an estimate of ∫ L cos θ dω / π; a ray that leaves the scene finds nothing, since
what it would find is in E.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.lights.spherical_triangles import TriangleLights
from relume.patches.patch_kdtree import NO_PATCH

F32 = NDArray[np.float32]

_POINTS_PER_RANGE = 2048
_PREVIEW_BOUNCES = 6  # a thousandth of the light in a Cornell box is wrong then
_MAX_BOUNCE_RATIO = 0.999


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
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


def irradiance(normal: F32, visible: NDArray[np.uint8], lights: TriangleLights) -> F32:
    """Sum the irradiance of points, with the cosine of each light's mean direction.

    Args:
        normal: of the points, unit. (n, 3) float32
        visible: light m of a point in bit m & 7 of byte m >> 3. (n, bytes) uint8
        lights: the environment's triangles.
    Returns:
        E per channel. (n, 3) float32
    """
    out = np.empty((len(normal), 3), np.float32)
    args = (normal, visible, lights.direction, lights.irradiance)
    for_ranges(lambda start, stop: _irradiance(*args, start, stop, out), len(normal), _POINTS_PER_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True)
def _bounce_kernel(gather_hits, reflectance, radiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Reflect once. radiance: four channels, so that a cell's are added at once; black in row `NO_PATCH`."""
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


def one_bounce(gather_hits: NDArray[np.uint16], reflectance: F32, radiance: F32) -> F32:
    """Reflect the light of cells once more: L_{b+1} of L_b.

    Args:
        gather_hits: cell that each ray of a cell hits. (C, rays) uint16
        reflectance: in [0, 1]. (C, 3) float32. radiance: L_b. (C, 3) float32
    Returns:
        L_{b+1}. (C, 3) float32
    Cost: O(C · rays) reads at random from the radiance, which fits a core's cache.
    """
    out = np.empty_like(radiance)
    padded = np.zeros((NO_PATCH + 1, 4), np.float32)
    padded[: len(radiance), :3] = radiance
    parallel_for_chunks(
        lambda start, stop: _bounce_kernel(gather_hits, reflectance, padded, start, stop, out), len(gather_hits)
    )
    return out


def bounces(gather_hits: NDArray[np.uint16], reflectance: F32, direct: F32, num_bounces: int) -> F32:
    """Sum the radiance that cells send out after at most `num_bounces` reflections between them, L_0 included.

    Args:
        gather_hits, reflectance: as in `one_bounce`. direct: L_0. (C, 3) float32
        num_bounces: at least 0.
    Returns:
        Σ_b L_b. (C, 3) float32
    """
    total = direct.astype(np.float64)
    radiance = direct
    for _ in range(num_bounces):
        radiance = one_bounce(gather_hits, reflectance, radiance)
        total += radiance
    return total.astype(np.float32)


def preview_bounces(
    gather_hits: NDArray[np.uint16], few_rays: NDArray[np.uint16], reflectance: F32, direct: F32, num_bounces: int
) -> F32:
    """Estimate `bounces` for a moving hand: after a few bounces, as if each left the same share of the one before.

    The bounces are a power iteration: their shape settles soon, and then only their size changes.

    Args:
        gather_hits: of all rays, for the first bounce. (C, rays) uint16
        few_rays: of some of them, for all other bounces, whose light is even already. What noise they leave is each
            cell's own, and gather rays see many cells. (C, fewer rays) uint16
        reflectance, direct, num_bounces: as in `bounces`.
    Returns:
        Σ_b L_b, roughly. (C, 3) float32
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
