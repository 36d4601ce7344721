"""Linear blend skinning in the rest pose: vertices follow their joints, not their node.

    v' = Σ w_j G_j B_j v    with the world transform G_j and the inverse bind matrix B_j of joint j

glTF 2.0 specification, section 3.7.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.document import Document, Skin
from relume.scene_io.gltf.geometry import MAX_COORDINATE, GltfGeometry
from relume.scene_io.gltf.nodes import PlacedNode, all_roots, place_nodes

F64 = NDArray[np.float64]
_BATCH = 16_384  # vertices


def read_skins(
    document: Document, nodes: Sequence[PlacedNode], accessors: AccessorReader, warnings: list[ImporterWarning]
) -> dict[int, Shaped[F64, "joints 4 4"]]:
    """Return the matrices G_j B_j of the skins that nodes use, by index.

    Args:
        document, accessors: of the file. nodes: of the scene.
        warnings: gets a sentence for each skin that cannot be read, which is missing in the result.
    """
    used = sorted({placed.node.skin for placed in nodes if placed.node.skin is not None})
    if not used:
        return {}
    everywhere = place_nodes(document, all_roots(document), [])  # joints may be in no scene
    transforms = {placed.number: placed.to_world for placed in (*everywhere, *nodes)}
    skins = {}
    for index in used:
        try:
            skins[index] = _joint_matrices(document.skins.get(index), transforms, accessors)
        except SceneError as problem:
            warnings.append(unsupported(f"A skin was left out: {problem}."))
    return skins


def _joint_matrices(
    skin: Skin, joint_transforms: Mapping[int, Shaped[F64, "4 4"]], accessors: AccessorReader
) -> Shaped[F64, "joints 4 4"]:
    """Return the matrices G_j B_j of a skin.

    Args:
        skin: from the document. joint_transforms: world transforms of nodes, by index.
        accessors: accessors of the file.
    Raises:
        SceneError: a joint or a matrix is missing or not finite.
    """
    if missing := [joint for joint in skin.joints if joint not in joint_transforms]:
        raise SceneError(f"joint {missing[0]} of the skin does not exist; export the scene again")
    to_world = np.array([joint_transforms[joint] for joint in skin.joints]).reshape(-1, 4, 4)
    if skin.inverseBindMatrices is None:
        return to_world
    columns = accessors.floats(skin.inverseBindMatrices, (16,), "inverse bind matrices of the skin")
    if len(columns) < len(to_world) or not np.isfinite(columns).all():
        raise SceneError("the skin has too few inverse bind matrices or some are not finite; export the scene again")
    return np.asarray(to_world @ columns[: len(to_world)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1))


def skin_geometry(geometry: GltfGeometry, matrices: Shaped[F64, "joints 4 4"], label: str) -> GltfGeometry:
    """Return the geometry in world space.

    Triangles that a matrix mirrors are flipped, so that they stay counterclockwise from outside.

    Args:
        geometry: with influences of joints. matrices: from `_joint_matrices`. label: names the mesh in errors.
    Raises:
        SceneError: a joint does not exist, or the result is not finite or huge.
    """
    assert geometry.joints is not None
    assert geometry.joint_weights is not None
    weights = np.maximum(geometry.joint_weights.astype(np.float64), 0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1), np.eye(1, weights.shape[1]))
    joints = np.where(weights > 0, geometry.joints, 0)
    if len(matrices) == 0 or not 0 <= joints.min() <= joints.max() < len(matrices):
        raise SceneError(f"{label} has joints beyond the {len(matrices):,} of its skin; export the scene again")
    num_vertices = len(geometry.positions)
    positions, normals, tangents = np.zeros((num_vertices, 3)), np.zeros((num_vertices, 3)), np.zeros((num_vertices, 4))
    orientations = np.zeros(num_vertices)
    for start in range(0, num_vertices, _BATCH):
        batch = slice(start, start + _BATCH)
        blended = (weights[batch, :, None, None] * matrices[joints[batch]]).sum(axis=1)
        linear = blended[:, :3, :3]
        positions[batch] = _apply(linear, geometry.positions[batch]) + blended[:, :3, 3]
        orientations[batch] = np.where(np.linalg.det(linear) < 0, -1, 1)
        orientation = orientations[batch, None]
        normals[batch] = _unit(orientation * _apply(_cofactors(linear), geometry.normals[batch]))
        tangents[batch, :3] = _unit(_apply(linear, geometry.tangents[batch, :3]))
        tangents[batch, 3] = geometry.tangents[batch, 3] * orientation[:, 0]
    if not (np.abs(positions) <= MAX_COORDINATE).all():  # False for NaN
        raise SceneError(f"{label} is not finite or huge with its skin; export the scene again")
    faces = np.where(orientations[geometry.faces[:, :1]] < 0, geometry.faces[:, ::-1], geometry.faces)
    arrays = [values.astype(np.float32) for values in (positions, normals, tangents)]
    return replace(geometry, positions=arrays[0], normals=arrays[1], tangents=arrays[2], faces=faces)


def _apply(matrices: Shaped[F64, "n 3 3"], vectors: Shaped[NDArray[np.floating], "n 3"]) -> Shaped[F64, "n 3"]:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _cofactors(matrices: Shaped[F64, "n 3 3"]) -> Shaped[F64, "n 3 3"]:
    """Cofactor matrices: they transform normals like the inverse transpose."""
    a, b, c = matrices[:, 0], matrices[:, 1], matrices[:, 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _unit(vectors: Shaped[F64, "n 3"]) -> Shaped[F64, "n 3"]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
