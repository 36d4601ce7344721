"""Accessors as NumPy arrays; every offset, stride and count is checked against the available bytes.

glTF 2.0 specification, section 3.6.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.scene_io.gltf.compression import (
    MAX_UNPACKED_BYTES,
    MeshoptBuffer,
    decompress_draco,
    decompress_view,
    read_draco,
    read_meshopt,
)
from relume.scene_io.gltf.container import GltfContainer
from relume.scene_io.gltf.document import Accessor, BufferView, Primitive, Sparse

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MAX_NUMBERS = 240_000_000  # in all accessors that are read; about the content of the largest allowed file

Array = NDArray[Any]


class AccessorReader:
    """Reads the accessors of one file, with a cache and a common size limit."""

    def __init__(self, container: GltfContainer) -> None:
        self._container = container
        self._integers: dict[int, Array] = {}
        self._floats: dict[int, NDArray[np.float32]] = {}
        self._draco: dict[int, Array] = {}
        self._budget = MAX_NUMBERS

    def unpack(self, primitive: Primitive, label: str) -> None:
        """Decompress a Draco primitive into its accessors if they have no other data.

        Raises:
            SceneError: the compressed data is damaged or does not match the accessors.
        """
        draco = read_draco(primitive.extensions, label)
        position = primitive.attributes.get("POSITION")
        if draco is None or position is None or self._accessor(position, label).bufferView is not None:
            return
        if primitive.indices is None or primitive.mode != 4:
            raise SceneError(f"{label} has Draco compression but is no indexed triangle list; export it again")
        indices, positions = self._accessor(primitive.indices, label), self._accessor(position, label)
        data = bytes(view_bytes(self._container, draco.bufferView, label))
        corners, values = decompress_draco(data, indices.count, positions.count, label)
        self._draco[primitive.indices] = _cast_to_accessor(corners[:, None], indices, f"indices of {label}")
        for name, number in draco.attributes.items():
            index = primitive.attributes.get(name)
            if index is not None and number in values:
                accessor = self._accessor(index, label)
                self._draco[index] = _cast_to_accessor(values[number], accessor, f"{name[:40]} of {label}")

    def integers(self, index: int, label: str) -> Shaped[Array, " n"]:
        """Read unsigned scalars, such as vertex indices."""
        accessor = self._accessor(index, label)
        if accessor.type != "SCALAR" or accessor.componentType not in (5121, 5123, 5125):
            raise SceneError(f"{label} are not unsigned scalars; export the scene again")
        if index not in self._integers:
            self._integers[index] = self._values(index, accessor, label)[:, 0]
        return self._integers[index]

    def floats(self, index: int, widths: tuple[int, ...], label: str) -> Shaped[NDArray[np.float32], "n width"]:
        """Read vectors; normalized integers are scaled to [0, 1] or [-1, 1], others only converted.

        Args:
            index: index of the accessor in the document.
            widths: allowed numbers of components.
            label: names the data in errors.
        Raises:
            SceneError: an index, offset, stride, type or count does not match the data.
        """
        accessor = self._accessor(index, label)
        if WIDTHS.get(accessor.type) not in widths:
            raise SceneError(
                f"{label} are {accessor.type}, not vectors of {' or '.join(map(str, widths))}; export the scene again"
            )
        if index not in self._floats:
            values = self._values(index, accessor, label)
            if accessor.normalized and values.dtype.kind != "f":
                scaled = values / np.float64(np.iinfo(values.dtype).max)
                self._floats[index] = np.maximum(scaled, -1).astype(np.float32)
            else:
                self._floats[index] = values.astype(np.float32)
        return self._floats[index]

    def _accessor(self, index: int, label: str) -> Accessor:
        return self._container.document.accessors.get(index, label)

    def _values(self, index: int, accessor: Accessor, label: str) -> Array:
        self._budget -= accessor.count * WIDTHS[accessor.type]
        if self._budget < 0:
            raise SceneError(f"the scene's arrays contain more than {MAX_NUMBERS:,} numbers; simplify it")
        return self._draco[index] if index in self._draco else _read(self._container, accessor, label)


def _cast_to_accessor(values: Array, accessor: Accessor, label: str) -> Array:
    """Convert decompressed values to the accessor's type. (count, width) Raises SceneError if they do not match."""
    dtype = np.dtype(DTYPES[accessor.componentType])
    is_float = dtype.kind == "f"
    fits = values.shape == (accessor.count, WIDTHS.get(accessor.type)) and (values.dtype.kind == "f") == is_float
    if not fits or not (is_float or np.array_equal(values.astype(dtype), values)):
        raise SceneError(f"{label} do not match their Draco data; export the scene again")
    return values.astype(dtype)


