"""Lobe rays of few points, shared among their neighbors in an image.

Time allows about one ray for each pixel of a polished surface. Rays are traced at points that are spread evenly, and
every point averages its neighbors whose mirror directions differ by less than the lobe, or than one pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_lights import LobeLight, add_direct_lights, lobe_widths, mirror_direction
from relume.live.free_camera.lobe_radiance import mean_lobe_radiance
from relume.live.free_camera.lobe_terms import TracedLobe
from relume.raytrace.lobe_directions import make_lobe_pattern
from relume.scene.model import Camera
from relume.transport.lobe_hits import NO_FOOTPRINT, half_vector_spread
from relume.transport.lobe_scene import LobeScene
from relume.transport.shading_points import ShadingPoints
from relume.views.split_pixels import PixelPoints, SplitLimits, choose_splits, points_in_pixels, with_normals

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

MAX_RAYS = 60_000
"""Of a frame, for 15 frames a second on two cores."""

_MOST_RAYS = 8  # of a point
_SEED = 1
_SPLITS = SplitLimits(128, 384)  # points whose reflections are averaged over their pixels
_STEP_X, _STEP_Y = 1 / 1.32471795724474602596, 1 / 1.32471795724474602596**2  # R2 sequence: spreads points evenly
_REACH, _MAX_REACH = 2, 32  # pixels from which rays are shared, and where there are none nearer
_BLOCK = 16  # pixels along each side: the first point in each block has rays, so that small pieces have some in reach
_LEAST_POINTS = 256  # with rays of their own
_SHARED_PART = np.float32(0.5)  # of the squared widths of lobe and pixel
_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)
_SIXTEENTH = np.float32(1 / 16)
_NEVER = np.float32(2)
# least weight of a neighbor, where no other agrees, by its squared distance in pixels
_LEAST_WEIGHTS = (1e-3 / (1 + np.arange(2 * _MAX_REACH**2 + 1) ** 3.0)).astype(np.float32)


class PixelSource(NamedTuple):
    """A material that a camera sees directly."""

    camera: Camera
    material: int


class ImagePoints(NamedTuple):
    """Points in an image.

    Attributes:
        pixel: of each point.
        order: in [0, 1]; points whose order is below the share of points that time allows have rays. 2 for all but one
            point of a pixel.
        size: of the image, pixels; a width of 0 if the points are not neighbors: then all have rays.
        source: what is in the pixels, to average highlights over them; None: they are not.
    """

    pixel: Shaped[I32, " n"]
    order: Shaped[F32, " n"]
    size: tuple[int, int]
    source: PixelSource | None

    @classmethod
    def from_pixels(cls, pixel: Shaped[I32, " n"], size: tuple[int, int], source: PixelSource | None) -> Self:
        """Order points so that those with rays are spread evenly, whatever their number.

        Args:
            pixel, size, source: as above.
        """
        order = np.zeros(len(pixel), np.float32)
        if size[0] > 0:
            _spread(pixel, *size, order)
        return cls(pixel, order, size, source)

    @property
    def num_pixels(self) -> int:
        """Number of pixels that show a point."""
        return int(np.count_nonzero(self.order <= 1))


@nb.njit(nogil=True, cache=True)
def _spread(pixel, width, height, order):  # type: ignore[no-untyped-def]
    """Write the order of points. See `ImagePoints`."""
    is_shown = np.zeros(width * height, np.uint8)
    num_blocks = (width + _BLOCK - 1) // _BLOCK
    is_reached = np.zeros(num_blocks * ((height + _BLOCK - 1) // _BLOCK), np.uint8)
    for p in range(pixel.shape[0]):
        if is_shown[pixel[p]]:
            order[p] = _NEVER
            continue
        is_shown[pixel[p]] = 1
        y = pixel[p] // width
        x = pixel[p] - y * width
        block = y // _BLOCK * num_blocks + x // _BLOCK
        order[p] = np.float32((x * _STEP_X + y * _STEP_Y) % 1.0) if is_reached[block] else _ZERO
        is_reached[block] = 1


class _Traced(NamedTuple):
    """Points with rays of their own.

    Attributes:
        row_of_pixel: their row of each pixel of the image, −1 for none.
        position, mirror: of each, with its mirror direction. radiance: L̄ of each.
    """

    row_of_pixel: Shaped[I32, " pixels"]
    position: Shaped[F32, "m 3"]
    mirror: Shaped[F32, "m 3"]
    radiance: Shaped[F32, "m 3"]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _weight(traced, position, n, r, q, sharpness):  # type: ignore[no-untyped-def]
    """Weight of a neighbor q, by its mirror direction; zero if it is no continuation of the surface.

    Args:
        traced, q: the neighbor. position, n, r: of the point, with its mirror direction. sharpness: of the weight.
    """
    neighbor, s = traced.position[q], traced.mirror[q]
    dx, dy, dz = neighbor[0] - position[0], neighbor[1] - position[1], neighbor[2] - position[2]
    rise = n[0] * dx + n[1] * dy + n[2] * dz
    if rise * rise > np.float32(0.25) * (dx * dx + dy * dy + dz * dz):
        return _ZERO
    dx, dy, dz = r[0] - s[0], r[1] - s[1], r[2] - s[2]
    # (1 − x/16)¹⁶ is near e^−x
    weight = max(_ONE - _SIXTEENTH * sharpness * (dx * dx + dy * dy + dz * dz), _ZERO)
    weight *= weight
    weight *= weight
    weight *= weight
    return weight * weight


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _share(traced, size, pixel, points, wo, footprint, lobe_width, start, stop, out):  # type: ignore[no-untyped-def]
    """Average neighbors of points [start, stop); see `_share_with_neighbors`. lobe_width: radians"""
    width, height = size
    for p in range(start, stop):
        y = pixel[p] // width
        x, n, position, r = pixel[p] - y * width, points.normal[p], points.position[p], mirror_direction(points, p, wo)
        spread = half_vector_spread(footprint, p)
        sharpness = _ONE / (_SHARED_PART * (lobe_width * lobe_width + spread * spread) + np.float32(1e-12))
        total, reach = _ZERO, _REACH
        red = green = blue = _ZERO
        while total == 0 and reach <= _MAX_REACH:
            for row in range(max(y - reach, 0), min(y + reach + 1, height)):
                for column in range(max(x - reach, 0), min(x + reach + 1, width)):
                    q = traced.row_of_pixel[row * width + column]
                    if q < 0:
                        continue
                    weight = _weight(traced, position, n, r, q, sharpness)
                    weight += _LEAST_WEIGHTS[(row - y) * (row - y) + (column - x) * (column - x)]
                    total += weight
                    red += weight * traced.radiance[q, 0]
                    green += weight * traced.radiance[q, 1]
                    blue += weight * traced.radiance[q, 2]
            reach *= 4
        scale = _ONE / max(total, np.float32(1e-20))
        out[p, 0], out[p, 1], out[p, 2] = scale * red, scale * green, scale * blue


def _share_with_neighbors(
    radiance: Shaped[F32, "m 3"],
    rows: Shaped[NDArray[np.integer], " m"],
    image: ImagePoints,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "n 2 2 3"],
    lobe_width: np.float32,
) -> Shaped[F32, "n 3"]:
    """Average the radiance in lobes over neighbors whose mirror directions differ by less than the lobe, or a pixel.

    Args:
        radiance: of points with rays. rows: these points, at most one in each pixel.
        image, receivers, footprint: as in `lobe_radiance`. lobe_width: from `lobe_widths`.
    """
    row_of_pixel = np.full(image.size[0] * image.size[1], -1, np.int32)
    row_of_pixel[image.pixel[rows]] = np.arange(len(rows), dtype=np.int32)
    normal, wo = receivers.normal[rows], receivers.wo[rows]
    mirror = 2 * np.einsum("nc,nc->n", normal, wo)[:, None] * normal - wo
    traced = _Traced(row_of_pixel, receivers.points.position[rows], mirror, radiance)
    out = np.empty((len(image.pixel), 3), np.float32)
    args = traced, image.size, image.pixel, receivers.points, receivers.wo, footprint, lobe_width
    parallel_for_chunks(lambda start, stop: _share(*args, start, stop, out), len(out))
    return out


def lobe_radiance(
    scene: LobeScene,
    environment: PrefilteredEnvironment,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    lobe: TracedLobe,
    image: ImagePoints,
    rays_per_point: float,
    local_lights: Sequence[LobeLight],
    *,
    is_direct: bool,
) -> Shaped[F32, "n 3"]:
    """Return the mean radiance L̄ in the lobe of each point.

    Args:
        scene, environment, receivers, footprint, is_direct: as in `mean_lobe_radiance`. lobe: of all points.
        image: where the points are. rays_per_point: mean number that time allows.
        local_lights: as in `add_direct_lights`.
    """
    num_rays = int(np.clip(rays_per_point, 1, _MOST_RAYS))
    core, pattern = (make_lobe_pattern(sampling, num_rays, _SEED) for sampling in (lobe.core, lobe.sampling))
    lobe_width, light_args = lobe_widths(pattern)[0], (scene, environment)
    is_image = image.size[0] > 0
    share = max(rays_per_point, _LEAST_POINTS / max(image.num_pixels, 1)) if is_image else 1.0
    rows = np.flatnonzero(image.order < share)
    points, sides = (receivers.without_light(rows), footprint[rows]) if is_image else (receivers, footprint)
    radiance = mean_lobe_radiance(*light_args, points, sides, core, lobe.blur, is_direct=is_direct)
    if is_image:
        radiance = _share_with_neighbors(radiance, rows, image, receivers, footprint, lobe_width)
    if is_direct:
        add_direct_lights(*light_args, receivers, footprint, pattern, local_lights, radiance)
    if image.source is not None and len(scene.surfaces.normals):
        split = _split_points(scene, receivers, image, image.source, radiance)
        points = ShadingPoints(split.points, split.wo, np.empty((len(split.wo), 0), np.uint8))
        of_points = mean_lobe_radiance(*light_args, points, NO_FOOTPRINT, core, lobe.blur, is_direct=is_direct)
        if is_direct:
            add_direct_lights(*light_args, points, NO_FOOTPRINT, pattern, local_lights, of_points)
        split.average(of_points, radiance)
    return radiance


def _split_points(
    scene: LobeScene, receivers: ShadingPoints, image: ImagePoints, source: PixelSource, radiance: Shaped[F32, "n 3"]
) -> PixelPoints:
    """Return points all over the pixels in which reflections may vary most, with the rows that they are of.

    Args:
        scene, receivers, image: as in `lobe_radiance`. source: of `image`. radiance: L̄ of each.
    """
    rows, side = choose_splits(image.pixel, image.size, radiance, _SPLITS)
    geometry = with_normals(scene.geometry, scene.surfaces.normals)
    pixel = image.pixel[rows].astype(np.int64)
    pixel_args = pixel, side, receivers.tangent[rows], source.material
    found = points_in_pixels(geometry, source.camera, image.size, *pixel_args)
    return found._replace(sample=rows[found.sample])
