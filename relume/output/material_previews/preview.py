"""A ball of one material in the studio: thumbnails, lit by the machinery that lights pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import png_bytes, to_bytes
from relume.lights.spherical_triangles import TriangleLights, tessellate_environment
from relume.live.fixed_camera.target import TargetTerm
from relume.operators.shade import shade
from relume.raytrace.surface_points import SurfacePoints
from relume.scene.model import Texture
from relume.scene.texture_encoding import decode
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

THUMBNAIL_SIZE = 64
_EXPOSURE = 1.0
_NUM_LIGHTS = 200
_SUPERSAMPLING = 2  # samples a pixel, along each side
_MAX_SIDE_TEXELS = 512  # a side that are read of an image
_BLURRED_SIDE_TEXELS = 32  # a side that it is blurred to
NO_IMAGES: Mapping[str, Texture] = MappingProxyType({})
_BACKGROUND_RADIANCE = 0.05  # radiance around the ball
_PIXEL = 2 / (_SUPERSAMPLING * THUMBNAIL_SIZE)  # side of one on the texture, a half turn being one
_TO_CAMERA = np.array([0.0, 0.0, 1.0], np.float32)


@cache
def _lights() -> TriangleLights:
    return tessellate_environment(studio().radiance, _NUM_LIGHTS)


def render_preview(documents: Sequence[Mapping[str, Any]], size: int, images: Mapping[str, Texture] = NO_IMAGES) -> F32:
    """Render a ball seen from far away; nothing but itself is there to cast a shadow.

    Args:
        documents: complete terms; roughness is the same everywhere.
        size: width and height in pixels.
        images: that terms name as their texture; others show none.
    Returns:
        Linear radiance. (size, size, 3) float32
    """
    num_samples = _SUPERSAMPLING * size
    across = (np.arange(num_samples) + 0.5) / num_samples * 2.1 - 1.05
    x, y = np.meshgrid(across, -across)
    inside = x**2 + y**2 < 1.0
    supersampled = np.full((num_samples, num_samples, 3), _BACKGROUND_RADIANCE)
    supersampled[inside] = _shade(documents, _shading_points(x[inside], y[inside]), images)
    return np.asarray(supersampled.reshape(size, _SUPERSAMPLING, size, _SUPERSAMPLING, 3).mean(axis=(1, 3)), np.float32)


def preview_pixels(
    documents: Sequence[Mapping[str, Any]], images: Mapping[str, Texture] = NO_IMAGES
) -> NDArray[np.uint8]:
    """A ball as displayed. (THUMBNAIL_SIZE, THUMBNAIL_SIZE, 3)"""
    return to_bytes(tone_map(render_preview(documents, THUMBNAIL_SIZE, images), _EXPOSURE, "agx"))


def preview_png(documents: Sequence[Mapping[str, Any]], images: Mapping[str, Texture] = NO_IMAGES) -> bytes:
    """The same as a PNG."""
    return png_bytes(preview_pixels(documents, images))


def _shading_points(x: NDArray[np.float64], y: NDArray[np.float64]) -> ShadingPoints:
    """Points of the unit sphere that face +Z; tangents run around the vertical axis."""
    normal = np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1).astype(np.float32)
    tangent = np.stack([normal[:, 2], np.zeros(len(x), np.float32), -normal[:, 0]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    visible = np.packbits(normal @ _lights().direction.T > 0, axis=1, bitorder="little")
    points = SurfacePoints(normal, normal, tangent, np.arange(len(x), dtype=np.uint32))
    # a texture goes round it four times, and is seen the right way up
    azimuth, elevation = 2 * np.arctan2(x, normal[:, 2]) / np.pi, 2 * np.arcsin(y) / np.pi
    uv = np.stack([azimuth, -elevation, np.full(len(x), _PIXEL), np.zeros(len(x)), np.ones(len(x))], axis=1)
    return ShadingPoints(points, np.tile(_TO_CAMERA, (len(x), 1)), visible, uv=uv.astype(np.float32))


def _shade(
    documents: Sequence[Mapping[str, Any]], shading_points: ShadingPoints, images: Mapping[str, Texture]
) -> NDArray[np.float64]:
    """Sum of the terms. (n, 3)"""
    num = len(shading_points.normal)
    radiance = np.zeros((num, 3))
    for given in documents:
        document = {**given, "texture": None, "roughness_map": None}
        target = TargetTerm.from_document(document, lambda: np.arccos(shading_points.normal[:, 2].astype(np.float64)))
        shaded_term = shade(target.term, target.bands, _lights(), shading_points, lambda share: None, lambda: False)
        rows = shaded_term.rows(num) * np.asarray(document["color"])
        image = images.get(given["texture"]) if given["texture"] is not None else None
        if image is not None:
            rows = rows * _sample_image(image, np.asarray(shading_points.uv))
        radiance += rows if target.view_factor is None else rows * target.view_factor.T
    return radiance


def _sample_image(image: Texture, uv: F32) -> F32:
    """The values of an image on a ball, which it goes round as BTFs do; blurred, as a ball is small. (n, 3)

    Args:
        uv: places in it, in the first two columns. (n, 2 or more)
    """
    step = -(-max(image.pixels.shape[:2]) // _MAX_SIDE_TEXELS)
    values = decode(image.pixels[::step, ::step], image.encoding)
    blocks = -(-max(values.shape[:2]) // _BLURRED_SIDE_TEXELS)
    height, width = (max(1, side // blocks) for side in values.shape[:2])
    cropped = values[: height * blocks, : width * blocks]
    blurred = cropped.reshape(height, len(cropped) // height, width, cropped.shape[1] // width, 3)
    u, v = (np.asarray(uv[:, k], np.float64) % 1.0 for k in range(2))
    column, row = (u * width).astype(int) % width, (v * height).astype(int) % height
    return np.asarray(blurred.mean(axis=(1, 3))[row, column], np.float32)
