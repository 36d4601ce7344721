"""Traversal of the node tree: world transforms and visibility.

glTF 2.0 specification, section 3.5, and KHR_node_visibility.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, ignored, quote, unsupported
from relume.scene_io.gltf.document import Document, Node

F64 = NDArray[np.float64]
VISIBILITY = "KHR_node_visibility"
_MAX_WARNINGS = 20  # largest number of nodes with a warning
_MAX_ENTRY = 1e12  # of a transform


class PlacedNode(NamedTuple):
    """A node of a scene.

    Attributes:
        number: index in the file. to_world: (4, 4). is_visible: False if the node or an ancestor is hidden.
    """

    number: int
    node: Node
    to_world: Shaped[F64, "4 4"]
    is_visible: bool


def place_nodes(document: Document, roots: Iterable[int], warnings: list[ImporterWarning]) -> list[PlacedNode]:
    """Return root nodes and their descendants, parents first, with their transforms to world space.

    A node that is reached again, through another parent or as its own ancestor, appears only once.

    Args:
        document: document of the file. roots: indices of nodes.
        warnings: gets a sentence for each node that is reached again, is invalid, or has a transform out of range.
    """
    tree, faults = _traverse(document, roots)
    placed: list[PlacedNode | None] = []
    locals_to_parent = local_transforms([node for _, node, _ in tree])
    for (index, node, parent), local in zip(tree, locals_to_parent, strict=True):
        above = placed[parent] if parent >= 0 else PlacedNode(-1, Node(), np.eye(4), True)
        to_world = np.full((4, 4), np.nan) if above is None else above.to_world @ local
        if above is None or not np.isfinite(to_world).all() or np.abs(to_world).max() > _MAX_ENTRY:
            if above is not None:
                message = (
                    f"{document.nodes.label(index)} was left out, with its children: its transform is out of range."
                )
                faults.append(message)
            placed.append(None)
        else:
            placed.append(PlacedNode(index, node, to_world, above.is_visible and not _is_hidden(node)))
    warnings.extend(unsupported(message[0].upper() + message[1:]) for message in faults[:_MAX_WARNINGS])
    return [node for node in placed if node is not None]


def _traverse(document: Document, roots: Iterable[int]) -> tuple[list[tuple[int, Node, int]], list[str]]:
    """Return index, node and position of the parent in this list (−1 for a root), and a sentence for each fault."""
    tree: list[tuple[int, Node, int]] = []
    faults: list[str] = []
    visited, repeated = set[int](), set[int]()
    stack = [(index, -1) for index in reversed(tuple(roots))]
    while stack:
        index, parent = stack.pop()
        if index in visited:
            if index not in repeated:
                label = document.nodes.label(index)
                faults.append(f"{label} has several parents, which glTF doesn't allow; it appears once.")
            repeated.add(index)
            continue
        visited.add(index)
        try:
            node = document.nodes.get(index)
        except SceneError as problem:
            faults.append(f"{problem}.")
            continue
        stack.extend((child, len(tree)) for child in reversed(node.children))
        tree.append((index, node, parent))
    return tree, faults


def _is_hidden(node: Node) -> bool:
    visibility: Any = node.extensions.get(VISIBILITY)
    return isinstance(visibility, dict) and visibility.get("visible") is False


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


def all_roots(document: Document) -> list[int]:
    """Return the nodes without a parent."""
    nodes = range(len(document.nodes))
    children: set[int] = set()
    for index in nodes:
        try:
            children.update(document.nodes.get(index).children)
        except SceneError:
            continue
    return [index for index in nodes if index not in children]


def scene_roots(document: Document, scene_name: str, warnings: list[ImporterWarning]) -> Sequence[int]:
    """Return the root nodes of a scene; all root nodes of the file if it is missing or empty.

    Args:
        document: document of the file. scene_name: name or number of the scene; empty for the default one.
        warnings: gets a sentence if it is not that scene, or one of several.
    """
    if not len(document.scenes):
        return all_roots(document)
    try:
        nodes = document.scenes.get(_scene_index(document, scene_name, warnings), "the file").nodes
    except SceneError as problem:
        warnings.append(unsupported(f"All nodes are shown: {problem}."))
        return all_roots(document)
    if not nodes and len(document.nodes):
        warnings.append(unsupported("All nodes are shown: the scene of the file is empty."))
    return nodes or all_roots(document)


def _scene_index(document: Document, name: str, warnings: list[ImporterWarning]) -> int:
    """Index of the scene with that name or number, or else of the default one."""
    scenes = document.root.scenes
    names = [str(scene.get("name", "")) if isinstance(scene, dict) else "" for scene in scenes]
    keys = {str(number): number for number in range(len(names))}
    keys |= {key: number for number, key in reversed([*enumerate(names)]) if key}
    index = keys.get(name, document.root.scene or 0)
    if len(names) > 1 and not name:
        others = ", ".join(quote(key or str(number)) for number, key in enumerate(names[:10]) if number != index)
        warnings.append(ignored(f"The file has {len(names):,} scenes; the default is shown, not {others}."))
    if name and name not in keys:
        warnings.append(unsupported(f"The file has no scene {quote(name)}; its default scene is shown."))
    return index
