"""Many small meshes as few large ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np

from relume.scene.model import Mesh


def joined(meshes: Iterable[Mesh]) -> list[Mesh]:
    """Make one mesh of all meshes of each material, under the name of the first."""
    of_material: dict[int, list[Mesh]] = {}
    for mesh in meshes:
        of_material.setdefault(mesh.material, []).append(mesh)
    return [as_one(parts) for parts in of_material.values()]


def as_one(parts: Sequence[Mesh]) -> Mesh:
    """All triangles of some meshes, under the name and with the material of the first."""
    starts = accumulate((len(part.positions) for part in parts[:-1]), initial=0)
    positions, normals, tangents, uvs = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("positions", "normals", "tangents", "uvs")
    )
    faces = np.concatenate([part.faces + np.uint32(start) for part, start in zip(parts, starts, strict=True)])
    return Mesh(parts[0].name, positions, normals, tangents, uvs, faces, parts[0].material)
