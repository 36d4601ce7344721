"""A ball of one material in the studio: thumbnails, lit by the machinery that lights pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.environments.studio import studio
from relume.imageio.files import png_bytes, to_bytes
from relume.imageio.tonemap import tone_map
from relume.light.triangles import TriangleLights, subdivide
from relume.operators.shade import shade
from relume.picture.wanted import Wanted
from relume.points import Points
from relume.project.receivers import Receivers
from relume.scene.coding import decode
from relume.scene.model import Texture

F32 = NDArray[np.float32]

THUMBNAIL_SIZE = 64
_EXPOSURE = 1.0
_NUM_LIGHTS = 200
_FINER = 2  # samples a pixel, along each side
_MOST_TEXELS = 512  # a side that are read of an image
_FEWEST_TEXELS = 32  # a side that it is blurred to
NO_IMAGES: Mapping[str, Texture] = MappingProxyType({})
_BEHIND = 0.05  # radiance around the ball
_PIXEL = 2 / (_FINER * THUMBNAIL_SIZE)  # side of one on the texture, a half turn being one
_TO_CAMERA = np.array([0.0, 0.0, 1.0], np.float32)


@cache
def _lights() -> TriangleLights:
    return subdivide(studio().radiance, _NUM_LIGHTS)


def ball_image(documents: Sequence[Mapping[str, Any]], size: int, images: Mapping[str, Texture] = NO_IMAGES) -> F32:
    """Render a ball seen from far away; nothing but itself is there to cast a shadow.

    Args:
        documents: complete terms; roughness is the same everywhere.
        size: width and height in pixels.
        images: that terms name as their texture; others show none.
    Returns:
        Linear radiance. (size, size, 3) float32
    """
    finer = _FINER * size
    across = (np.arange(finer) + 0.5) / finer * 2.1 - 1.05
    x, y = np.meshgrid(across, -across)
    inside = x**2 + y**2 < 1.0
    picture = np.full((finer, finer, 3), _BEHIND)
    picture[inside] = _shaded(documents, _receivers(x[inside], y[inside]), images)
    return np.asarray(picture.reshape(size, _FINER, size, _FINER, 3).mean(axis=(1, 3)), np.float32)


def ball_pixels(
    documents: Sequence[Mapping[str, Any]], images: Mapping[str, Texture] = NO_IMAGES
) -> NDArray[np.uint8]:
    """A ball as displayed. (THUMBNAIL_SIZE, THUMBNAIL_SIZE, 3)"""
    return to_bytes(tone_map(ball_image(documents, THUMBNAIL_SIZE, images), _EXPOSURE, "agx"))


def ball_png(documents: Sequence[Mapping[str, Any]], images: Mapping[str, Texture] = NO_IMAGES) -> bytes:
    """The same as a PNG."""
    return png_bytes(ball_pixels(documents, images))


def _receivers(x: NDArray[np.float64], y: NDArray[np.float64]) -> Receivers:
    """Points of the unit sphere that face +Z; tangents run around the vertical axis."""
    normal = np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=-1).astype(np.float32)
    tangent = np.stack([normal[:, 2], np.zeros(len(x), np.float32), -normal[:, 0]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    visible = np.packbits(normal @ _lights().direction.T > 0, axis=1, bitorder="little")
    points = Points(normal, normal, tangent, np.arange(len(x), dtype=np.uint32))
    # a texture goes round it four times, and is seen the right way up
    around, up = 2 * np.arctan2(x, normal[:, 2]) / np.pi, 2 * np.arcsin(y) / np.pi
    uv = np.stack([around, -up, np.full(len(x), _PIXEL), np.zeros(len(x)), np.ones(len(x))], axis=1)
    return Receivers(points, np.tile(_TO_CAMERA, (len(x), 1)), visible, uv=uv.astype(np.float32))


def _shaded(
    documents: Sequence[Mapping[str, Any]], receivers: Receivers, images: Mapping[str, Texture]
) -> NDArray[np.float64]:
    """Sum of the terms. (n, 3)"""
    num = len(receivers.normal)
    radiance = np.zeros((num, 3))
    for named in documents:
        document = {**named, "texture": None, "roughness_map": False}
        wanted = Wanted.of(document, lambda: np.arccos(receivers.normal[:, 2].astype(np.float64)))
        shaded = shade(wanted.term, wanted.bands, _lights(), receivers, lambda share: None, lambda: False)
        rows = shaded.rows(num) * np.asarray(document["color"])
        image = images.get(named["texture"]) if named["texture"] is not None else None
        if image is not None:
            rows = rows * _looked_up(image, np.asarray(receivers.uv))
        radiance += rows if wanted.outgoing is None else rows * wanted.outgoing.T
    return radiance


def _looked_up(image: Texture, uv: F32) -> F32:
    """The values of an image on a ball, which it goes round as BTFs do; blurred, as a ball is small. (n, 3)

    Args:
        uv: places in it, in the first two columns. (n, 2 or more)
    """
    step = -(-max(image.pixels.shape[:2]) // _MOST_TEXELS)
    values = decode(image.pixels[::step, ::step], image.coding)
    blocks = -(-max(values.shape[:2]) // _FEWEST_TEXELS)
    height, width = (max(1, side // blocks) for side in values.shape[:2])
    whole = values[: height * blocks, : width * blocks]
    blurred = whole.reshape(height, len(whole) // height, width, whole.shape[1] // width, 3)
    u, v = (np.asarray(uv[:, k], np.float64) % 1.0 for k in range(2))
    column, row = (u * width).astype(int) % width, (v * height).astype(int) % height
    return np.asarray(blurred.mean(axis=(1, 3))[row, column], np.float32)
