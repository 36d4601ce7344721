"""Map overrides: images of a look that replace the maps of materials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import EmissionImage, Images, NormalMap
from relume.math.uv_transform import UvTransform
from relume.probes.stored_scene import StoredScene
from relume.raytrace.surface_textures import (
    TextureCoordinates,
    Textures,
    project_missing,
    replace_textures,
    transform_coordinates,
)

F32 = NDArray[np.float32]


class ProbeMapOverrides(NamedTuple):
    """Overrides of a material: of each of `TEXTURES`, the normal map, the emission image; None keeps the baked one.

    Attributes:
        uv: transform of texture coordinates; None for the identity.
    """

    images: Images = (None, None)
    normals: NormalMap | None = None
    emission: EmissionImage | None = None
    uv: UvTransform | None = None

    @property
    def columns(self) -> tuple[str | NormalMap | EmissionImage | None, ...]:
        """The overrides as columns of `Textures.material_textures`."""
        return *self.images, self.normals, self.emission


NO_OVERRIDES = ProbeMapOverrides()


class OverriddenTextures(NamedTuple):
    """Fields of `relume.probes.stored_scene.StoredScene` that overrides change."""

    textures: Textures
    uvs: F32
    uv_faces: NDArray[np.uint32]
    uv_scale: F32
    tangents: F32


def overridden_textures(
    stored_scene: StoredScene, positions: Shaped[F32, "corners 3"], overrides: Sequence[ProbeMapOverrides]
) -> OverriddenTextures:
    """Apply map overrides to a stored scene.

    Args:
        stored_scene: as baked. positions: positions of triangle corners. overrides: overrides of each material.
    Raises:
        NotFoundError, SceneError: an image cannot be loaded.
    """
    baked = TextureCoordinates(stored_scene.uvs, stored_scene.uv_faces, stored_scene.uv_scale)
    is_overridden = np.array([override != NO_OVERRIDES for override in overrides])
    coordinates = project_missing(
        baked, positions, stored_scene.faces, stored_scene.face_normal, is_overridden[stored_scene.face_material]
    )
    textures = replace_textures(stored_scene.textures, [override.columns for override in overrides])
    has_normal_map = np.array([override.normals is not None for override in overrides])
    tangents = _tangents(stored_scene, positions, coordinates.uvs[coordinates.faces], has_normal_map)
    transforms = [override.uv for override in overrides]
    coordinates = transform_coordinates(coordinates, stored_scene.face_material, transforms)
    return OverriddenTextures(textures, *coordinates, _transform_tangents(stored_scene, tangents, transforms))


def _transform_tangents(stored_scene: StoredScene, tangents: F32, transforms: Sequence[UvTransform | None]) -> F32:
    """Rotate the tangents of the corners of materials with a transform; corners of different materials differ."""
    if not len(tangents):
        return tangents
    out = tangents
    for material, transform in enumerate(transforms):
        faces = np.flatnonzero(stored_scene.face_material == material)
        if transform is None or not len(faces):
            continue
        corners, index = np.unique(stored_scene.faces[faces], return_inverse=True)
        normals = np.zeros((len(corners), 3))
        np.add.at(normals, index.ravel(), np.repeat(stored_scene.face_normal[faces], 3, axis=0))
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        out = out.copy()
        out[corners] = transform.tangents(tangents[corners], normals.astype(np.float32))
    return out


def _tangents(stored_scene: StoredScene, positions: F32, uv_coordinates: F32, has_normal_map: NDArray[np.bool_]) -> F32:
    """Compute missing tangents along u, averaged over adjacent triangles by area.

    Args:
        uv_coordinates: UV coordinates of each triangle's corners. (faces, 3, 2) has_normal_map: flags of materials.
    """
    if not has_normal_map.any():
        return stored_scene.tangents
    out = stored_scene.tangents.copy() if len(stored_scene.tangents) else np.zeros((len(positions), 4), np.float32)
    needs_tangent = has_normal_map[stored_scene.face_material]
    needs_tangent &= ~out[stored_scene.faces].any(axis=(1, 2))
    faces = stored_scene.faces[needs_tangent]
    p, uv = positions[faces].astype(np.float64), uv_coordinates[needs_tangent].astype(np.float64)
    e, d = p[:, 1:] - p[:, :1], uv[:, 1:] - uv[:, :1]
    area = d[:, 0, 0] * d[:, 1, 1] - d[:, 1, 0] * d[:, 0, 1]
    along = np.sign(area)[:, None] * (e[:, 0] * d[:, 1, 1:] - e[:, 1] * d[:, 0, 1:])
    face_tangents = np.column_stack([along, -np.sign(area) * np.linalg.norm(np.cross(e[:, 0], e[:, 1]), axis=1)])
    corners = faces.ravel()
    total = np.stack([np.bincount(corners, np.repeat(c, 3), len(out)) for c in face_tangents.T], axis=1)
    length = np.linalg.norm(total[:, :3], axis=1)
    is_defined = np.flatnonzero(length > 0)
    out[is_defined, :3] = total[is_defined, :3] / length[is_defined, None]
    out[is_defined, 3] = np.where(total[is_defined, 3] < 0, -1, 1)
    return out
