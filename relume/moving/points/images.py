"""Surfaces that wear images which a look names in the place of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import Images, NormalMap
from relume.images.shelf import normals_of, texture_of
from relume.moving.points.surface import MAX_TEXTURE_SIDE, Surface, Textures, stacked
from relume.scene.model import WRAPS, Texture
from relume.trace.surface import projected_axes

F32 = NDArray[np.float32]


class Wears(NamedTuple):
    """What a look names in the place of a material's images: of each of `TEXTURES`, and of its normal map; None for
    its own."""

    images: Images = (None, None)
    normals: NormalMap | None = None

    @property
    def columns(self) -> tuple[str | NormalMap | None, ...]:
        """The same as columns of `Textures.of_material`."""
        return *self.images, self.normals


OWN = Wears()


class Dressed(NamedTuple):
    """What of a surface differs by such images: fields of `relume.moving.points.surface.Surface`."""

    textures: Textures
    uvs: F32
    uv_faces: NDArray[np.uint32]
    uv_scale: F32
    tangents: F32


def dressed(surface: Surface, positions: F32, wears: Sequence[Wears]) -> Dressed:
    """Put images onto a surface.

    Args:
        surface: as it was baked. positions: of the triangles' corners. (corners, 3) float32
        wears: what a look names, of each material.
    Raises:
        NotFoundError, SceneError: an image cannot be had.
    """
    names = list(dict.fromkeys(name for of in wears for name in of.columns if name is not None))
    shown = list(map(_texture_of, names))
    before, added = surface.textures, stacked(shown, MAX_TEXTURE_SIDE)
    wraps = np.array([[WRAPS.index(wrap) for wrap in texture.wrap] for texture in shown], np.int64).reshape(-1, 2)
    of_material = before.of_material.copy()
    for material, of in enumerate(wears):
        for column, name in enumerate(of.columns):
            if name is not None:
                of_material[material, column] = len(before.wraps) + names.index(name)
    textures = Textures(
        np.concatenate([before.texels, added.texels]),
        np.concatenate([before.levels, added.levels + np.array([len(before.texels), 0, 0])]),
        np.concatenate([before.first, before.first[-1] + added.first[1:]]),
        np.concatenate([before.wraps, wraps]),
        of_material,
    )
    uvs, uv_faces, uv_scale = _projected(surface, positions, np.array([of != OWN for of in wears]))
    has_bumps = np.array([of.normals is not None for of in wears])
    return Dressed(textures, uvs, uv_faces, uv_scale, _tangents(surface, positions, uvs[uv_faces], has_bumps))


def _texture_of(name: str | NormalMap) -> Texture:
    return normals_of(name) if isinstance(name, NormalMap) else texture_of(name)


def _tangents(surface: Surface, positions: F32, places: F32, has_bumps: NDArray[np.bool_]) -> F32:
    """Give corners tangents that have none: along u, averaged over the triangles about each, the larger ones more.

    Args:
        places: in textures, of each triangle's corners. (faces, 3, 2) has_bumps: which materials need them.
    """
    if not has_bumps.any():
        return surface.tangents
    out = surface.tangents.copy() if len(surface.tangents) else np.zeros((len(positions), 4), np.float32)
    chosen = has_bumps[surface.face_material]
    chosen &= ~out[surface.faces].any(axis=(1, 2))
    faces = surface.faces[chosen]
    p, uv = positions[faces].astype(np.float64), places[chosen].astype(np.float64)
    e, d = p[:, 1:] - p[:, :1], uv[:, 1:] - uv[:, :1]
    area = d[:, 0, 0] * d[:, 1, 1] - d[:, 1, 0] * d[:, 0, 1]
    along = np.sign(area)[:, None] * (e[:, 0] * d[:, 1, 1:] - e[:, 1] * d[:, 0, 1:])
    of_face = np.column_stack([along, -np.sign(area) * np.linalg.norm(np.cross(e[:, 0], e[:, 1]), axis=1)])
    corners = faces.ravel()
    total = np.stack([np.bincount(corners, np.repeat(c, 3), len(out)) for c in of_face.T], axis=1)
    length = np.linalg.norm(total[:, :3], axis=1)
    given = np.flatnonzero(length > 0)
    out[given, :3] = total[given, :3] / length[given, None]
    out[given, 3] = np.where(total[given, 3] < 0, -1, 1)
    return out


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
