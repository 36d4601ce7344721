"""The triangles of a moving picture as rays between their places meet them."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.moving.points.surface import Surface
from relume.trace.embree import EmbreeScene
from relume.trace.geometry import off_surface
from relume.trace.on_faces import OFF_EDGES, least_shares

F32 = NDArray[np.float32]


class Solid(NamedTuple):
    """What there is.

    Attributes:
        surface: that is seen. positions: of its triangles' corners, metres. (corners, 3) float32
        embree: the triangles' search tree. off_surface: metres that rays begin off surfaces.
        off_edges: least barycentric coordinates of where they begin, as in `relume.trace.surface`. (faces, 3) float32
    """

    surface: Surface
    positions: F32
    embree: EmbreeScene
    off_surface: float
    off_edges: F32

    @classmethod
    def of(cls, surface: Surface, positions: F32, embree: EmbreeScene) -> Self:
        """Find what rays need besides.

        Args:
            surface: that is seen. positions: of its vertices. (vertices, 3) float32. embree: its tree.
        """
        off, corners = off_surface(positions), positions[surface.faces]
        twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return cls(surface, positions, embree, off, least_shares(corners, twice_area, OFF_EDGES * off))
