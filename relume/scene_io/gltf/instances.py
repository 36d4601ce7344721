"""EXT_mesh_gpu_instancing: one node that shows its mesh in many places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.document import Index, Node
from relume.scene_io.gltf.nodes import rotations

F64 = NDArray[np.float64]

EXTENSION = "EXT_mesh_gpu_instancing"
_WIDTHS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
_MAX_COORDINATE = 1e12
_IDENTITY = {"TRANSLATION": [0.0, 0.0, 0.0], "ROTATION": [0.0, 0.0, 0.0, 1.0], "SCALE": [1.0, 1.0, 1.0]}


class Instancing(BaseModel, frozen=True):
    """The extension of a node: accessors by attribute; those that relume does not know are not read."""

    attributes: dict[str, Index] = Field(max_length=64)


def read_instances(node: Node, accessors: AccessorReader, max_instances: int, warnings: list[ImporterWarning]) -> F64:
    """Find where a node shows its mesh, seen from itself.

    Args:
        node: with or without the extension. accessors: of the file. max_instances: instances that are allowed.
        warnings: gets a sentence where the extension is not valid.
    Returns:
        (n, 4, 4); one identity where there is no extension.
    Raises:
        SceneError: there are too many instances, or their attributes do not fit each other.
    """
    if EXTENSION not in node.extensions:
        return np.eye(4)[None]
    try:
        attributes = Instancing.model_validate(node.extensions[EXTENSION]).attributes
    except (ValidationError, RecursionError):
        warnings.append(unsupported(f"the instances of node {node.name[:80]!r} are not valid; it appears once"))
        return np.eye(4)[None]
    label = f"instances of node {node.name[:80]!r}"
    arrays = {
        name: accessors.floats(attributes[name], (width,), f"{name} of the {label}").astype(np.float64)
        for name, width in _WIDTHS.items()
        if name in attributes
    }
    counts = {len(values) for values in arrays.values()}
    if not counts:
        return np.eye(4)[None]
    if len(counts) > 1:
        raise SceneError(
            f"the {label} have attributes of {sorted(counts)[0]} and of {sorted(counts)[-1]}; export again"
        )
    (num_instances,) = counts
    if num_instances > max_instances:
        raise SceneError(
            f"the {label} are {num_instances:,}, {max_instances:,} more are allowed in the scene; show fewer"
        )
    translations, quaternions, scales = (
        arrays.get(name, np.tile(_IDENTITY[name], (num_instances, 1))) for name in _WIDTHS
    )
    transforms = np.tile(np.eye(4), (num_instances, 1, 1))
    transforms[:, :3, :3] = rotations(quaternions) * scales[:, None, :]
    transforms[:, :3, 3] = translations
    is_usable = np.isfinite(transforms).all(axis=(1, 2)) & (np.abs(transforms).max(axis=(1, 2)) < _MAX_COORDINATE)
    if not is_usable.all():
        warnings.append(
            unsupported(f"{np.count_nonzero(~is_usable):,} of the {label} are out of range; they are left out")
        )
    return np.asarray(transforms[is_usable])
