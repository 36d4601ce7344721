"""Mesh for rays between surface points."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.probes.stored_scene import StoredScene
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.ray_origins import OriginMesh

F32 = NDArray[np.float32]


class OcclusionMesh(NamedTuple):
    """Triangles, their search tree, and origins of rays on them.

    Attributes:
        stored_scene: stored scene of the mesh. embree: search tree. origins: the triangles, as origins of rays.
    """

    stored_scene: StoredScene
    embree: EmbreeScene
    origins: OriginMesh

    @classmethod
    def build(cls, stored_scene: StoredScene, positions: Shaped[F32, "corners 3"], embree: EmbreeScene) -> Self:
        """Compute the offsets of origins.

        Args:
            stored_scene: stored scene of the mesh. positions: of its corners, meters. embree: its search tree.
        """
        origins = OriginMesh.build(positions, stored_scene.faces, stored_scene.face_normal)
        return cls(stored_scene, embree, origins)
