"""Merging of meshes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np

from relume.scene.model import Mesh


def merge_by_material(meshes: Iterable[Mesh]) -> list[Mesh]:
    """Merge all meshes of each material into one, named after the first."""
    groups: dict[int, list[Mesh]] = {}
    for mesh in meshes:
        groups.setdefault(mesh.material, []).append(mesh)
    return [merge_meshes(group) for group in groups.values()]


def merge_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Merge meshes into one with the name and material of the first; a single one stays as it is."""
    if len(meshes) == 1:
        return meshes[0]
    starts = accumulate((len(mesh.positions) for mesh in meshes[:-1]), initial=0)
    positions, normals, tangents, uvs = (
        np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in ("positions", "normals", "tangents", "uvs")
    )
    faces = np.concatenate([mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)])
    return Mesh(meshes[0].name, positions, normals, tangents, uvs, faces, meshes[0].material)
