"""Which pixels show a highlight that varies within them, and the points of the surface there.

A polished surface that is curved mirrors many directions within one pixel, and a sun may be smaller than that. The
radiance of such a pixel is the mean over its area A,

    L = 1/|A| ∫_A L_o(x, ω_o(x)) dA ,

which one point with a linear footprint misses where the surface bends or ends within the pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from relume.raytrace.barycentric import FacePoints
from relume.raytrace.camera_rays import camera_directions, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.shading_normals import flip_to_viewer
from relume.raytrace.surface_points import SurfacePoints
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_REACH = 3  # pixels across, within which the contrast is found
_LEAST_CONTRAST = 3.0  # by the mean radiance
_SIDES = 8, 4  # points along each side of a pixel: with the strongest contrast, and with others
_MAX_STRONG, _MAX_WEAK = 1024, 3072  # samples: 114,688 points


class PixelPoints(NamedTuple):
    """Points all over the pixels of some samples.

    Attributes:
        sample: index of the sample of each point, ascending. points: their tangents are zero. wo: view directions.
    """

    sample: Shaped[NDArray[np.intp], " points"]
    points: SurfacePoints
    wo: Shaped[F32, "points 3"]


def choose_splits(
    pixel: Shaped[NDArray[np.integer], " n"], size: tuple[int, int], radiance: Shaped[F32, "n 3"]
) -> tuple[Shaped[NDArray[np.intp], " k"], Shaped[NDArray[np.intp], " k"]]:
    """Choose the samples whose radiance may vary most within a pixel, by its contrast to pixels nearby.

    Args:
        pixel: of each sample of one material. size: of the image, pixels. radiance: of one term at each.
    Returns:
        Their rows, ascending; and the number of points along a side of the pixel of each.
    """
    value = radiance.sum(axis=1)
    brightest, darkest = (np.full(size[0] * size[1], limit, np.float32) for limit in (-np.inf, np.inf))
    np.maximum.at(brightest, pixel, value)
    np.minimum.at(darkest, pixel, value)
    high, low = (
        extreme(values.reshape(size[::-1]), _REACH, mode="nearest").ravel()[pixel]
        for extreme, values in ((maximum_filter, brightest), (minimum_filter, darkest))
    )
    contrast = high - low
    strong = np.flatnonzero(contrast > _LEAST_CONTRAST * value.mean(dtype=np.float64))
    strong = strong[np.argsort(-contrast[strong], kind="stable")][: _MAX_STRONG + _MAX_WEAK]
    order = np.argsort(strong)
    return strong[order], np.where(np.arange(len(strong)) < _MAX_STRONG, *_SIDES)[order]


def points_in_pixels(
    geometry: SceneBuffers,
    camera: Camera,
    size: tuple[int, int],
    pixel: Shaped[NDArray[np.int64], " k"],
    side: Shaped[NDArray[np.intp], " k"],
    material: int,
) -> PixelPoints:
    """Find the points where rays through pixels hit a material.

    Args:
        geometry: the triangles, with normals. camera: of the image. size: of the image, pixels.
        pixel: of each sample. side: number of rays along a side of each one's pixel. material: of the samples.
    """
    sample = np.repeat(np.arange(len(pixel)), side**2)
    number = np.arange(len(sample)) - np.repeat(np.cumsum(side**2) - side**2, side**2)
    (y, x), (row, column), step = np.divmod(pixel, size[0]), np.divmod(number, side[sample]), 1 / side[sample]
    at_x, at_y = ((a[sample] + (b + 0.5) * step).astype(np.float32) for a, b in ((x, column), (y, row)))
    directions = camera_directions(camera, size, at_x, at_y)
    hits = trace_rays(geometry.embree, camera.to_world[:3, 3].astype(np.float32), directions)
    found = np.flatnonzero((hits.face >= 0) & (geometry.face_material[np.maximum(hits.face, 0)] == material))
    directions = directions[found]
    face_points = FacePoints.from_hits(geometry, hits.rows(found), directions)
    normal = flip_to_viewer(face_points.normal, directions).astype(np.float32)
    seed = np.arange(len(found), dtype=np.uint32)
    points = SurfacePoints(face_points.position.astype(np.float32), normal, np.zeros_like(normal), seed)
    return PixelPoints(sample[found], points, np.negative(directions))
