"""Surfaces that show images which a look names in the place of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import Images
from relume.images.shelf import texture_of
from relume.moving.points.surface import MAX_TEXTURE_SIDE, Surface, Textures, stacked
from relume.scene.model import WRAPS
from relume.trace.surface import projected_axes

F32 = NDArray[np.float32]


class Dressed(NamedTuple):
    """What of a surface differs by such images: fields of `relume.moving.points.surface.Surface`."""

    textures: Textures
    uvs: F32
    uv_faces: NDArray[np.uint32]
    uv_scale: F32


def dressed(surface: Surface, positions: F32, images: Sequence[Images]) -> Dressed:
    """Put images onto a surface.

    Args:
        surface: as it was baked. positions: of the triangles' corners. (corners, 3) float32
        images: that a look names, of each material.
    Raises:
        NotFoundError, SceneError: an image cannot be had.
    """
    names = sorted({name for of_material in images for name in of_material if name is not None})
    shown = [texture_of(name) for name in names]
    before, added = surface.textures, stacked(shown, MAX_TEXTURE_SIDE)
    wraps = np.array([[WRAPS.index(wrap) for wrap in texture.wrap] for texture in shown], np.int64).reshape(-1, 2)
    of_material = before.of_material.copy()
    for material, of_channels in enumerate(images):
        for channel, name in enumerate(of_channels):
            if name is not None:
                of_material[material, channel] = len(before.wraps) + names.index(name)
    textures = Textures(
        np.concatenate([before.texels, added.texels]),
        np.concatenate([before.levels, added.levels + np.array([len(before.texels), 0, 0])]),
        np.concatenate([before.first, before.first[-1] + added.first[1:]]),
        np.concatenate([before.wraps, wraps]),
        of_material,
    )
    has_images = np.array([any(of_channels) for of_channels in images])
    return Dressed(textures, *_projected(surface, positions, has_images))


def _projected(surface: Surface, positions: F32, has_images: NDArray[np.bool_]) -> tuple[F32, NDArray[np.uint32], F32]:
    """Give triangles a place in textures that have none: along the axis of the world that they face most, in metres.

    Returns:
        Fields `uvs`, `uv_faces` and `uv_scale` of the surface.
    """
    flat = np.flatnonzero((surface.uv_scale == 0) & has_images[surface.face_material])
    if not len(flat):
        return surface.uvs, surface.uv_faces, surface.uv_scale
    across, up = projected_axes(surface.face_normal[flat])
    corners = positions[surface.faces[flat]]
    u, v = np.einsum("fkc,fc->fk", corners, across), -np.einsum("fkc,fc->fk", corners, up)
    uvs = np.concatenate([surface.uvs, np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)])
    uv_faces, uv_scale = surface.uv_faces.copy(), surface.uv_scale.copy()
    uv_faces[flat] = len(surface.uvs) + np.arange(3 * len(flat), dtype=np.uint32).reshape(-1, 3)
    uv_scale[flat] = 1
    return uvs, uv_faces, uv_scale