def view_bytes(container: GltfContainer, index: int, label: str) -> memoryview:
    """Return the bytes of a buffer view, decompressed.

    Args:
        container: the file's document and buffers.
        index: index of the view in the document.
        label: names the data in errors.
    Raises:
        SceneError: there is no such view, it exceeds its buffer, or its compression is unsupported.
    """
    view = container.document.buffer_views.get(index, label)
    compression = read_meshopt(view, label)
    if compression is None:
        return _bytes(container, view, label)
    if index not in container.decompressed_views:
        num_bytes = view.byteLength + sum(len(chunk) for chunk in container.decompressed_views.values())
        if num_bytes > MAX_UNPACKED_BYTES:
            raise SceneError(f"the scene's arrays decompress to more than {MAX_UNPACKED_BYTES >> 20} MB; simplify it")
        container.decompressed_views[index] = decompress_view(
            compression, bytes(_bytes(container, compression, label)), label
        )
    return container.decompressed_views[index]


def _bytes(container: GltfContainer, view: BufferView | MeshoptBuffer, label: str) -> memoryview:
    """A slice of a buffer."""
    content = container.buffer(view.buffer, label)
    if view.byteOffset < 0 or view.byteOffset + view.byteLength > len(content):
        raise SceneError(f"the buffer view of {label} exceeds its buffer; export the scene again")
    return content[view.byteOffset : view.byteOffset + view.byteLength]


def _read(container: GltfContainer, accessor: Accessor, label: str) -> Array:
    """Stored values with sparse substitutions. (count, width)"""
    width, dtype = WIDTHS[accessor.type], np.dtype(DTYPES[accessor.componentType])
    if accessor.bufferView is None:
        _check_zeros(container, accessor, width * dtype.itemsize, label)
        values: Array = np.zeros((accessor.count, width), dtype)
    else:
        values = _read_strided(container, accessor.bufferView, accessor.byteOffset, accessor.count, width, dtype, label)
    if accessor.sparse is not None:
        _substitute(container, accessor.sparse, values, label)
    return values


def _read_strided(
    container: GltfContainer, view_index: int, offset: int, count: int, width: int, dtype: np.dtype[Any], label: str
) -> Array:
    content = view_bytes(container, view_index, label)
    element_bytes = width * dtype.itemsize
    stride = container.document.buffer_views.get(view_index, label).byteStride or element_bytes
    if stride < element_bytes:
        raise SceneError(f"{label} have a stride of {stride} for elements of {element_bytes} bytes; export it again")
    if count == 0:
        return np.zeros((0, width), dtype)
    if offset < 0 or offset + (count - 1) * stride + element_bytes > len(content):
        raise SceneError(f"{label} have more elements than their buffer view; export the scene again")
    return np.ndarray((count, width), dtype, content, offset, (stride, dtype.itemsize)).copy()


def _substitute(container: GltfContainer, sparse: Sparse, values: Array, label: str) -> None:
    """Apply the sparse substitutions in place."""
    num_elements, width = values.shape
    if sparse.count > num_elements:
        raise SceneError(f"{label} have more sparse elements than elements; export the scene again")
    index_view, index_dtype = sparse.indices, np.dtype(DTYPES[sparse.indices.componentType])
    indices = _read_strided(
        container, index_view.bufferView, index_view.byteOffset, sparse.count, 1, index_dtype, f"sparse {label}"
    )
    if sparse.count and int(indices.max()) >= num_elements:
        raise SceneError(f"{label} have sparse indices out of range; export the scene again")
    value_view = sparse.values
    values[indices[:, 0]] = _read_strided(
        container, value_view.bufferView, value_view.byteOffset, sparse.count, width, values.dtype, f"sparse {label}"
    )


def _check_zeros(container: GltfContainer, accessor: Accessor, element_bytes: int, label: str) -> None:
    """Limit accessors without a view, which are zero except for their sparse part and could claim gigabytes."""
    if accessor.sparse is not None:
        view_bytes(container, accessor.sparse.values.bufferView, label)  # reads its buffer
    buffer_bytes = sum(len(buffer) for buffer in container.buffers.values())
    if accessor.count * element_bytes > 1000 * buffer_bytes:
        raise SceneError(f"{label} claim {accessor.count:,} elements but contain almost none; export the scene again")
