"""Primitives as triangles: strips and fans unrolled, degenerate ones dropped, normals made where there are none.

glTF 2.0 specification, section 3.7.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
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
        colors: of vertices, linear RGB and alpha, within [0, 1]; None where there are none. (num_vertices, 4)
    """

    positions: F32
    normals: F32
    tangents: F32
    uvs: tuple[F32, ...]
    faces: U32
    colors: F32 | None = None

    def split_vertices(self, uvs: F32) -> GltfGeometry:
        """The same with vertices for each triangle alone, and these places in textures. (num_faces, 3, 2)"""
        order = self.faces.reshape(-1)
        split_faces = np.arange(len(order), dtype=np.uint32).reshape(-1, 3)
        arrays = (self.positions[order], self.normals[order], self.tangents[order], (uvs.reshape(-1, 2),), split_faces)
        return GltfGeometry(*arrays, None if self.colors is None else self.colors[order])


def count_corners(document: Document, primitive: Primitive) -> int:
    """How many corners `read_primitive` will have to look at, whether they make triangles or not."""
    index = primitive.attributes.get("POSITION") if primitive.indices is None else primitive.indices
    return document.accessors[index].count if index is not None and index < len(document.accessors) else 0


def read_primitive(
    reader: AccessorReader, primitive: Primitive, label: str, warnings: list[ImporterWarning]
) -> GltfGeometry | None:
    """The primitive's triangles with only the vertices they use; None where it has none (a warning says so).

    Args:
        reader: of the file's accessors.
        primitive: as the document has it.
        label: names the mesh in errors and warnings.
        warnings: gets one sentence for each thing that is left out.
    Raises:
        SceneError: positions are missing or not finite, or indices are out of range.
    """
    if primitive.mode < TRIANGLES:
        warnings.append(unsupported(f"{label} is made of points or lines; it is left out"))
        return None
    if "POSITION" not in primitive.attributes:
        warnings.append(unsupported(f"{label} has no positions; it is left out"))
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
        raise SceneError(f"{label} has positions that are not finite; repair the mesh and export it again")
    faces = faces[find_nondegenerate(positions[used_vertices], faces, label, warnings)]
    if len(faces) == 0:
        warnings.append(unsupported(f"{label} has no triangles; it is left out"))
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
            raise SceneError(f"{name} of {label} are not as many as its positions; export the scene again")
        if not is_usable(values[used_vertices]):
            warnings.append(unsupported(f"{name} of {label} are not all finite; they are not used"))
            return None
        return values[used_vertices]

    normals, tangents = attribute("NORMAL", 3), attribute("TANGENT", 4)
    uvs = tuple(uv for uv in (attribute("TEXCOORD_0", 2), attribute("TEXCOORD_1", 2)) if uv is not None)
    colors = attribute("COLOR_0", 3, 4)
    if colors is not None:
        opaque = np.ones((len(colors), 4 - colors.shape[1]), np.float32)
        colors = np.concatenate([np.clip(colors, 0, 1), opaque], axis=1)
    if primitive.targets:
        warnings.append(approximated(f"morph targets of {label} are not used; it has its basic shape"))
    points = positions[used_vertices]
    if normals is None:
        return _flat_shaded(points, uvs, faces, colors)
    is_missing = np.linalg.norm(normals, axis=1) < 1e-6
    if is_missing.any():
        warnings.append(
            approximated(
                f"{int(is_missing.sum()):,} normals of {label} have no length; they are made from its triangles"
            )
        )
        normals = np.where(is_missing[:, None], _smooth_normals(points, faces), normals)
    tangents = np.zeros((len(points), 4), np.float32) if tangents is None else tangents
    return GltfGeometry(points, normals, tangents, uvs, faces.astype(np.uint32), colors)


def _unroll(corners: NDArray[Any], mode: int) -> I64:
    """Triangles (n, 3) of a list, strip or fan; corners left over are dropped."""
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
    """Indices of the vertices that are used, and faces that number those."""
    used_vertices, inverse = np.unique(faces, return_inverse=True)
    return used_vertices, inverse.reshape(-1, 3)


def is_usable(values: NDArray[np.floating]) -> bool:
    """Whether all values are finite and of a size that leaves room to calculate."""
    return bool(np.isfinite(values).all()) and bool((np.abs(values) <= MAX_COORDINATE).all())


def find_nondegenerate(
    positions: NDArray[np.floating], faces: I64, label: str, warnings: list[ImporterWarning]
) -> NDArray[np.bool_]:
    """Which triangles have area, measured against their longest edge.

    Args:
        positions: of the vertices. (num_vertices, 3)
        faces: the triangles' vertices. (num_faces, 3)
        label: names the mesh in the warning.
        warnings: gets a sentence where some have none.
    Returns:
        (num_faces,) bool
    """
    a, b, c = (positions[faces[:, k]].astype(np.float64) for k in range(3))
    edge = np.maximum.reduce([((b - a) ** 2).sum(1), ((c - a) ** 2).sum(1), ((c - b) ** 2).sum(1)])
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    has_area = np.asarray((area > 1e-10 * edge) & (edge > 0))
    if not has_area.all():
        warnings.append(ignored(f"{int((~has_area).sum()):,} triangles of {label} have no area; they are left out"))
    return has_area


def _smooth_normals(points: F32, faces: I64) -> F32:
    """Unit normals averaged over the triangles of each vertex, weighted by area; +Y where they cancel."""
    corners = points[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cross /= max(float(np.abs(cross).max()), 1e-300)
    total = np.stack([np.bincount(faces.reshape(-1), np.repeat(cross[:, k], 3), len(points)) for k in range(3)], -1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-12, total / np.maximum(length, 1e-12), (0.0, 1.0, 0.0)).astype(np.float32)


def _flat_shaded(points: F32, uvs: tuple[F32, ...], faces: I64, colors: F32 | None) -> GltfGeometry:
    """Every triangle with its own corners and its own normal, as glTF asks where normals are missing."""
    corners = points[faces]
    cross = np.cross((corners[:, 1] - corners[:, 0]).astype(np.float64), corners[:, 2] - corners[:, 0])
    normals = np.repeat(cross / np.linalg.norm(cross, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    order = faces.reshape(-1)
    tangents = np.zeros((len(order), 4), np.float32)
    split_faces = np.arange(len(order), dtype=np.uint32).reshape(-1, 3)
    split_colors = None if colors is None else colors[order]
    return GltfGeometry(points[order], normals, tangents, tuple(uv[order] for uv in uvs), split_faces, split_colors)
