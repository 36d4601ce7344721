"""UsdGeomMesh as triangles: orientation, holes, subdivision, primvars."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.usd.polygon_mesh import NORMALS, PolygonMesh, PrimTriangles, make_triangles
from relume.scene_io.usd.primvars import as_rows, read_primvars
from relume.scene_io.usd.subdivision import MAX_LEVELS, Creases, subdivide

I64 = NDArray[np.int64]
MAX_REFINED = 100_000  # quadrilaterals of one mesh after its subdivision


class MeshReader:
    """Reads the meshes of one stage at one time."""

    def __init__(self, time: Any, warnings: list[ImporterWarning]) -> None:
        self._time, self._warnings = time, warnings
        self._num_refined = 0
        self._remaining_quads = MAX_TRIANGLES // 8  # of all subdivided meshes

    def read(self, prim: Any, label: str) -> PrimTriangles | None:
        """Read a mesh; None with a warning if it has no faces.

        Args:
            prim: of type UsdGeomMesh. label: names it in warnings.
        Raises:
            SceneError: it has more than `MAX_TRIANGLES`.
        """
        from pxr import UsdGeom

        geometry = UsdGeom.Mesh(prim)
        mesh = self._read_faces(geometry, label)
        if mesh is None:
            return None
        mesh = replace(mesh, primvars=read_primvars(prim, mesh, self._time, label, self._warnings))
        mesh = self._subdivide(geometry, mesh, label)
        holes = _integers(geometry.GetHoleIndicesAttr().Get(self._time))
        mesh = mesh.select_faces(~np.isin(mesh.face, holes))
        if geometry.GetOrientationAttr().Get(self._time) == "leftHanded":
            mesh = mesh.flip()
        return make_triangles(mesh, self._warnings)

    def _read_faces(self, geometry: Any, label: str) -> PolygonMesh | None:
        """The faces whose vertices exist; None if there are none."""
        points = as_rows(geometry.GetPointsAttr().Get(self._time), 3)
        lengths = _integers(geometry.GetFaceVertexCountsAttr().Get(self._time))
        vertex = _integers(geometry.GetFaceVertexIndicesAttr().Get(self._time))
        if points is None or len(points) == 0 or len(lengths) == 0:
            self._warnings.append(unsupported(f"Skipped {label}: it has no points or no faces."))
            return None
        ends = np.cumsum(np.maximum(lengths, 0))
        is_complete = (lengths >= 0) & (ends <= len(vertex))
        num_corners = int(ends[is_complete].max(initial=0))
        mesh = PolygonMesh(points, np.maximum(lengths, 0), vertex, np.arange(len(lengths)))
        if not is_complete.all():
            self._warnings.append(unsupported(f"Left out {int((~is_complete).sum()):,} faces of {label}: no vertices."))
            lengths = np.where(is_complete, lengths, 0)
        return replace(mesh, lengths=np.maximum(lengths, 0), vertex=vertex[:num_corners])

    def _subdivide(self, geometry: Any, mesh: PolygonMesh, label: str) -> PolygonMesh:
        """The refined surface; a mesh with normals and no word about its kind is one of polygons."""
        scheme_attribute = geometry.GetSubdivisionSchemeAttr()
        scheme = scheme_attribute.Get(self._time)
        has_scheme = scheme_attribute.HasAuthoredValue()
        if scheme in ("none", "bilinear") or (NORMALS in mesh.primvars and not has_scheme):
            return mesh
        primvars = {name: primvar for name, primvar in mesh.primvars.items() if name != NORMALS}
        mesh = replace(mesh, primvars=primvars, is_smooth=True)
        if scheme != "catmullClark":
            message = (
                f"Subdivision {quote(str(scheme))} of {label} isn't supported; it has the shape of its control mesh."
            )
            self._warnings.append(unsupported(message))
            return mesh
        is_valid = (
            np.bincount(mesh.owner, (mesh.vertex < 0) | (mesh.vertex >= len(mesh.points)), len(mesh.lengths)) == 0
        )
        refined = mesh.select_faces(is_valid & (mesh.lengths >= 3))
        num_quads = len(refined.vertex)
        levels = 0
        while levels < MAX_LEVELS and num_quads * 4**levels <= min(MAX_REFINED, self._remaining_quads):
            levels += 1
        if levels == 0 or num_quads == 0:
            message = f"The subdivision surface of {label} has too many faces; it has the shape of its control mesh."
            self._warnings.append(approximated(message))
            return mesh
        self._remaining_quads -= num_quads * 4 ** (levels - 1)
        self._num_refined += 1
        return subdivide(refined, self._creases(geometry, len(mesh.points)), levels)

    def _creases(self, geometry: Any, num_points: int) -> Creases:
        """Creases of a mesh; those that name missing points are left out."""
        indices = _integers(geometry.GetCreaseIndicesAttr().Get(self._time))
        lengths = np.maximum(_integers(geometry.GetCreaseLengthsAttr().Get(self._time)), 0)
        lengths = lengths[np.cumsum(lengths) <= len(indices)]
        indices = indices[: int(lengths.sum())]
        sharpness = _numbers(geometry.GetCreaseSharpnessesAttr().Get(self._time))
        owner = np.repeat(np.arange(len(lengths)), lengths)
        first = np.flatnonzero(owner[1:] == owner[:-1])
        edges = np.stack([indices[first], indices[first + 1]], axis=1) if len(first) else np.zeros((0, 2), np.int64)
        # one value for each crease, or for each of its edges
        of_edge = owner[first] if len(sharpness) == len(lengths) else np.arange(len(first))
        sharpness = np.concatenate([sharpness, np.zeros(max(0, len(first) + len(lengths) - len(sharpness)))])
        is_inside = ((edges >= 0) & (edges < num_points)).all(axis=1)
        vertices = _integers(geometry.GetCornerIndicesAttr().Get(self._time))
        vertex_sharpness = _numbers(geometry.GetCornerSharpnessesAttr().Get(self._time))
        vertices = vertices[: len(vertex_sharpness)]
        is_point = (vertices >= 0) & (vertices < num_points)
        has_sharp_corners = geometry.GetInterpolateBoundaryAttr().Get(self._time) != "edgeOnly"
        return Creases(
            edges[is_inside],
            np.clip(sharpness[of_edge], 0, 10)[is_inside],
            vertices[is_point],
            np.clip(vertex_sharpness[: len(vertices)], 0, 10)[is_point],
            has_sharp_corners,
        )

    def warn_subdivision(self) -> None:
        """Add one warning for all subdivision surfaces that were refined."""
        if self._num_refined:
            count = (
                "1 subdivision surface is"
                if self._num_refined == 1
                else f"{self._num_refined:,} subdivision surfaces are"
            )
            self._warnings.append(approximated(f"{count} refined at most twice."))


def _integers(value: Any) -> I64:
    """An attribute's array; empty if there is none."""
    return np.zeros(0, np.int64) if value is None else np.asarray(value, np.int64).reshape(-1)


def _numbers(value: Any) -> NDArray[np.float64]:
    """An attribute's array with zeros for NaN; empty if there is none."""
    return np.zeros(0) if value is None else np.nan_to_num(np.asarray(value, np.float64).reshape(-1))
