"""The binary chunk of a GLB file: written to disk piece by piece, so that memory is bounded by one array."""

from __future__ import annotations

from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError

MAX_CHUNK_BYTES = 0xFFFF_0000  # lengths have 32 bits; the rest is for the header and the JSON
VERTICES, INDICES = 34962, 34963  # targets of buffer views
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_COMPONENTS = {"<f4": 5126, "<u4": 5125}


class GlbBuffer:
    """Buffer views and accessors of a document. file: gets their bytes."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.num_bytes = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_view(self, data: bytes | memoryview, **fields: Any) -> int:
        """Append bytes, aligned to four; return the index of their buffer view.

        Raises:
            SceneError: the file would be too large for the format.
        """
        padding = -self.num_bytes % 4
        offset = self.num_bytes + padding
        if offset + len(data) > MAX_CHUNK_BYTES:
            raise SceneError("the scene has more than 4 GB, the limit of GLB; export it as .usdz or simplify it")
        self._file.write(b"\0" * padding)
        self._file.write(data)
        self.num_bytes = offset + len(data)
        self.views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(data), **fields})
        return len(self.views) - 1

    def add_array(self, values: NDArray[Any], target: int = VERTICES, *, has_bounds: bool = False) -> int:
        """Append an array of float32 or uint32; return the index of its accessor.

        Args:
            values: (n,) or (n, 2 to 4). target: use of the array. has_bounds: with minimum and maximum.
        """
        values = np.ascontiguousarray(values)
        width = values.shape[1] if values.ndim == 2 else 1
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()} if has_bounds else {}
        view = self.add_view(values.data.cast("B"), target=target)
        component = _COMPONENTS[values.dtype.str]
        accessor = {"bufferView": view, "componentType": component, "count": len(values), "type": _TYPES[width]}
        self.accessors.append(accessor | bounds)
        return len(self.accessors) - 1
