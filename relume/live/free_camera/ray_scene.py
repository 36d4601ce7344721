"""The triangles of a moving picture as rays between their places meet them."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.raytrace.barycentric import EDGE_OFFSET_FRACTION, min_barycentrics
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.scene_buffers import offset_point

F32 = NDArray[np.float32]


class OcclusionMesh(NamedTuple):
    """What there is.

    Attributes:
        stored_scene: that is seen. positions: of its triangles' corners, metres. (corners, 3) float32
        embree: the triangles' search tree. surface_offset: metres that rays begin off surfaces.
        edge_offset: least barycentric coordinates of where they begin, as in `relume.raytrace.surface_interaction`.
            (faces, 3) float32
    """

    stored_scene: StoredScene
    positions: F32
    embree: EmbreeScene
    surface_offset: float
    edge_offset: F32

    @classmethod
    def build(cls, stored_scene: StoredScene, positions: F32, embree: EmbreeScene) -> Self:
        """Find what rays need besides.

        Args:
            stored_scene: that is seen. positions: of its vertices. (vertices, 3) float32. embree: its tree.
        """
        surface_offset, corners = offset_point(positions), positions[stored_scene.faces]
        twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return cls(
            stored_scene,
            positions,
            embree,
            surface_offset,
            min_barycentrics(corners, twice_area, EDGE_OFFSET_FRACTION * surface_offset),
        )
