"""Preview of a material: a sphere in the studio environment, lit by the same code as views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import png_bytes, to_bytes
from relume.lights.spherical_triangles import TriangleLights, tessellate_environment
from relume.live.fixed_camera.target import TargetTerm
from relume.operators.shade import shade
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import above_horizon
from relume.scene.model import Texture
from relume.scene.texture_encoding import decode
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

THUMBNAIL_SIZE = 64
_EXPOSURE = 1.0
_NUM_LIGHTS = 200
_SUPERSAMPLING = 2  # samples per pixel, along each side
_MAX_SIDE_TEXELS = 512  # maximum side of an image that is read; larger ones are subsampled
_BLURRED_SIDE_TEXELS = 32  # maximum side after blurring
NO_IMAGES: Mapping[str, Texture] = MappingProxyType({})
_BACKGROUND_RADIANCE = 0.05  # around the sphere
_PIXEL = 2 / (_SUPERSAMPLING * THUMBNAIL_SIZE)  # side of a sample in UV space, where one is half a turn
_TO_CAMERA = np.array([0.0, 0.0, 1.0], np.float32)


@cache
def _lights() -> TriangleLights:
    return tessellate_environment(studio().radiance, _NUM_LIGHTS)


def render_preview(
    documents: Sequence[Mapping[str, Any]], size: int, images: Mapping[str, Texture] = NO_IMAGES
) -> Shaped[F32, "size size 3"]:
    """Render the linear radiance of a sphere from far away; it only shadows itself.

    Args:
        documents: complete terms; roughness maps are ignored.
        size: width and height in pixels.
        images: textures by their names in terms; terms with other textures show none.
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
) -> Shaped[NDArray[np.uint8], "size size 3"]:
    """Render a preview of `THUMBNAIL_SIZE` as display values."""
    return to_bytes(tone_map(render_preview(documents, THUMBNAIL_SIZE, images), _EXPOSURE, "agx"))


def preview_png(documents: Sequence[Mapping[str, Any]], images: Mapping[str, Texture] = NO_IMAGES) -> bytes:
    """Render a preview as a PNG."""
    return png_bytes(preview_pixels(documents, images))


def _shading_points(x: NDArray[np.float64], y: NDArray[np.float64]) -> ShadingPoints:
    """Points of the unit sphere that face +Z; tangents run around the vertical axis."""
    normal = np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1).astype(np.float32)
    tangent = np.stack([normal[:, 2], np.zeros(len(x), np.float32), -normal[:, 0]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    visible = above_horizon(normal, _lights().direction)
    points = SurfacePoints(normal, normal, tangent, np.arange(len(x), dtype=np.uint32))
    # a texture repeats four times around the sphere, upright
    azimuth, elevation = 2 * np.arctan2(x, normal[:, 2]) / np.pi, 2 * np.arcsin(y) / np.pi
    columns = azimuth, -elevation, np.full(len(x), _PIXEL), np.zeros(len(x)), np.ones(len(x))
    uv = np.stack(columns, axis=1).astype(np.float32)
    return ShadingPoints(points, np.tile(_TO_CAMERA, (len(x), 1)), visible, read_uv=lambda: uv)


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
    """Values of an image on the sphere, mapped like BTFs; blurred, because previews are small. (n, 3)

    Args:
        uv: texture coordinates in the first two columns. (n, 2 or more)
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
