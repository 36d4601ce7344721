"""Primitives as triangles: unrolls strips and fans, removes degenerate triangles, adds missing normals.

glTF 2.0 specification, section 3.7.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, unsupported
from relume.scene.model import F32, U32
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.document import Document, Primitive

I64 = NDArray[np.int64]
TRIANGLES, STRIP, FAN = 4, 5, 6
MAX_COORDINATE = 1e7


@dataclass(frozen=True)
class GltfGeometry:
    """A primitive before its node's transform; arrays as in `relume.scene.model.Mesh`.

    Attributes:
        colors: colors of vertices, linear RGB and alpha in [0, 1], or None.
    """

    positions: Shaped[F32, "vertices 3"]
    normals: Shaped[F32, "vertices 3"]
    tangents: Shaped[F32, "vertices 4"]
    uvs: tuple[Shaped[F32, "vertices 2"], ...]
    faces: Shaped[U32, "triangles 3"]
    colors: Shaped[F32, "vertices 4"] | None = None

    def colors_or_white(self) -> Shaped[F32, "vertices 4"]:
        """Colors of vertices; white if there are none."""
        return np.ones((len(self.positions), 4), np.float32) if self.colors is None else self.colors

    def split_vertices(self, uvs: Shaped[F32, "triangles 3 2"]) -> GltfGeometry:
        """Return a copy with separate vertices for each triangle and new UV coordinates."""
        order = self.faces.reshape(-1)
        split_faces = np.arange(len(order), dtype=np.uint32).reshape(-1, 3)
        arrays = (self.positions[order], self.normals[order], self.tangents[order], (uvs.reshape(-1, 2),), split_faces)
        return GltfGeometry(*arrays, None if self.colors is None else self.colors[order])


def count_corners(document: Document, primitive: Primitive) -> int:
    """Number of corners that `read_primitive` has to process."""
    index = primitive.attributes.get("POSITION") if primitive.indices is None else primitive.indices
    return document.accessors[index].count if index is not None and index < len(document.accessors) else 0


def read_primitive(
    reader: AccessorReader, primitive: Primitive, label: str, warnings: list[ImporterWarning]
) -> GltfGeometry | None:
    """Read the primitive's triangles with the vertices they use; None if there are none, with a warning.

    Args:
        reader: reader of the file's accessors.
        primitive: from the document.
        label: names the mesh in errors and warnings.
        warnings: gets one sentence for each omission.
    Raises:
        SceneError: positions are missing or not finite, or indices are out of range.
    """
    if primitive.mode < TRIANGLES:
        warnings.append(unsupported(f"Skipped {label}: points and lines aren't supported."))
        return None
    if "POSITION" not in primitive.attributes:
        warnings.append(unsupported(f"Skipped {label}: it has no positions."))
        return None
    positions = reader.floats(primitive.attributes["POSITION"], (3,), f"positions of {label}")
    if primitive.indices is None:
        corners = np.arange(len(positions))
    else:
        corners = reader.integers(primitive.indices, f"indices of {label}").astype(np.int64)
        if int(corners.max()) >= len(positions):
            raise SceneError(f"{label} has indices beyond its {len(positions):,} vertices; export the scene again")
    faces = _unroll(corners, primitive.mode)
    used_vertices, faces = _compact(faces)
    if not is_usable(positions[used_vertices]):
        raise SceneError(f"{label} has positions that are NaN, infinite or huge; repair the mesh and export it again")
    faces = faces[find_nondegenerate(positions[used_vertices], faces, label, warnings)]
    if len(faces) == 0:
        warnings.append(unsupported(f"Skipped {label}: it has no triangles with an area."))
        return None
    return _read_attributes(reader, primitive, used_vertices, faces, positions, label, warnings)


def _read_attributes(
    reader: AccessorReader,
    primitive: Primitive,
    used_vertices: I64,
    faces: I64,
    positions: F32,
    label: str,
    warnings: list[ImporterWarning],
) -> GltfGeometry:
    def attribute(name: str, *widths: int) -> F32 | None:
        if name not in primitive.attributes:
            return None
        values = reader.floats(primitive.attributes[name], widths, f"{name} of {label}")
        if len(values) != len(positions):
            raise SceneError(f"{label} has different numbers of {name} and positions; export the scene again")
        if not is_usable(values[used_vertices]):
            warnings.append(unsupported(f"Ignored {name} of {label}: some values are NaN, infinite or huge."))
            return None
        return values[used_vertices]

    normals, tangents = attribute("NORMAL", 3), attribute("TANGENT", 4)
    uvs = _uv_sets(attribute("TEXCOORD_0", 2), attribute("TEXCOORD_1", 2))
    colors = attribute("COLOR_0", 3, 4)
    if colors is not None:
        opaque = np.ones((len(colors), 4 - colors.shape[1]), np.float32)
        colors = np.concatenate([np.clip(colors, 0, 1), opaque], axis=1)
    if primitive.targets:
        warnings.append(approximated(f"Morph targets of {label} aren't supported; it has its base shape."))
    points = positions[used_vertices]
    if normals is None:
        return _flat_shaded(points, uvs, faces, colors)
    is_missing = np.linalg.norm(normals, axis=1) < 1e-6
    if is_missing.any():
        count = int(is_missing.sum())
        warnings.append(approximated(f"Recomputed {count:,} zero-length normals of {label} from its triangles."))
        normals = np.where(is_missing[:, None], _smooth_normals(points, faces), normals)
    tangents = np.zeros((len(points), 4), np.float32) if tangents is None else tangents
    return GltfGeometry(points, normals, tangents, uvs, faces.astype(np.uint32), colors)


def _uv_sets(first: F32 | None, second: F32 | None) -> tuple[F32, ...]:
    """Sets of UV coordinates by their number in the file; a missing first set is zero if there is a second."""
    if second is None:
        return () if first is None else (first,)
    return (np.zeros_like(second) if first is None else first), second


def _unroll(corners: NDArray[Any], mode: int) -> I64:
    """Triangles (n, 3) of a list, strip or fan; extra corners are dropped."""
    if mode == TRIANGLES:
        return np.asarray(corners[: len(corners) // 3 * 3].reshape(-1, 3), np.int64)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == FAN:
        hub = np.full(len(corners) - 2, corners[0])
        return np.stack([corners[1:-1], corners[2:], hub], -1).astype(np.int64)
    odd = np.arange(len(corners) - 2) % 2
    i = np.arange(len(corners) - 2)
    return np.stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]], -1).astype(np.int64)


def _compact(faces: I64) -> tuple[I64, I64]:
    """Indices of the used vertices, and faces with new indices into them."""
    used_vertices, inverse = np.unique(faces, return_inverse=True)
    return used_vertices, inverse.reshape(-1, 3)


def is_usable(values: Shaped[NDArray[np.floating], " ..."]) -> bool:
    """True if all values are finite and not too large for calculations."""
    return bool(np.isfinite(values).all()) and bool((np.abs(values) <= MAX_COORDINATE).all())


def find_nondegenerate(
    positions: Shaped[NDArray[np.floating], "vertices 3"],
    faces: Shaped[I64, "triangles 3"],
    label: str,
    warnings: list[ImporterWarning],
) -> Shaped[NDArray[np.bool_], " triangles"]:
    """Return True for each triangle that has an area, relative to its longest edge.

    Args:
        positions: positions of the vertices.
        faces: indices of the triangles' vertices.
        label: names the mesh in the warning.
        warnings: gets a sentence if some have no area.
    """
    a, b, c = (positions[faces[:, k]].astype(np.float64) for k in range(3))
    edge = np.maximum.reduce([np.einsum("nc,nc->n", side, side) for side in (b - a, c - a, c - b)])
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    has_area = np.asarray((area > 1e-10 * edge) & (edge > 0))
    if not has_area.all():
        warnings.append(ignored(f"Removed {int((~has_area).sum()):,} zero-area triangles from {label}."))
    return has_area


def _smooth_normals(points: F32, faces: I64) -> F32:
    """Unit normals averaged over the triangles of each vertex, weighted by area; +Y if they cancel."""
    corners = points[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cross /= max(float(np.abs(cross).max()), 1e-300)
    total = np.stack([np.bincount(faces.reshape(-1), np.repeat(cross[:, k], 3), len(points)) for k in range(3)], -1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-12, total / np.maximum(length, 1e-12), (0.0, 1.0, 0.0)).astype(np.float32)


def _flat_shaded(points: F32, uvs: tuple[F32, ...], faces: I64, colors: F32 | None) -> GltfGeometry:
    """Separate vertices and a face normal for each triangle, as glTF requires if normals are missing."""
    corners = points[faces]
    cross = np.cross((corners[:, 1] - corners[:, 0]).astype(np.float64), corners[:, 2] - corners[:, 0])
    normals = np.repeat(cross / np.linalg.norm(cross, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    order = faces.reshape(-1)
    tangents = np.zeros((len(order), 4), np.float32)
    split_faces = np.arange(len(order), dtype=np.uint32).reshape(-1, 3)
    split_colors = None if colors is None else colors[order]
    return GltfGeometry(points[order], normals, tangents, tuple(uv[order] for uv in uvs), split_faces, split_colors)
