"""Which texture coordinates a material uses, moved as KHR_texture_transform says, and tangents made from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydantic import BaseModel, ValidationError

from relume.remarks import Remark, wrong
from relume.scene.gltf.document import Index, Number, TextureInfo
from relume.scene.model import F32, U32


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


def uv_use(textures: Sequence[TextureInfo], what: str, warnings: list[Remark]) -> UvUse:
    """The texture coordinates, and their placement, that all images of a material are shown with: the first image's.

    Args:
        textures: of the material; the first one decides.
        what: names the material in the warning.
        warnings: gets a sentence where another texture asks for something else.
    """
    uses = [_use(texture, what, warnings) for texture in textures]
    if len(set(uses)) > 1:
        warnings.append(wrong(f"the textures of {what} are placed differently; all are placed as the first"))
    return uses[0] if uses else UvUse()


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
