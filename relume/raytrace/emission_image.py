"""Surfaces that emit by an image of a look: L(x) = emission · image(x).

A light has one color and pieces of different brightness. So its triangles are divided until pieces follow the image,
and a colored image makes three lights, one for each channel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.raytrace.surface_interaction import triplanar_uvs
from relume.raytrace.texture import sample_image
from relume.scene.model import Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAX_PIECES = 4096  # if there are fewer triangles than that
_MIN_MEAN = 1e-12
_MAX_CHROMA = 0.02  # mean difference of channels, each over its mean, below which one light is enough


class ImageEmitter(NamedTuple):
    """Pieces of a surface that emits an image.

    Attributes:
        corners: corners of the pieces, meters. radiance: mean of the image over each, linear RGB.
        mean: mean of the image over the surface. is_colored: its color varies.
    """

    corners: Shaped[F32, "T 3 3"]
    radiance: Shaped[F32, "T 3"]
    mean: tuple[float, float, float]
    is_colored: bool

    def relative_radiance(self, channel: int | None) -> Shaped[F32, " T"]:
        """Return the radiance of each piece over the mean, of a channel or, for None, of luminance."""
        weights = np.array(LUMINANCE) if channel is None else np.eye(3)[channel]
        radiance, mean = (np.asarray(rgb, np.float64) @ weights for rgb in (self.radiance, self.mean))
        return np.asarray(radiance / max(float(mean), _MIN_MEAN), np.float32)


def image_emitter(
    texture: Texture, corners: Shaped[F32, "triangles 3 3"], uvs: Shaped[F32, "triangles 3 2"]
) -> ImageEmitter:
    """Divide triangles into pieces and average an image over each.

    Args:
        texture: the image. corners: corners of the triangles, meters.
        uvs: their texture coordinates; triangles without area in them use tri-planar mapping.
    """
    weights = _division(math.isqrt(_MAX_PIECES // max(len(corners), 1)))
    pieces, piece_uvs = (_divide(values, weights) for values in (corners, mapped_uvs(corners, uvs)))
    (du_0, dv_0), (du_1, dv_1) = ((piece_uvs[:, k] - piece_uvs[:, 0]).T for k in (1, 2))
    footprint = np.sqrt(np.abs(du_0 * dv_1 - dv_0 * du_1) / 2)
    radiance = sample_image(texture, np.column_stack([piece_uvs.mean(axis=1), footprint]).astype(np.float32))
    areas = np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1).astype(
        np.float64
    )
    mean = areas @ radiance / max(float(areas.sum()), 1e-30)
    red, green, blue = mean.tolist()
    return ImageEmitter(pieces, radiance, (red, green, blue), is_colored(radiance, mean, areas))


def is_colored(radiance: Shaped[F32, "n 3"], mean: Shaped[F64, " 3"], weight: Shaped[F64, " n"]) -> bool:
    """True if the color of an image varies. mean: of its radiance, by weight; weight: such as areas."""
    relative = radiance / np.maximum(mean, _MIN_MEAN)
    chroma = np.ptp(relative[:, mean > _MIN_MEAN], axis=1) if (mean > _MIN_MEAN).any() else np.zeros(len(weight))
    return bool(weight @ chroma > _MAX_CHROMA * weight.sum())


def mapped_uvs(
    corners: Shaped[F32, "triangles 3 3"], uvs: Shaped[F32, "triangles 3 2"]
) -> Shaped[F32, "triangles 3 2"]:
    """Return texture coordinates of corners; those of tri-planar mapping for triangles without area in UV space."""
    (du_0, dv_0), (du_1, dv_1) = ((uvs[:, k] - uvs[:, 0]).T for k in (1, 2))
    is_flat = (du_0 * dv_1 == dv_0 * du_1)[:, None, None]
    face_normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.where(is_flat, triplanar_uvs(corners, face_normal), uvs).astype(np.float32)


def _division(n: int) -> Shaped[F32, "pieces 3 3"]:
    """Barycentric coordinates of the corners of n² equal pieces of a triangle; one piece for n = 0."""
    steps = max(n, 1)
    upright = [[(i, j), (i + 1, j), (i, j + 1)] for i in range(steps) for j in range(steps - i)]
    inverted = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i in range(steps) for j in range(steps - i - 1)]
    xy = np.array(upright + inverted, np.float32) / steps
    return np.concatenate([1 - xy.sum(axis=2, keepdims=True), xy], axis=2)


def _divide(values: Shaped[F32, "triangles 3 c"], weights: Shaped[F32, "pieces 3 3"]) -> Shaped[F32, "all_pieces 3 c"]:
    """Interpolate values at triangles' corners to the corners of their pieces."""
    pieces = np.einsum("pkl,tlc->tpkc", weights, values)
    return np.asarray(pieces.reshape(-1, 3, values.shape[2]), np.float32)
