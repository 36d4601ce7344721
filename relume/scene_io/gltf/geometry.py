"""Primitives as triangles: morphs, unrolls strips and fans, removes degenerate triangles, adds missing normals.

glTF 2.0 specification, section 3.7.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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
_MAX_SETS = 8  # of UV coordinates, as Blender writes, and of joints
MAX_COORDINATE = 1e7


@dataclass(frozen=True)
class GltfGeometry:
    """A primitive before its node's transform; arrays as in `relume.scene.model.Mesh`.

    Attributes:
        uvs: sets of UV coordinates by their number in the file.
        colors: colors of vertices, linear RGB and alpha in [0, 1], or None.
        joints, joint_weights: influences of a skin, four for each set in the file, or None.
    """

    positions: Shaped[F32, "vertices 3"]
    normals: Shaped[F32, "vertices 3"]
    tangents: Shaped[F32, "vertices 4"]
    uvs: Mapping[int, Shaped[F32, "vertices 2"]]
    faces: Shaped[U32, "triangles 3"]
    colors: Shaped[F32, "vertices 4"] | None = None
    joints: Shaped[I64, "vertices influences"] | None = None
    joint_weights: Shaped[F32, "vertices influences"] | None = None

    def colors_or_white(self) -> Shaped[F32, "vertices 4"]:
        """Colors of vertices; white if there are none."""
        return np.ones((len(self.positions), 4), np.float32) if self.colors is None else self.colors

    def split_vertices(self) -> GltfGeometry:
        """Return a copy with separate vertices for each triangle."""
        order = self.faces.reshape(-1)
        return replace(
            self,
            positions=self.positions[order],
            normals=self.normals[order],
            tangents=self.tangents[order],
            uvs={number: uvs[order] for number, uvs in self.uvs.items()},
            faces=np.arange(len(order), dtype=np.uint32).reshape(-1, 3),
            colors=None if self.colors is None else self.colors[order],
            joints=None if self.joints is None else self.joints[order],
            joint_weights=None if self.joint_weights is None else self.joint_weights[order],
        )

    def with_corner_uvs(self, uvs: Shaped[F32, "triangles 3 2"]) -> GltfGeometry:
        """Return a copy with separate vertices for each triangle and new UV coordinates."""
        return replace(self.split_vertices(), uvs={0: uvs.reshape(-1, 2)})


def count_corners(document: Document, primitive: Primitive) -> int:
    """Number of corners that `read_primitive` has to process; 0 if it is invalid."""
    index = primitive.attributes.get("POSITION") if primitive.indices is None else primitive.indices
    try:
        return 0 if index is None else document.accessors.get(index).count
    except SceneError:
        return 0


def read_primitive(
    reader: AccessorReader,
    primitive: Primitive,
    weights: Sequence[float],
    label: str,
    warnings: list[ImporterWarning],
) -> GltfGeometry | None:
    """Read the primitive's triangles with the vertices they use; None if there are none, with a warning.

    Args:
        reader: reader of the file's accessors.
        primitive: from the document.
        weights: of its morph targets.
        label: names the mesh in errors and warnings.
        warnings: gets one sentence for each omission.
    Raises:
        SceneError: positions or indices are missing or cannot be read.
    """
    if primitive.mode < TRIANGLES:
        warnings.append(unsupported(f"Skipped {label}: points and lines aren't supported."))
        return None
    if "POSITION" not in primitive.attributes:
        warnings.append(unsupported(f"Skipped {label}: it has no positions."))
        return None
    reader.unpack(primitive, label)
    attributes = _AttributeReader(reader, primitive, weights, label, warnings)
    positions = attributes.positions
    if primitive.indices is None:
        corners = np.arange(len(positions))
    else:
        corners = reader.integers(primitive.indices, f"indices of {label}").astype(np.int64)
    faces = _find_usable(positions, _unroll(corners, primitive.mode), label, warnings)
    used_vertices, faces = _compact(faces)
    faces = faces[find_nondegenerate(positions[used_vertices], faces, label, warnings)]
    if len(faces) == 0:
        warnings.append(unsupported(f"Skipped {label}: it has no triangles with an area."))
        return None
    return _read_attributes(attributes, used_vertices, faces, label, warnings)


def _find_usable(positions: F32, faces: I64, label: str, warnings: list[ImporterWarning]) -> I64:
    """Omit the triangles whose vertices are missing, or have positions that are not finite or huge."""
    is_valid = np.append((np.abs(positions) <= MAX_COORDINATE).all(axis=1), False)  # False for NaN
    usable = is_valid[np.minimum(faces, len(positions))].all(axis=1)
    if not usable.all():
        num_missing = int((faces >= len(positions)).any(axis=1).sum())
        reason = (
            f"indices beyond its {len(positions):,} vertices" if num_missing else "positions are NaN, infinite or huge"
        )
        warnings.append(unsupported(f"Removed {int((~usable).sum()):,} triangles from {label}: {reason}."))
    return faces[usable]


class _AttributeReader:
    """Reads the attributes of a primitive, morphed by its targets."""

    def __init__(
        self,
        reader: AccessorReader,
        primitive: Primitive,
        weights: Sequence[float],
        label: str,
        warnings: list[ImporterWarning],
    ) -> None:
        """Read the positions. Raises SceneError."""
        self._reader, self._primitive, self._label, self._warnings = reader, primitive, label, warnings
        self._targets = [(w, target) for w, target in zip(weights, primitive.targets, strict=False) if w != 0]
        self.positions = reader.floats(primitive.attributes["POSITION"], (3,), self._of("positions"))
        self.positions = self._morph("POSITION", self.positions)

    def read(self, name: str, vertices: I64, *widths: int) -> F32 | None:
        """Return the values of an attribute at vertices; None if it is missing, or cannot be read, with a warning."""
        if name not in self._primitive.attributes:
            return None
        try:
            values = self._reader.floats(self._primitive.attributes[name], widths, self._of(name))
            self._check_count(name, values)
        except SceneError as problem:
            self._warnings.append(unsupported(f"Ignored {name} of {self._label}: {problem}."))
            return None
        values = self._morph(name, values)[vertices]
        if not is_usable(values):
            self._warnings.append(
                unsupported(f"Ignored {name} of {self._label}: some values are NaN, infinite or huge.")
            )
            return None
        return values

    def numbered(self, prefix: str, vertices: I64, *widths: int) -> dict[int, F32]:
        """Return the attributes PREFIX_0, PREFIX_1 … by number."""
        sets = {number: self.read(f"{prefix}_{number}", vertices, *widths) for number in range(_MAX_SETS)}
        return {number: values for number, values in sets.items() if values is not None}

    def _of(self, name: str) -> str:
        return f"{name} of {self._label}"

    def _check_count(self, name: str, values: F32) -> None:
        if len(values) != len(self.positions):
            raise SceneError(f"{self._label} has {len(values):,} {name} and {len(self.positions):,} positions")

    def _morph(self, name: str, values: F32) -> F32:
        """Add the weighted displacements of the targets."""
        width = 3 if name == "TANGENT" else values.shape[1]  # the handedness of tangents does not change
        for weight, target in self._targets:
            if name not in target:
                continue
            try:
                displacements = self._reader.floats(target[name], (width,), f"a morph target of {self._label}")
                self._check_count("displacements", displacements)
            except SceneError as problem:
                self._warnings.append(unsupported(f"A morph target of {self._label} was left out: {problem}."))
                continue
            values = values.copy()
            with np.errstate(over="ignore"):  # huge positions are left out
                values[:, :width] += np.float32(weight) * displacements
        return values


def _read_attributes(
    attributes: _AttributeReader, used_vertices: I64, faces: I64, label: str, warnings: list[ImporterWarning]
) -> GltfGeometry:
    points = attributes.positions[used_vertices]
    normals, tangents = attributes.read("NORMAL", used_vertices, 3), attributes.read("TANGENT", used_vertices, 4)
    colors = attributes.read("COLOR_0", used_vertices, 3, 4)
    if colors is not None:
        opaque = np.ones((len(colors), 4 - colors.shape[1]), np.float32)
        colors = np.concatenate([np.clip(colors, 0, 1), opaque], axis=1)
    uvs = attributes.numbered("TEXCOORD", used_vertices, 2)
    influences = _join_influences(*(attributes.numbered(name, used_vertices, 4) for name in ("JOINTS", "WEIGHTS")))
    no_tangents = np.zeros((len(points), 4), np.float32)
    geometry = GltfGeometry(
        points, np.zeros_like(points), no_tangents, uvs, faces.astype(np.uint32), colors, *influences
    )
    if normals is None:
        return _flat_shaded(geometry)
    is_missing = np.linalg.norm(normals, axis=1) < 1e-6
    if is_missing.any():
        count = int(is_missing.sum())
        warnings.append(approximated(f"Recomputed {count:,} zero-length normals of {label} from its triangles."))
        normals = np.where(is_missing[:, None], _smooth_normals(points, faces), normals)
    return replace(geometry, normals=normals, tangents=no_tangents if tangents is None else tangents)


def _join_influences(joints: Mapping[int, F32], weights: Mapping[int, F32]) -> tuple[I64 | None, F32 | None]:
    """Joints and weights of all sets side by side; None if there are none."""
    common = sorted(joints.keys() & weights.keys())
    if not common:
        return None, None
    indices = np.concatenate([joints[number] for number in common], axis=1).astype(np.int64)
    return indices, np.concatenate([weights[number] for number in common], axis=1)


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


def _flat_shaded(geometry: GltfGeometry) -> GltfGeometry:
    """Separate vertices and a face normal for each triangle, as glTF requires if normals are missing."""
    corners = geometry.positions[geometry.faces]
    cross = np.cross((corners[:, 1] - corners[:, 0]).astype(np.float64), corners[:, 2] - corners[:, 0])
    normals = np.repeat(cross / np.linalg.norm(cross, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    return replace(geometry.split_vertices(), normals=normals)
