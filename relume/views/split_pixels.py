"""Highlights that vary within pixels: choice of the pixels, and points of the surface all over them.

A polished surface that is curved mirrors many directions within one pixel, and a sun may be smaller than that. The
radiance of such a pixel is the mean over its area A,

    L = 1/|A| ∫_A L_o(x, ω_o(x)) dA ,

which one point with a linear footprint misses where the surface bends or ends within the pixel.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.barycentric import FacePoints
from relume.raytrace.camera_rays import camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.shading_normals import flip_to_viewer
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import project_to_tangent
from relume.scene.model import Camera
from relume.transport.split_light import group_means

F32 = NDArray[np.float32]

_LEAST_CONTRAST = 3.0  # by the mean radiance
_SIDES = 8, 4  # points along each side of a pixel: with the strongest contrast, and with others


class SplitLimits(NamedTuple):
    """Largest numbers of samples that are split: with the strongest contrast, and others."""

    num_strong: int
    num_weak: int


class PixelPoints(NamedTuple):
    """Points all over the pixels of some samples.

    Attributes:
        sample: index of the sample of each point, ascending. points: with the samples' tangents. wo: view directions.
    """

    sample: Shaped[NDArray[np.intp], " points"]
    points: SurfacePoints
    wo: Shaped[F32, "points 3"]

    @property
    def first(self) -> Shaped[NDArray[np.intp], " samples"]:
        """Begin of the points of each sample that has any."""
        return np.flatnonzero(np.diff(self.sample, prepend=-1))

    def average(self, of_points: Shaped[F32, "points 3"], out: Shaped[F32, "n 3"]) -> None:
        """Replace values of samples by the mean over their points. out: of all samples"""
        first = self.first
        if len(first):
            out[self.sample[first]] = group_means(of_points, first, 0)


def choose_splits(
    pixel: Shaped[NDArray[np.integer], " n"],
    size: tuple[int, int],
    radiance: Shaped[F32, "n 3"],
    limits: SplitLimits,
) -> tuple[Shaped[NDArray[np.intp], " k"], Shaped[NDArray[np.intp], " k"]]:
    """Choose the samples whose radiance may vary most within a pixel, by its contrast to neighboring pixels.

    Args:
        pixel: of each sample of one material. size: of the image, pixels. radiance: of one term at each.
        limits: numbers of samples.
    Returns:
        Their rows, ascending; and the number of points along a side of the pixel of each.
    """
    value = radiance.sum(axis=1)
    extremes = np.full((size[1], size[0], 2), [-np.inf, np.inf], np.float32)
    contrast = np.empty(len(value), np.float32)
    _find_contrast(pixel, value, extremes, contrast)
    strong = np.flatnonzero(contrast > _LEAST_CONTRAST * value.mean(dtype=np.float64))
    strong = strong[np.argsort(-contrast[strong], kind="stable")][: limits.num_strong + limits.num_weak]
    order = np.argsort(strong)
    return strong[order], np.where(np.arange(len(strong)) < limits.num_strong, *_SIDES)[order]


@nb.njit(nogil=True, cache=True)
def _find_contrast(pixel, value, extremes, contrast):  # type: ignore[no-untyped-def]
    """Write the difference of the extremes of values in 3 × 3 pixels about each sample.

    Args:
        pixel, value: of each sample. extremes: largest and smallest value of each pixel, written. (height, width, 2)
    """
    height, width, _ = extremes.shape
    for p in range(pixel.shape[0]):
        cell = extremes[pixel[p] // width, pixel[p] % width]
        cell[0], cell[1] = max(cell[0], value[p]), min(cell[1], value[p])
    for p in range(pixel.shape[0]):
        y, x, high, low = pixel[p] // width, pixel[p] % width, value[p], value[p]
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                high, low = max(high, extremes[row, column, 0]), min(low, extremes[row, column, 1])
        contrast[p] = high - low


def with_normals(geometry: SceneBuffers, normals: Shaped[F32, "corners 3"]) -> SceneBuffers:
    """Return triangles with the normals of their corners, without tangents and textures: one zero for all corners."""
    tangents, uvs = (np.broadcast_to(np.float32(0), (len(normals), size)) for size in (4, 2))
    return replace(geometry, normals=normals, tangents=tangents, uvs=uvs)


def points_in_pixels(
    geometry: SceneBuffers,
    camera: Camera,
    size: tuple[int, int],
    pixel: Shaped[NDArray[np.int64], " k"],
    side: Shaped[NDArray[np.intp], " k"],
    tangent: Shaped[F32, "k 3"],
    material: int,
) -> PixelPoints:
    """Find the points where rays through pixels hit a material.

    Args:
        geometry: the triangles, with normals. camera: of the image. size: of the image, pixels.
        pixel: of each sample. side: number of rays along a side of each one's pixel. tangent: of each sample.
        material: of the samples.
    """
    sample = np.repeat(np.arange(len(pixel)), side**2)
    number = np.arange(len(sample)) - np.repeat(np.cumsum(side**2) - side**2, side**2)
    (y, x), (row, column), step = np.divmod(pixel, size[0]), np.divmod(number, side[sample]), 1 / side[sample]
    at_x, at_y = ((a[sample] + (b + 0.5) * step).astype(np.float32) for a, b in ((x, column), (y, row)))
    directions = camera_directions(camera, size, at_x, at_y)
    position, start = camera.to_world[:3, 3].astype(np.float32), near_distances(camera, directions)
    hits = trace_rays(geometry.embree, position, directions, start=start)
    found = np.flatnonzero((hits.face >= 0) & (geometry.face_material[np.maximum(hits.face, 0)] == material))
    directions = directions[found]
    face_points = FacePoints.from_hits(geometry, hits.rows(found), directions)
    normal = flip_to_viewer(face_points.normal, directions).astype(np.float32)
    seed = np.arange(len(found), dtype=np.uint32)
    tangents = project_to_tangent(tangent[sample[found]], normal)
    points = SurfacePoints(face_points.position.astype(np.float32), normal, tangents, seed)
    return PixelPoints(sample[found], points, np.negative(directions))
