"""Lobe rays of few points, shared among their neighbors in an image.

Time allows about one ray for each pixel of a polished surface. Rays are traced at points that are spread evenly, and
every point averages its neighbors whose mirror directions differ by less than the lobe, or than one pixel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_radiance import add_direct_lights, lobe_widths, mean_lobe_radiance
from relume.live.free_camera.lobe_terms import TracedLobe
from relume.raytrace.lobe_directions import make_lobe_pattern
from relume.transport.lobe_hits import half_vector_spread
from relume.transport.lobe_scene import LobeScene
from relume.transport.shading_points import LocalRays, ShadingPoints

F32 = NDArray[np.float32]

MAX_RAYS = 60_000
"""Of a frame, for 15 frames a second on two cores."""

_MOST_RAYS = 8  # of a point
_SEED = 1
_STEP_X, _STEP_Y = 1 / 1.32471795724474602596, 1 / 1.32471795724474602596**2  # R2 sequence: spreads points evenly
_REACH, _MAX_REACH = 2, 32  # pixels from which rays are shared, and where there are none nearer
_LEAST_POINTS = 256  # with rays of their own
_SHARED_PART = np.float32(0.5)  # of the squared widths of lobe and pixel
_LEAST_WEIGHT = np.float32(1e-3)  # of the nearest neighbor, where no other agrees
_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)


class ImagePoints(NamedTuple):
    """Points in an image.

    Attributes:
        pixel: of each point. is_first: true for one point of each pixel; for none, nothing is shared.
        size: of the image, pixels.
    """

    pixel: Shaped[NDArray[np.integer], " n"]
    is_first: Shaped[NDArray[np.bool_], " n"]
    size: tuple[int, int]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _mirror_direction(points, p, wo):  # type: ignore[no-untyped-def]
    """Mirror direction of a point, a tuple."""
    n, o = points.normal[p], wo[p]
    twice = _TWO * (n[0] * o[0] + n[1] * o[1] + n[2] * o[2])
    return twice * n[0] - o[0], twice * n[1] - o[1], twice * n[2] - o[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _weight(points, wo, position, n, r, q, sharpness):  # type: ignore[no-untyped-def]
    """Weight of a neighbor q, by its mirror direction; zero if it is no continuation of the surface.

    Args:
        points, wo, q: the neighbor. position, n, r: of the point, with its mirror direction. sharpness: of the weight.
    """
    neighbor, s = points.position[q], _mirror_direction(points, q, wo)
    dx, dy, dz = neighbor[0] - position[0], neighbor[1] - position[1], neighbor[2] - position[2]
    rise = n[0] * dx + n[1] * dy + n[2] * dz
    if rise * rise > np.float32(0.25) * (dx * dx + dy * dy + dz * dz):
        return _ZERO
    dx, dy, dz = r[0] - s[0], r[1] - s[1], r[2] - s[2]
    return np.float32(math.exp(-sharpness * (dx * dx + dy * dy + dz * dz)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _share(row_of_pixel, width, pixel, points, wo, footprint, lobe_width, radiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Average neighbors of points [start, stop); see `share_with_neighbors`. lobe_width: radians"""
    height = row_of_pixel.shape[0] // width
    for p in range(start, stop):
        y = pixel[p] // width
        x, n, position, r = pixel[p] - y * width, points.normal[p], points.position[p], _mirror_direction(points, p, wo)
        spread = half_vector_spread(footprint, p)
        sharpness = _ONE / (_SHARED_PART * (lobe_width * lobe_width + spread * spread) + np.float32(1e-12))
        total, reach = _ZERO, _REACH
        while total == 0 and reach <= _MAX_REACH:
            for row in range(max(y - reach, 0), min(y + reach + 1, height)):
                for column in range(max(x - reach, 0), min(x + reach + 1, width)):
                    q = row_of_pixel[row * width + column]
                    if q < 0:
                        continue
                    weight = _weight(points, wo, position, n, r, q, sharpness)
                    distance = np.float32((row - y) * (row - y) + (column - x) * (column - x))
                    weight += _LEAST_WEIGHT / (_ONE + distance * distance * distance)
                    total += weight
                    for channel in range(3):
                        out[p, channel] += weight * radiance[q, channel]
            reach *= 4
        scale = _ONE / max(total, np.float32(1e-20))
        for channel in range(3):
            out[p, channel] *= scale


def _share_with_neighbors(
    radiance: Shaped[F32, "n 3"],
    is_traced: Shaped[NDArray[np.bool_], " n"],
    image: ImagePoints,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "n 2 2 3"],
    lobe_width: np.float32,
) -> Shaped[F32, "n 3"]:
    """Average the radiance in lobes over neighbors whose mirror directions differ by less than the lobe, or a pixel.

    Args:
        radiance: of each point. is_traced: points that have any, at most one in each pixel.
        image, receivers, footprint: as in `lobe_radiance`. lobe_width: from `lobe_widths`.
    """
    width, height = image.size
    row_of_pixel = np.full(width * height, -1, np.int32)
    row_of_pixel[image.pixel[is_traced]] = np.flatnonzero(is_traced)
    out = np.zeros_like(radiance)
    args = row_of_pixel, width, image.pixel.astype(np.int64), receivers.points, receivers.wo, footprint, lobe_width
    parallel_for_chunks(lambda start, stop: _share(*args, radiance, start, stop, out), len(radiance))
    return out


def lobe_radiance(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "n 2 2 3"],
    lobe: TracedLobe,
    image: ImagePoints,
    rays_per_point: float,
    local_rays: Sequence[LocalRays],
    *,
    is_direct: bool,
) -> Shaped[F32, "n 3"]:
    """Return the mean radiance L̄ in the lobe of each point.

    Args:
        scene, environment, receivers, footprint, is_direct: as in `mean_lobe_radiance`. lobe: of all points.
        image: where the points are. rays_per_point: mean number that time allows. local_rays: of local lights.
    """
    num_rays = int(np.clip(rays_per_point, 1, _MOST_RAYS))
    core, pattern = (make_lobe_pattern(sampling, num_rays, _SEED) for sampling in (lobe.core, lobe.sampling))
    lobe_width, light_args = lobe_widths(pattern)[0], (scene, environment)
    y, x = np.divmod(image.pixel, max(image.size[0], 1))
    share = max(rays_per_point, _LEAST_POINTS / max(int(np.count_nonzero(image.is_first)), 1))
    is_traced = image.is_first & ((x * _STEP_X + y * _STEP_Y) % 1.0 < share)
    traced = np.flatnonzero(is_traced) if image.is_first.any() else np.arange(len(is_traced))
    radiance = np.zeros((len(is_traced), 3), np.float32)
    points, sides = receivers.without_light(traced), footprint[traced]
    radiance[traced] = mean_lobe_radiance(*light_args, points, sides, core, lobe_width, is_direct=is_direct)
    if image.is_first.any():
        radiance = _share_with_neighbors(radiance, is_traced, image, receivers, footprint, lobe_width)
    if is_direct:
        add_direct_lights(*light_args, receivers, footprint, pattern, local_rays, radiance)
    return radiance
