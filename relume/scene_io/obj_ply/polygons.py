"""Triangles of polygons: fans of convex ones, ear clipping of all others; faulty polygons are left out.

Ear clipping is mapbox-earcut's, in the plane of Newell's normal (Sutherland, Sproull and Schumacker 1974, A
Characterization of Ten Hidden-Surface Algorithms). It takes quadratic time or more, so that its polygons are bounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import mapbox_earcut
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.obj_ply.text import counted

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]
MAX_CLIPPED_CORNERS = 2_048  # of one polygon
MAX_CLIPPED = 100_000_000  # sum over the clipped polygons of a file of their corners squared
FLAT = 1e-5  # sine of an angle that counts as straight, and relative error of an area
OUT_OF_RANGE = -2  # an index that no file has; -1 is a corner without one
MAX_POSITION = 1e12


@dataclass(frozen=True)
class Polygons:
    """Polygons of a file, before their indices are checked.

    Attributes:
        corners: indices of position, UV and normal; -1 if the file has none for the corner.
        lengths: corners of each polygon.
    """

    corners: Shaped[I64, "corners 3"]
    lengths: Shaped[I64, " polygons"]


@dataclass(frozen=True)
class CutPolygons:
    """Triangles of polygons.

    Attributes:
        corners: indices of position, UV and normal for each corner, -1 if missing.
        polygon: index of the polygon of each triangle. source: index of each corner among the polygons' corners.
    """

    corners: Shaped[I64, "triangles 3 3"]
    polygon: Shaped[I64, " triangles"]
    source: Shaped[I64, "triangles 3"]


def triangulate(
    polygons: Polygons, positions: Shaped[F64, "positions 3"], num_uvs: int, num_normals: int, kind: str
) -> tuple[CutPolygons, list[ImporterWarning]]:
    """Make triangles, in the order of the polygons; also return a warning for each kind of fault.

    Args:
        polygons: of the file. positions: of the file; those that are not finite are as missing ones.
        num_uvs, num_normals: numbers of UV coordinates and normals in the file; corners beyond them have none.
        kind: suffix of the file, in warnings.
    Raises:
        SceneError: there are more than `MAX_TRIANGLES`.
    """
    warnings: list[ImporterWarning] = []
    num_triangles = np.maximum(polygons.lengths - 2, 0)
    if int(num_triangles.sum()) > MAX_TRIANGLES:
        raise SceneError(f"the {kind} file has more than {MAX_TRIANGLES:,} triangles; simplify it")
    corners, is_usable = _check_indices(polygons, positions, (num_uvs, num_normals), kind, warnings)
    num_triangles[~is_usable] = 0
    first = np.cumsum(polygons.lengths) - polygons.lengths
    polygon = np.repeat(np.arange(len(num_triangles)), num_triangles)
    hub = first[polygon]
    step = np.arange(len(hub)) - np.repeat(np.cumsum(num_triangles) - num_triangles, num_triangles)
    source = np.stack([hub, hub + step + 1, hub + step + 2], axis=-1)
    has_triangle = _clip_concave(
        source, num_triangles, corners[:, 0], first, polygons.lengths, positions, kind, warnings
    )
    source, polygon = source[has_triangle], polygon[has_triangle]
    return CutPolygons(corners[source], polygon, source), warnings


def _check_indices(
    polygons: Polygons, positions: F64, counts: tuple[int, int], kind: str, warnings: list[ImporterWarning]
) -> tuple[I64, Bools]:
    """Corners with UVs and normals that exist, -1 otherwise; and whether all positions of each polygon exist."""
    corners = polygons.corners.copy()
    sentences = (("No UV coordinates for", unsupported), ("Computed the normals of", approximated))
    for k, (count, (sentence, make_warning)) in enumerate(zip(counts, sentences, strict=True), start=1):
        is_missing = (corners[:, k] < -1) | (corners[:, k] >= count)
        corners[is_missing, k] = -1
        if is_missing.any():
            corners_text = f"{counted(int(is_missing.sum()), 'corner')} of the {kind} file"
            warnings.append(make_warning(f"{sentence} {corners_text}: their indices are out of range."))
    vertex = corners[:, 0]
    is_inside = (vertex >= 0) & (vertex < len(positions))
    is_number = np.asarray((np.abs(positions) < MAX_POSITION).all(axis=1))  # false for NaN
    is_inside[is_inside] = is_number[vertex[is_inside]]
    owner = np.repeat(np.arange(len(polygons.lengths)), polygons.lengths)
    is_usable = np.bincount(owner[~is_inside], minlength=len(polygons.lengths)) == 0
    if not is_usable.all():
        num = f"{counted(int((~is_usable).sum()), 'face')} of the {kind} file"
        warnings.append(unsupported(f"Left out {num}: vertices do not exist or are not numbers."))
    return corners, is_usable


def _clip_concave(
    source: I64,
    num_triangles: I64,
    vertex: I64,
    first: I64,
    lengths: I64,
    positions: F64,
    kind: str,
    warnings: list[ImporterWarning],
) -> Bools:
    """Replace the fans of concave polygons in `source`; return which of its triangles are used."""
    has_triangle = np.ones(len(source), np.bool_)
    row = np.cumsum(num_triangles) - num_triangles
    num_crossing = num_large = num_clipped = 0
    for p in _find_concave(np.flatnonzero(num_triangles > 1), vertex, first, lengths, positions).tolist():
        count, start = int(lengths[p]), int(first[p])
        num_clipped += count**2
        if count > MAX_CLIPPED_CORNERS or num_clipped > MAX_CLIPPED:
            num_large += 1
            continue
        triangles, is_simple = clip_ears(positions[vertex[start : start + count]])
        num_crossing += not is_simple
        if len(triangles):
            rows = slice(int(row[p]), int(row[p]) + count - 2)
            has_triangle[rows] = np.arange(count - 2) < len(triangles)
            source[rows][: len(triangles)] = start + triangles
    if num_crossing:
        message = f"Guessed the triangles of {counted(num_crossing, 'face')} of the {kind} file: edges cross."
        warnings.append(approximated(message))
    if num_large:
        message = f"Filled {counted(num_large, 'concave face')} of the {kind} file as fans: too many corners to cut"
        warnings.append(unsupported(f"{message}. Triangulate them in the program that wrote the file."))
    return has_triangle


def _find_concave(candidates: I64, vertex: I64, first: I64, lengths: I64, positions: F64) -> I64:
    """Polygons, of those with four corners or more, that a fan from the first corner may not fill."""
    if len(candidates) == 0:
        return candidates
    length = lengths[candidates]
    start = np.cumsum(length) - length
    owner = np.repeat(np.arange(len(candidates)), length)
    index = np.arange(len(owner)) - start[owner]
    base = first[candidates][owner]
    points = positions[vertex[base + index]]
    points = points - points[start][owner]
    after = points[start[owner] + (index + 1) % length[owner]]
    edge = after - points
    before = edge[start[owner] + (index - 1) % length[owner]]
    normal = np.add.reduceat(np.cross(points, after), start)
    area = np.linalg.norm(normal, axis=1)
    perimeter = np.add.reduceat(np.linalg.norm(edge, axis=1), start)
    unit = normal / np.where(area > 0, area, 1)[:, None]
    sine = (np.cross(before, edge) * unit[owner]).sum(axis=1)
    cosine = (before * edge).sum(axis=1)
    is_reflex = sine < -FLAT * np.hypot(sine, cosine)
    turned = np.add.reduceat(np.arctan2(sine, cosine), start)  # 2π around a simple polygon
    is_concave = np.bincount(owner[is_reflex], minlength=len(candidates)) > 0
    is_concave |= (turned > 3 * np.pi) | (area <= FLAT * perimeter**2 / 100)
    return np.asarray(candidates[is_concave & (perimeter > 0)])


def clip_ears(points: Shaped[F64, "corners 3"]) -> tuple[Shaped[I64, "triangles 3"], bool]:
    """Cut a polygon into triangles with its orientation; also return whether they have its area.

    Returns:
        Indices of its corners, at most two triangles fewer than corners; none if it has no area.
    """
    relative = points - points.mean(axis=0)
    relative /= max(float(np.abs(relative).max()), 1e-300)
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    area = float(np.linalg.norm(normal)) / 2
    u, v = _plane(relative, normal / (2 * area) if area > FLAT else None)
    flat = np.ascontiguousarray(np.stack([relative @ u, relative @ v], axis=-1))
    triangles = (
        mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32)).astype(np.int64).reshape(-1, 3)
    )
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    signed = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    triangles[signed < 0] = triangles[signed < 0][:, ::-1]
    return triangles[: len(points) - 2], bool(abs(np.abs(signed).sum() - area) <= 1e-3 * area)


def _plane(points: F64, normal: F64 | None) -> tuple[F64, F64]:
    """Two unit axes of the plane of a polygon, (3,) each: across its normal, or its best plane if it has none."""
    if normal is None:
        _, _, axes = np.linalg.svd(points, full_matrices=False)
        return axes[0], axes[1]
    across = np.zeros(3)
    across[int(np.abs(normal).argmin())] = 1
    u = np.cross(across, normal)
    u /= np.linalg.norm(u)
    return u, np.cross(normal, u)
