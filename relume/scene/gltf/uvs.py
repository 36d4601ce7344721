"""Which texture coordinates a material uses, moved as KHR_texture_transform says, and tangents made from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from relume.remarks import Remark, wrong
from relume.scene.gltf.document import Index, Number, TextureInfo
from relume.scene.model import F32, U32

U8 = NDArray[np.uint8]
Wrap = tuple[str, str]
Tiling = tuple[tuple[int, int], tuple[float, float]]
_AS_IT_IS: Tiling = ((1, 1), (0.0, 0.0))
_MAX_TILED = 8192  # texels a side
_WHOLE = 1e-4


class Placement(BaseModel, frozen=True):
    """KHR_texture_transform of one texture; `texCoord` overrides the set."""

    offset: tuple[Number, Number] = (0.0, 0.0)
    rotation: Number = 0.0
    scale: tuple[Number, Number] = (1.0, 1.0)
    texCoord: Index | None = None  # noqa: N815


@dataclass(frozen=True)
class UvUse:
    """A set of texture coordinates and how they are moved; the same for all textures of a material."""

    uv_set: int = 0
    placement: Placement = field(default_factory=Placement)

    def apply(self, sets: Sequence[F32], num_vertices: int) -> F32:
        """Coordinates (num_vertices, 2): scaled, turned counter-clockwise with v down, shifted; zeros without a set."""
        if self.uv_set >= len(sets):
            return np.zeros((num_vertices, 2), np.float32)
        p = self.placement
        c, s = np.cos(p.rotation), np.sin(p.rotation)
        turn = np.array([[c, s], [-s, c]])
        moved = (sets[self.uv_set] * np.array(p.scale)) @ turn.T + np.array(p.offset)
        return np.asarray(np.clip(moved, -1e6, 1e6), np.float32)


class Placements:
    """How all images of a material are brought to one placement: those that repeat more often are tiled.

    Attributes:
        use: what the meshes carry.
    """

    def __init__(self, textures: Sequence[TextureInfo], what: str, warnings: list[Remark]) -> None:
        """Choose the placement.

        Args:
            textures: of the material; the first one decides where none is a whole part of all others.
            what: names the material in warnings. warnings: gets a sentence where an image cannot be placed.
        """
        self._what, self._warnings = what, warnings
        uses = [_use(texture, what, warnings) for texture in textures]
        self._uses = dict(zip(map(id, textures), uses, strict=True))
        fitting = (use for use in uses if all(tiling(other, use) is not None for other in uses))
        self.use = next(fitting, uses[0] if uses else UvUse())
        self._are_told = False

    def repeats(self, info: TextureInfo) -> bool:
        """Whether `placed` tiles an image. info: one of the material's textures"""
        tiled = tiling(self._uses[id(info)], self.use)
        return tiled is not None and tiled[0] != (1, 1)

    def placed(self, info: TextureInfo, pixels: U8, wrap: Wrap) -> U8:
        """An image as it is to be sampled at the meshes' coordinates.

        Args:
            info: one of the material's textures. pixels: top row first. (height, width, channels). wrap: its own
        """
        tiled = tiling(self._uses[id(info)], self.use)
        if tiled == _AS_IT_IS or pixels.shape[:2] == (1, 1):
            return pixels
        height, width = pixels.shape[:2]
        if tiled is not None and wrap == ("repeat", "repeat"):
            (across, down), (right, below) = tiled
            if max(width * across, height * down) <= _MAX_TILED:
                shift = round(-below * height) % height, round(-right * width) % width
                return np.tile(np.roll(pixels, shift, axis=(0, 1)), (down, across, 1))
        if not self._are_told:
            told = f"the textures of {self._what} are placed differently, one no whole number of times as often as"
            self._warnings.append(wrong(f"{told} another, or not repeated; all are placed alike"))
        self._are_told = True
        return pixels


def tiling(use: UvUse, base: UvUse) -> Tiling | None:
    """How often an image stands in another's along u and v, and where (0, 0) of that lies in it.

    Returns:
        None where that is no whole number of times, or one is turned.
    """
    own, other = use.placement, base.placement
    if use == base:
        return _AS_IT_IS
    if use.uv_set != base.uv_set or own.rotation != other.rotation or 0 in other.scale:
        return None
    times = np.array(own.scale) / other.scale
    whole = np.rint(times)
    if (whole < 1).any() or np.abs(times - whole).max() > _WHOLE or (own.rotation and times[0] != times[1]):
        return None
    across, down = (int(min(number, _MAX_TILED)) for number in whole)
    right, below = (np.array(own.offset) - whole * other.offset).tolist()
    return (across, down), (right, below)


def _use(texture: TextureInfo, what: str, warnings: list[Remark]) -> UvUse:
    extension = texture.extensions.get("KHR_texture_transform")
    if extension is None:
        return UvUse(texture.texCoord)
    try:
        placement = Placement.model_validate(extension)
    except ValidationError:
        warnings.append(wrong(f"a texture transform of {what} is not valid; it is not used"))
        return UvUse(texture.texCoord)
    uv_set = texture.texCoord if placement.texCoord is None else placement.texCoord
    return UvUse(uv_set, placement.model_copy(update={"texCoord": None}))


def made_tangents(positions: F32, normals: F32, uvs: F32, faces: U32) -> F32:
    """Tangents along u with handedness, averaged over the triangles of a vertex.

    The bitangent cross(normal, tangent)·w points against v, which runs down: up, as the green of a normal map means.

    Args:
        positions, normals: of the vertices; normals unit. (num_vertices, 3)
        uvs: texture coordinates, v from the top. (num_vertices, 2)
        faces: the triangles' vertices. (num_faces, 3)
    Returns:
        (num_vertices, 4) float32, unit, the handedness ±1 in w
    """
    p, uv = positions[faces].astype(np.float64), uvs[faces].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    orientation = np.sign(du1 * dv2 - du2 * dv1)
    # Divided by the determinant these are dP/du and dP/dv; left undivided, large triangles count more.
    along = (e1 * dv2[:, None] - e2 * dv1[:, None]) * orientation[:, None]
    down = (e2 * du1[:, None] - e1 * du2[:, None]) * orientation[:, None]
    tangents, bitangents = np.zeros(positions.shape), np.zeros(positions.shape)
    for corner in range(3):
        np.add.at(tangents, faces[:, corner], along)
        np.add.at(bitangents, faces[:, corner], down)
    tangents -= normals * (normals * tangents).sum(1, keepdims=True)
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents = np.where(length > 1e-20, tangents / np.maximum(length, 1e-20), 0)
    mirrored = (np.cross(normals, tangents) * bitangents).sum(1) > 0
    return np.column_stack([tangents, np.where(mirrored, -1.0, 1.0)]).astype(np.float32)


def turned_tangents(tangents: F32, normals: F32, turn: float) -> F32:
    """Tangents turned towards the bitangent cross(normal, tangent)·w.

    Args:
        tangents: unit, the handedness ±1 in w. (num_vertices, 4)
        normals: unit. (num_vertices, 3)
        turn: radians.
    Returns:
        (num_vertices, 4) float32
    """
    along, hand = tangents[:, :3], tangents[:, 3:]
    turned = np.cos(turn) * along + np.sin(turn) * np.cross(normals, along) * hand
    return np.column_stack([turned, hand]).astype(np.float32)
