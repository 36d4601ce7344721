"""Textures of a scene as a store has them, and the texture coordinates of its triangles, for lookups at ray hits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES, EmissionImage, NormalMap
from relume.core.errors import ChunkDamagedError, StoreError
from relume.images.image_store import load_emission_image, load_normal_map, load_texture
from relume.math.uv_transform import UvTransform
from relume.raytrace.surface_interaction import triplanar_uvs
from relume.raytrace.texture import MipMap
from relume.raytrace.texture_arrays import MAX_TEXTURE_SIDE, level_index
from relume.scene.model import WRAPS, Texture
from relume.store.bake_protocol import StoreReader

F32 = NDArray[np.float32]

NORMAL_MAP, EMISSION = len(TEXTURES), len(TEXTURES) + 1  # their columns in `Textures.of_material`


class Textures(NamedTuple):
    """All textures with their mip levels, concatenated.

    Attributes:
        levels: first texel, height and width of each level, finest first. first: first level of each texture; one more
            at the end. wraps: wraps of u and v: repeat, mirror, clamp.
        material_textures: texture of each material in each of `TEXTURES`, its normal map, its emission image; −1 for
            none.
    """

    texels: Shaped[F32, "texels 3"]
    levels: Shaped[NDArray[np.int64], "levels 3"]
    first: Shaped[NDArray[np.int64], " textures_and_end"]
    wraps: Shaped[NDArray[np.int64], "textures 2"]
    material_textures: Shaped[NDArray[np.int64], "materials 4"]


def read_textures(store: StoreReader) -> Textures:
    """Read the textures of a store.

    Raises:
        StoreError: it does not describe them. ChunkDamagedError: its description does not match.
    """
    try:
        channel_textures = np.array(store.attributes["textures"], np.int64).reshape(-1, len(TEXTURES))
        # absent in older stores
        emission_textures = store.attributes.get("emission_images", [-1] * len(channel_textures))
        material_textures = np.column_stack(
            [channel_textures, np.array([store.attributes["normal_maps"], emission_textures], np.int64).T]
        )
        wraps = np.array(store.attributes["wraps"], np.int64).reshape(-1, 2)
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"the store does not describe its textures ({error}); bake the scene again") from error
    if material_textures.size and not -1 <= material_textures.min() <= material_textures.max() < len(wraps):
        raise ChunkDamagedError("textures", "a material has a texture that the store has not")
    textures = (Texture(store.read(f"textures/{k}").astype(np.float32)) for k in range(len(wraps)))
    return Textures(*concatenate_textures(textures), wraps, material_textures)


class ConcatenatedTextures(NamedTuple):
    """Mip levels of textures, concatenated as in `Textures`."""

    texels: F32
    levels: NDArray[np.int64]
    first: NDArray[np.int64]


def concatenate_textures(textures: Iterable[Texture], max_side: int = MAX_TEXTURE_SIDE) -> ConcatenatedTextures:
    """Concatenate textures with their mip levels.

    Args:
        textures: in order. max_side: texels; levels that are wider or higher are omitted.
    """
    texels, levels, first, end = [np.empty((0, 3), np.float32)], [], [0], 0
    for texture in textures:
        pyramid = MipMap.for_texture(texture)
        for level in map(pyramid.level, range(level_index(pyramid, max_side), len(pyramid.levels))):
            levels.append((end, *level.shape[:2]))
            texels.append(level.reshape(-1, 3))
            end += len(texels[-1])
        first.append(len(levels))
    return ConcatenatedTextures(
        np.concatenate(texels), np.array(levels, np.int64).reshape(-1, 3), np.array(first, np.int64)
    )


MapName = str | NormalMap | EmissionImage
"""Of an image in a look."""


def _load_texture(name: MapName) -> Texture:
    if isinstance(name, EmissionImage):
        return load_emission_image(name)
    return load_normal_map(name) if isinstance(name, NormalMap) else load_texture(name)


def replace_textures(textures: Textures, names: Sequence[Sequence[MapName | None]]) -> Textures:
    """Replace textures of materials by those of a look.

    Args:
        textures: as baked. names: for each material, of the first columns of `material_textures`; None keeps one.
    Raises:
        NotFoundError, SceneError: an image cannot be loaded.
    """
    distinct = list(dict.fromkeys(name for row in names for name in row if name is not None))
    if not distinct:
        return textures
    loaded = list(map(_load_texture, distinct))
    added = concatenate_textures(loaded, MAX_TEXTURE_SIDE)
    wraps = [[WRAPS.index(wrap) for wrap in texture.wrap] for texture in loaded]
    material_textures = textures.material_textures.copy()
    for material, row in enumerate(names):
        for column, name in enumerate(row):
            if name is not None:
                material_textures[material, column] = len(textures.wraps) + distinct.index(name)
    return Textures(
        np.concatenate([textures.texels, added.texels]),
        np.concatenate([textures.levels, added.levels + np.array([len(textures.texels), 0, 0])]),
        np.concatenate([textures.first, textures.first[-1] + added.first[1:]]),
        np.concatenate([textures.wraps, np.array(wraps, np.int64)]),
        material_textures,
    )


class TextureCoordinates(NamedTuple):
    """Texture coordinates of triangles.

    Attributes:
        uvs: of corners. faces: indices of the corners. scale: texture units per meter, zero without coordinates.
    """

    uvs: Shaped[F32, "corners 2"]
    faces: Shaped[NDArray[np.uint32], "faces 3"]
    scale: Shaped[F32, " faces"]


def texture_coordinates(
    uvs: Shaped[F32, "corners 2"], positions: Shaped[F32, "corners 3"], faces: Shaped[NDArray[np.uint32], "faces 3"]
) -> TextureCoordinates:
    """Return the texture coordinates of triangles.

    Args:
        uvs, positions: of the corners. faces: indices of the triangles' corners.
    """
    a, b, c = positions[faces].transpose(1, 0, 2)
    twice_area = np.maximum(np.linalg.norm(np.cross(b - a, c - a), axis=1), 1e-20)
    (du_0, dv_0), (du_1, dv_1) = (uvs[faces][:, k].T - uvs[faces][:, 0].T for k in (1, 2))
    scale = np.sqrt(np.abs(du_0 * dv_1 - dv_0 * du_1) / twice_area)
    return TextureCoordinates(uvs, faces, scale.astype(np.float32))


def project_missing(
    coordinates: TextureCoordinates,
    positions: Shaped[F32, "corners 3"],
    corners: Shaped[NDArray[np.uint32], "faces 3"],
    face_normal: Shaped[F32, "faces 3"],
    is_needed: Shaped[NDArray[np.bool_], " faces"],
) -> TextureCoordinates:
    """Compute missing texture coordinates by tri-planar projection, one texture unit per meter.

    Args:
        coordinates: as baked. positions: of the corners. corners: of the triangles. face_normal: unit.
        is_needed: True for triangles that have a texture.
    """
    flat = np.flatnonzero((coordinates.scale == 0) & is_needed)
    if not len(flat):
        return coordinates
    projected = triplanar_uvs(positions[corners[flat]], face_normal[flat])
    uvs = np.concatenate([coordinates.uvs, projected.reshape(-1, 2)])
    faces, scale = coordinates.faces.copy(), coordinates.scale.copy()
    faces[flat] = len(coordinates.uvs) + np.arange(3 * len(flat), dtype=np.uint32).reshape(-1, 3)
    scale[flat] = 1
    return TextureCoordinates(uvs, faces, scale)


def transform_coordinates(
    coordinates: TextureCoordinates,
    face_material: Shaped[NDArray[np.integer], " faces"],
    transforms: Sequence[UvTransform | None],
) -> TextureCoordinates:
    """Transform the texture coordinates of triangles.

    Args:
        coordinates: of all triangles. face_material: their materials. transforms: of each material, None for none.
    """
    uvs, faces, scale = coordinates
    for material, transform in enumerate(transforms):
        moved = np.flatnonzero(face_material == material)
        if transform is None or not len(moved):
            continue
        corners, index = np.unique(faces[moved], return_inverse=True)  # other materials may share corners
        faces, scale = faces.copy(), scale.copy()
        faces[moved] = (len(uvs) + index.reshape(-1, 3)).astype(np.uint32)
        scale[moved] *= np.float32(transform.side_factor)
        uvs = np.concatenate([uvs, transform.points(uvs[corners])])
    return TextureCoordinates(uvs, faces, scale)
