"""EXT_mesh_gpu_instancing: instances of a node's mesh."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.document import Index, Node
from relume.scene_io.gltf.nodes import rotations
from relume.scene_io.gltf.tolerant import read_object

F64 = NDArray[np.float64]

EXTENSION = "EXT_mesh_gpu_instancing"
_WIDTHS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
_MAX_COORDINATE = 1e12
_IDENTITY = {"TRANSLATION": [0.0, 0.0, 0.0], "ROTATION": [0.0, 0.0, 0.0, 1.0], "SCALE": [1.0, 1.0, 1.0]}


class Instancing(BaseModel, frozen=True):
    """The extension of a node: accessors by attribute; unknown attributes are ignored."""

    attributes: dict[str, Index] = Field(max_length=64)


def read_instances(
    node: Node, accessors: AccessorReader, max_instances: int, warnings: list[ImporterWarning]
) -> Shaped[F64, "n 4 4"]:
    """Read the transforms of a node's instances, relative to the node.

    Args:
        node: node with or without the extension. accessors: accessors of the file.
        max_instances: allowed number of instances.
        warnings: gets a sentence if the extension is invalid; the mesh then appears once.
    Returns:
        One identity if there is no extension.
    Raises:
        SceneError: there are too many instances.
    """
    if EXTENSION not in node.extensions:
        return np.eye(4)[None]
    label = f"instances of {quote(node.name or 'node')}"
    try:
        arrays = _read_arrays(node, accessors, label, warnings)
    except SceneError as problem:
        warnings.append(unsupported(f"The {label} are invalid, so that it appears once: {problem}."))
        return np.eye(4)[None]
    if not arrays:
        return np.eye(4)[None]
    num_instances = len(next(iter(arrays.values())))
    if num_instances > max_instances:
        raise SceneError(
            f"there are {num_instances:,} {label}, only {max_instances:,} more are allowed in the scene; use fewer"
        )
    translations, quaternions, scales = (
        arrays.get(name, np.tile(_IDENTITY[name], (num_instances, 1))) for name in _WIDTHS
    )
    transforms = np.tile(np.eye(4), (num_instances, 1, 1))
    transforms[:, :3, :3] = rotations(quaternions) * scales[:, None, :]
    transforms[:, :3, 3] = translations
    is_usable = np.isfinite(transforms).all(axis=(1, 2)) & (np.abs(transforms).max(axis=(1, 2)) < _MAX_COORDINATE)
    if not is_usable.all():
        num_skipped = np.count_nonzero(~is_usable)
        warnings.append(unsupported(f"Skipped {num_skipped:,} {label}: their positions or scales are out of range."))
    return np.asarray(transforms[is_usable])


def _read_arrays(
    node: Node, accessors: AccessorReader, label: str, warnings: list[ImporterWarning]
) -> dict[str, Shaped[F64, "n width"]]:
    attributes = read_object(Instancing, node.extensions[EXTENSION], f"{EXTENSION} of the {label}", warnings).attributes
    arrays = {
        name: accessors.floats(attributes[name], (width,), f"{name} of the {label}").astype(np.float64)
        for name, width in _WIDTHS.items()
        if name in attributes
    }
    counts = sorted({len(values) for values in arrays.values()})
    if len(counts) > 1:
        raise SceneError(f"they have {counts[0]} and {counts[-1]} attribute values; export the scene again")
    return arrays
