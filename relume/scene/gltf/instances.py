"""EXT_mesh_gpu_instancing: one node that shows its mesh in many places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from relume.errors import SceneError
from relume.remarks import Remark, wrong
from relume.scene.gltf.accessors import AccessorReader
from relume.scene.gltf.document import Index, Node
from relume.scene.gltf.nodes import rotations

F64 = NDArray[np.float64]

EXTENSION = "EXT_mesh_gpu_instancing"
_WIDTHS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
_FAR = 1e12
_NOWHERE = {"TRANSLATION": [0.0, 0.0, 0.0], "ROTATION": [0.0, 0.0, 0.0, 1.0], "SCALE": [1.0, 1.0, 1.0]}


class Instancing(BaseModel, frozen=True):
    """The extension of a node: accessors by attribute; those that relume does not know are not read."""

    attributes: dict[str, Index] = Field(max_length=64)


def instances_of(node: Node, accessors: AccessorReader, most: int, warnings: list[Remark]) -> F64:
    """Find where a node shows its mesh, seen from itself.

    Args:
        node: with or without the extension. accessors: of the file. most: instances that are allowed.
        warnings: gets a sentence where the extension is not valid.
    Returns:
        (n, 4, 4); one identity where there is no extension.
    Raises:
        SceneError: there are too many instances, or their attributes do not fit each other.
    """
    if EXTENSION not in node.extensions:
        return np.eye(4)[None]
    try:
        known = Instancing.model_validate(node.extensions[EXTENSION]).attributes
    except (ValidationError, RecursionError):
        warnings.append(wrong(f"the instances of node {node.name[:80]!r} are not valid; it appears once"))
        return np.eye(4)[None]
    what = f"instances of node {node.name[:80]!r}"
    given = {
        name: accessors.floats(known[name], (width,), f"{name} of the {what}").astype(np.float64)
        for name, width in _WIDTHS.items()
        if name in known
    }
    counts = {len(values) for values in given.values()}
    if not counts:
        return np.eye(4)[None]
    if len(counts) > 1:
        raise SceneError(f"the {what} have attributes of {sorted(counts)[0]} and of {sorted(counts)[-1]}; export again")
    (num,) = counts
    if num > most:
        raise SceneError(f"the {what} are {num:,}, {most:,} more are allowed in the scene; show fewer")
    moves, turns, scales = (given.get(name, np.tile(_NOWHERE[name], (num, 1))) for name in _WIDTHS)
    placed = np.tile(np.eye(4), (num, 1, 1))
    placed[:, :3, :3] = rotations(turns) * scales[:, None, :]
    placed[:, :3, 3] = moves
    is_usable = np.isfinite(placed).all(axis=(1, 2)) & (np.abs(placed).max(axis=(1, 2)) < _FAR)
    if not is_usable.all():
        warnings.append(wrong(f"{np.count_nonzero(~is_usable):,} of the {what} are out of range; they are left out"))
    return np.asarray(placed[is_usable])
