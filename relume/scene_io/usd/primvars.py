"""Primvars of a prim as values with an index for each corner.

UsdGeomPrimvar: constant, uniform (for each face), varying and vertex, faceVarying (for each corner).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.geometry import MAX_COORDINATE
from relume.scene_io.usd.polygon_mesh import COLOR, NORMALS, OPACITY, PolygonMesh, Primvar

I64 = NDArray[np.int64]
F64 = NDArray[np.float64]
WIDTHS = {COLOR: 3, OPACITY: 1, NORMALS: 3}
UV_WIDTH = 2


def read_primvars(
    prim: Any, mesh: PolygonMesh, time: Any, label: str, warnings: list[ImporterWarning]
) -> dict[str, Primvar]:
    """Read texture coordinates, colors, opacities and normals of a prim, with those it inherits.

    Args:
        prim: a UsdPrim. mesh: its polygons. time: a UsdTimeCode.
        label: names the prim in warnings. warnings: gets a sentence for each primvar with faults.
    """
    from pxr import UsdGeom

    primvars: dict[str, Primvar] = {}
    for usd_primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name, value = usd_primvar.GetPrimvarName(), usd_primvar.Get(time)
        width = WIDTHS.get(name, UV_WIDTH)
        values = as_rows(value, width)
        if values is not None and len(values):
            indices = usd_primvar.GetIndices(time) if usd_primvar.IsIndexed() else None
            primvar = bind(values, usd_primvar.GetInterpolation(), indices, mesh)
            primvars[name] = _check(primvar, name, label, warnings)
    if NORMALS not in primvars and prim.IsA(UsdGeom.Mesh):
        geometry = UsdGeom.Mesh(prim)
        values = as_rows(geometry.GetNormalsAttr().Get(time), 3)
        if values is not None and len(values):
            primvar = bind(values, geometry.GetNormalsInterpolation(), None, mesh)
            primvars[NORMALS] = _check(primvar, NORMALS, label, warnings)
    return primvars


def as_rows(value: Any, width: int) -> Shaped[F64, "values width"] | None:
    """Convert an attribute's value to rows of numbers; None if it has another type or width.

    Args:
        value: of an attribute. width: numbers in a row.
    """
    if value is None or isinstance(value, str):
        return None
    try:
        rows = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    if width == 1:
        return rows.reshape(-1, 1) if rows.ndim <= 1 else None
    if rows.ndim == 1 and len(rows) == width:
        rows = rows[None]
    return rows if rows.ndim == 2 and rows.shape[1] == width else None


def bind(values: F64, interpolation: str, indices: Any, mesh: PolygonMesh) -> Primvar:
    """Find the value of each corner; -1 where there is none.

    A constant with several values is as many programs write it: for each vertex, corner or face, by its length.

    Args:
        values: of the primvar. interpolation: as USD names it. indices: into the values, or None. mesh: the polygons.
    """
    rows = values if indices is None else np.asarray(indices, np.int64)
    by_corner = {
        "uniform": mesh.owner,
        "vertex": mesh.vertex,
        "varying": mesh.vertex,
        "faceVarying": np.arange(len(mesh.vertex)),
    }
    counts = {"vertex": len(mesh.points), "faceVarying": len(mesh.vertex), "uniform": len(mesh.lengths)}
    if interpolation == "constant" and len(rows) > 1:
        interpolation = next((name for name, count in counts.items() if count == len(rows)), interpolation)
    index = by_corner.get(interpolation, np.zeros(len(mesh.vertex), np.int64))
    index = np.where(index < len(rows), index, -1)
    if indices is not None:
        index = np.where(index < 0, -1, rows[index]) if len(rows) else index
    return Primvar(values, np.where((index >= 0) & (index < len(values)), index, -1))


def _check(primvar: Primvar, name: str, label: str, warnings: list[ImporterWarning]) -> Primvar:
    """Leave out values that are not numbers, with a warning about all corners without a value."""
    is_number = np.asarray((np.abs(primvar.values) <= MAX_COORDINATE).all(axis=1))
    index = np.where(is_number[primvar.index], primvar.index, -1)
    num_missing = int((index < 0).sum())
    if num_missing:
        message = f"{num_missing:,} corners of {label} have no valid value of {quote(name)}."
        warnings.append(unsupported(message))
    return Primvar(np.where(is_number[:, None], primvar.values, 0), index)
