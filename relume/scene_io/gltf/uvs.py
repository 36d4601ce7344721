"""UV coordinates of a material, with KHR_texture_transform, and tangents computed from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from pydantic import BaseModel

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.model import F32, U32
from relume.scene_io.gltf.document import Index, Number, TextureInfo
from relume.scene_io.gltf.tolerant import read_object

U8 = NDArray[np.uint8]
Wrap = tuple[str, str]
Tiling = tuple[tuple[int, int], tuple[float, float]]
_NO_TILING: Tiling = ((1, 1), (0.0, 0.0))
_MAX_TILED = 8192  # texels per side
_MAX_REPEAT_ERROR = 1e-4


class UvTransform(BaseModel, frozen=True):
    """KHR_texture_transform of one texture; `texCoord` overrides the set."""

    offset: tuple[Number, Number] = (0.0, 0.0)
    rotation: Number = 0.0
    scale: tuple[Number, Number] = (1.0, 1.0)
    texCoord: Index | None = None  # noqa: N815


@dataclass(frozen=True)
class UvSlot:
    """A set of UV coordinates with a transform, common to all textures of a material."""

    uv_set: int = 0
    transform: UvTransform = field(default_factory=UvTransform)

    def apply(self, sets: Mapping[int, Shaped[F32, "vertices 2"]], num_vertices: int) -> Shaped[F32, "vertices 2"]:
        """Scale, rotate (counterclockwise with v down) and translate UV coordinates.

        Args:
            sets: by number; if the slot's is missing, the first one is used, or zeros.
        """
        if not sets:
            return np.zeros((num_vertices, 2), np.float32)
        p = self.transform
        c, s = np.cos(p.rotation), np.sin(p.rotation)
        rotation = np.array([[c, s], [-s, c]])
        coordinates = sets.get(self.uv_set, sets[min(sets)])
        transformed = (coordinates * np.array(p.scale)) @ rotation.T + np.array(p.offset)
        return np.asarray(np.clip(transformed, -1e6, 1e6), np.float32)


class UvTransforms:
    """Brings all textures of a material to common UV coordinates; textures that repeat more often are tiled.

    Attributes:
        slot: UV coordinates for the meshes.
    """

    def __init__(self, textures: Sequence[TextureInfo], label: str, warnings: list[ImporterWarning]) -> None:
        """Choose the common UV coordinates.

        Args:
            textures: textures of the material; the first decides if no common transform exists.
            label: names the material in warnings. warnings: gets a sentence if a texture has another transform.
        """
        self._label, self._warnings = label, warnings
        slots = [_read_slot(texture, label, warnings) for texture in textures]
        self._slots = dict(zip(map(id, textures), slots, strict=True))
        candidates = (candidate for candidate in slots if all(tiling(slot, candidate) is not None for slot in slots))
        self.slot = next(candidates, slots[0] if slots else UvSlot())
        self._has_warned = False

    def is_tiled(self, info: TextureInfo) -> bool:
        """True if `tile_image` tiles this texture of the material."""
        layout = tiling(self._slots[id(info)], self.slot)
        return layout is not None and layout[0] != (1, 1)

    def tile_image(self, info: TextureInfo, pixels: Shaped[U8, "height width channels"], wrap: Wrap) -> U8:
        """Tile an image to be sampled at the meshes' UV coordinates.

        Args:
            info: one of the material's textures. pixels: top row first. wrap: wrap mode of the texture.
        """
        layout = tiling(self._slots[id(info)], self.slot)
        if layout == _NO_TILING or pixels.shape[:2] == (1, 1):
            return pixels
        height, width = pixels.shape[:2]
        if layout is not None and wrap == ("repeat", "repeat"):
            (across, down), (right, below) = layout
            if max(width * across, height * down) <= _MAX_TILED:
                shift = round(-below * height) % height, round(-right * width) % width
                return np.tile(np.roll(pixels, shift, axis=(0, 1)), (down, across, 1))
        if not self._has_warned:
            message = f"The textures of {self._label} have different UV transforms, which can't be combined; all use"
            self._warnings.append(unsupported(f"{message} the same one."))
        self._has_warned = True
        return pixels


def tiling(slot: UvSlot, base_slot: UvSlot) -> Tiling | None:
    """Find how often an image repeats within another's UV range along u and v, and its offset there.

    Returns:
        None if the number is not whole, or the rotations differ.
    """
    transform, base_transform = slot.transform, base_slot.transform
    if slot == base_slot:
        return _NO_TILING
    if slot.uv_set != base_slot.uv_set or transform.rotation != base_transform.rotation or 0 in base_transform.scale:
        return None
    repeats = np.array(transform.scale) / base_transform.scale
    whole = np.rint(repeats)
    if (
        (whole < 1).any()
        or np.abs(repeats - whole).max() > _MAX_REPEAT_ERROR
        or (transform.rotation and repeats[0] != repeats[1])
    ):
        return None
    across, down = (int(min(number, _MAX_TILED)) for number in whole)
    right, below = (np.array(transform.offset) - whole * base_transform.offset).tolist()
    return (across, down), (right, below)


def _read_slot(texture: TextureInfo, label: str, warnings: list[ImporterWarning]) -> UvSlot:
    extension = texture.extensions.get("KHR_texture_transform")
    if extension is None:
        return UvSlot(texture.texCoord)
    try:
        transform = read_object(UvTransform, extension, f"a texture transform of {label}", warnings)
    except SceneError as problem:
        warnings.append(unsupported(f"Ignored a texture transform: {problem}."))
        return UvSlot(texture.texCoord)
    uv_set = texture.texCoord if transform.texCoord is None else transform.texCoord
    return UvSlot(uv_set, transform.model_copy(update={"texCoord": None}))


def compute_tangents(
    positions: Shaped[F32, "vertices 3"],
    normals: Shaped[F32, "vertices 3"],
    uvs: Shaped[F32, "vertices 2"],
    faces: Shaped[U32, "triangles 3"],
) -> Shaped[F32, "vertices 4"]:
    """Compute unit tangents along u, averaged over the triangles of a vertex, with the handedness ±1 in w.

    The bitangent cross(normal, tangent)·w points toward −v, which is up, as the green channel of normal maps expects.

    Args:
        positions: positions of the vertices. normals: unit.
        uvs: UV coordinates, v from the top.
        faces: indices of the triangles' vertices.
    """
    p, uv = positions[faces].astype(np.float64), uvs[faces].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    orientation = np.sign(du1 * dv2 - du2 * dv1)
    # Divided by the determinant these would be dP/du and dP/dv; without the division, large triangles count more.
    along = (e1 * dv2[:, None] - e2 * dv1[:, None]) * orientation[:, None]
    down = (e2 * du1[:, None] - e1 * du2[:, None]) * orientation[:, None]
    tangents, bitangents = np.zeros(positions.shape), np.zeros(positions.shape)
    for corner in range(3):
        np.add.at(tangents, faces[:, corner], along)
        np.add.at(bitangents, faces[:, corner], down)
    tangents -= normals * (normals * tangents).sum(1, keepdims=True)
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents = np.where(length > 1e-20, tangents / np.maximum(length, 1e-20), 0)
    is_mirrored = (np.cross(normals, tangents) * bitangents).sum(1) > 0
    return np.column_stack([tangents, np.where(is_mirrored, -1.0, 1.0)]).astype(np.float32)


def rotate_tangents(
    tangents: Shaped[F32, "vertices 4"], normals: Shaped[F32, "vertices 3"], angle: float
) -> Shaped[F32, "vertices 4"]:
    """Rotate tangents toward the bitangent cross(normal, tangent)·w.

    Args:
        tangents: unit, with the handedness ±1 in w.
        normals: unit.
        angle: radians.
    """
    along, handedness = tangents[:, :3], tangents[:, 3:]
    rotated = np.cos(angle) * along + np.sin(angle) * np.cross(normals, along) * handedness
    return np.column_stack([rotated, handedness]).astype(np.float32)
