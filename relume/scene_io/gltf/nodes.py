"""Traversal of the node tree, yielding (node, world transform).

glTF 2.0 specification, section 3.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.document import Document, Node

F64 = NDArray[np.float64]
MAX_DEPTH = 64
MAX_NODES = 100_000
_MAX_WARNINGS = 20  # largest number of nodes with a warning


def walk_nodes(document: Document, warnings: list[ImporterWarning]) -> Iterator[tuple[Node, Shaped[F64, "4 4"]]]:
    """Yield every node of the default scene, or of all root nodes, with its transform to world space.

    A node that is reached again, through another parent or as its own ancestor, is yielded only once.

    Args:
        document: document of the file. warnings: gets a sentence for each such node.

    Raises:
        SceneError: a node does not exist, is nested too deeply, or is out of range.
    """
    visited, warned, local = set[int](), set[int](), local_transforms(document.nodes)
    stack = [(index, np.eye(4), 1) for index in reversed(_roots(document))]
    while stack:
        index, parent, depth = stack.pop()
        if index >= len(document.nodes):
            raise SceneError(f"node {index} does not exist, there are {len(document.nodes)}; export the scene again")
        if index in visited:
            if index not in warned and len(warned) < _MAX_WARNINGS:
                name = f" {quote(document.nodes[index].name)}" if document.nodes[index].name else ""
                message = f"Node {index}{name} has several parents, which glTF doesn't allow; it appears once."
                warnings.append(unsupported(message))
            warned.add(index)
            continue
        if depth > MAX_DEPTH:
            raise SceneError(f"nodes are nested more than {MAX_DEPTH} levels deep; flatten the scene")
        visited.add(index)
        node = document.nodes[index]
        to_world = parent @ local[index]
        if not np.isfinite(to_world).all() or np.abs(to_world).max() > 1e12:
            raise SceneError(f"the transform of node {index} is out of range; export the scene again")
        yield node, to_world
        stack.extend((child, to_world, depth + 1) for child in reversed(node.children[: MAX_NODES + 1]))


def local_transforms(nodes: Sequence[Node]) -> Shaped[F64, "n 4 4"]:
    """Matrix of each node, or its translation · rotation · scale."""
    transforms = np.tile(np.eye(4), (len(nodes), 1, 1))
    quaternions, scales, translations = (
        np.array([getattr(node, name) for node in nodes], np.float64).reshape(-1, size)
        for name, size in (("rotation", 4), ("scale", 3), ("translation", 3))
    )
    transforms[:, :3, :3] = rotations(quaternions) * scales[:, None, :]
    transforms[:, :3, 3] = translations
    for index, node in enumerate(nodes):
        if node.matrix is not None:
            transforms[index] = np.array(node.matrix, np.float64).reshape(4, 4).T
    return transforms


def rotations(quaternions: Shaped[F64, "n 4"]) -> Shaped[F64, "n 3 3"]:
    """Rotation matrices of quaternions x, y, z, w, normalized first; a zero quaternion gives the identity."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    is_valid = (length > 1e-12) & (length < 1e12)
    x, y, z, w = np.where(is_valid, quaternions / np.where(is_valid, length, 1), [0.0, 0.0, 0.0, 1.0]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def _roots(document: Document) -> Sequence[int]:
    if document.scenes:
        scene_index = document.scene or 0
        if scene_index >= len(document.scenes):
            raise SceneError(f"scene {scene_index} does not exist, there are {len(document.scenes)}; export it again")
        return document.scenes[scene_index].nodes[: MAX_NODES + 1]
    children = {child for node in document.nodes for child in node.children}
    return [index for index in range(len(document.nodes)) if index not in children]
