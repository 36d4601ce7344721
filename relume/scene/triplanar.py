"""Detection of materials without UV coordinates, for tri-planar mapping."""

from __future__ import annotations

import numpy as np

from relume.scene.model import Scene


def find_triplanar(scene: Scene) -> list[bool]:
    """Return, for each material, True if most of its triangles have no area in UV space."""
    num_faces, num_without_uvs = np.zeros((2, len(scene.materials)), np.int64)
    for mesh in scene.meshes:
        corners = mesh.uvs[mesh.faces]
        along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        num_faces[mesh.material] += len(area)
        num_without_uvs[mesh.material] += np.count_nonzero(area == 0)
    return [bool(is_triplanar) for is_triplanar in 2 * num_without_uvs > num_faces]
