"""Mesh for rays between surface points."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.probes.stored_scene import StoredScene
from relume.raytrace.barycentric import EDGE_OFFSET_FRACTION, min_barycentrics
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.scene_buffers import ray_epsilon

F32 = NDArray[np.float32]


class OcclusionMesh(NamedTuple):
    """Triangles, their search tree, and offsets of ray origins.

    Attributes:
        stored_scene: stored scene of the mesh. positions: positions of triangle corners, meters. embree: search tree.
        surface_offset: offset of ray origins, meters.
        edge_offset: least barycentric coordinates of ray origins, as in
            `relume.raytrace.surface_interaction`.
    """

    stored_scene: StoredScene
    positions: Shaped[F32, "corners 3"]
    embree: EmbreeScene
    surface_offset: float
    edge_offset: Shaped[F32, "faces 3"]

    @classmethod
    def build(cls, stored_scene: StoredScene, positions: Shaped[F32, "corners 3"], embree: EmbreeScene) -> Self:
        """Compute the offsets.

        Args:
            stored_scene: stored scene of the mesh. positions: positions of its corners. embree: its search tree.
        """
        surface_offset, corners = ray_epsilon(positions), positions[stored_scene.faces]
        twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return cls(
            stored_scene,
            positions,
            embree,
            surface_offset,
            min_barycentrics(corners, twice_area, EDGE_OFFSET_FRACTION * surface_offset),
        )
