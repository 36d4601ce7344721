"""Polygons with primvars, and their conversion to triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning
from relume.scene_io.obj_ply.polygons import Polygons, triangulate

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
NORMALS, COLOR, OPACITY = "normals", "displayColor", "displayOpacity"


@dataclass(frozen=True)
class Primvar:
    """Values, and the index of the value of each corner; -1 for none."""

    values: Shaped[F64, "values width"]
    index: Shaped[I64, "*corners"]


@dataclass(frozen=True)
class PolygonMesh:
    """Polygons, counterclockwise from outside.

    Attributes:
        lengths: corners of each face. vertex: vertex of each corner.
        face: index of each face in the file. primvars: by name, with an index for each corner.
        is_smooth: corners without normals get the mean normal of their neighbors within 60°, otherwise their face's.
    """

    points: Shaped[F64, "points 3"]
    lengths: Shaped[I64, " faces"]
    vertex: Shaped[I64, " corners"]
    face: Shaped[I64, " faces"]
    primvars: Mapping[str, Primvar] = field(default_factory=dict)
    is_smooth: bool = False

    @property
    def owner(self) -> Shaped[I64, " corners"]:
        """Row of the face of each corner."""
        return np.repeat(np.arange(len(self.lengths)), self.lengths)

    def select_faces(self, is_selected: Shaped[NDArray[np.bool_], " faces"]) -> PolygonMesh:
        """Return a copy with some of the faces."""
        corners = np.repeat(is_selected, self.lengths)
        primvars = {name: replace(primvar, index=primvar.index[corners]) for name, primvar in self.primvars.items()}
        lengths, face = self.lengths[is_selected], self.face[is_selected]
        return replace(self, lengths=lengths, face=face, vertex=self.vertex[corners], primvars=primvars)

    def flip(self) -> PolygonMesh:
        """Return a copy whose faces are seen from their other side."""
        ends = np.cumsum(self.lengths)
        order = np.repeat(2 * ends - self.lengths - 1, self.lengths) - np.arange(len(self.vertex))
        primvars = {name: replace(primvar, index=primvar.index[order]) for name, primvar in self.primvars.items()}
        return replace(self, vertex=self.vertex[order], primvars=primvars)


@dataclass(frozen=True)
class PrimTriangles:
    """Triangles of a prim, before its transform.

    Attributes:
        vertex: vertices of the corners. face: index of the face in the file. primvars: by name, (triangles, 3) indices.
    """

    points: Shaped[F64, "points 3"]
    vertex: Shaped[I64, "triangles 3"]
    face: Shaped[I64, " triangles"]
    primvars: Mapping[str, Primvar]

    def select(self, rows: Shaped[NDArray[np.bool_], " triangles"]) -> PrimTriangles:
        """Return a copy with some of the triangles."""
        primvars = {name: replace(primvar, index=primvar.index[rows]) for name, primvar in self.primvars.items()}
        return replace(self, vertex=self.vertex[rows], face=self.face[rows], primvars=primvars)


def make_triangles(mesh: PolygonMesh, warnings: list[ImporterWarning]) -> PrimTriangles:
    """Cut polygons into triangles.

    Args:
        mesh: polygons. warnings: gets a sentence for each kind of fault.
    Raises:
        SceneError: there are more than `MAX_TRIANGLES`.
    """
    corners = np.full((len(mesh.vertex), 3), -1, np.int64)
    corners[:, 0] = mesh.vertex
    cut, faults = triangulate(Polygons(corners, mesh.lengths), mesh.points, 0, 0, "USD")
    warnings.extend(faults)
    vertex = cut.corners[..., 0]
    primvars = {name: replace(primvar, index=primvar.index[cut.source]) for name, primvar in mesh.primvars.items()}
    if NORMALS not in primvars and not mesh.is_smooth:
        a, b, c = (mesh.points[vertex[:, k]] for k in range(3))
        facet = np.repeat(np.arange(len(vertex))[:, None], 3, axis=1)
        primvars[NORMALS] = Primvar(np.cross(b - a, c - a), facet)
    return PrimTriangles(mesh.points, vertex, mesh.face[cut.polygon], primvars)
