"""Filters that convert decoded vertices to the content of an accessor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relume.scene_io.meshopt.errors import MeshoptError

U8 = NDArray[np.uint8]


def _octahedral(elements: U8) -> U8:
    """Decode octahedral unit vectors; the fourth component is unchanged. (n, 4 or 8 bytes)"""
    stride = elements.shape[1]
    if stride not in (4, 8):
        raise MeshoptError("octahedral data does not have elements of 4 or 8 bytes")
    dtype = np.dtype("i1" if stride == 4 else "<i2")
    stored = elements.view(dtype)
    unit = np.maximum(stored[:, 2:3].astype(np.float64), 1)
    xy = stored[:, :2] / unit
    z = 1 - np.abs(xy).sum(1, keepdims=True)
    xy -= np.where(xy >= 0, 1, -1) * np.maximum(-z, 0)
    vectors = np.concatenate([xy, z], axis=1)
    length = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    scaled = np.round(vectors / length * np.iinfo(dtype).max).astype(dtype)
    return np.ascontiguousarray(np.concatenate([scaled, stored[:, 3:]], axis=1)).view(np.uint8)


def _exponential(elements: U8) -> U8:
    """Decode floats with 24 bits of mantissa and 8 of exponent. (n, a multiple of 4 bytes)"""
    encoded = elements.view("<i4")
    with np.errstate(over="ignore"):
        floats = np.ldexp(((encoded << 8) >> 8).astype(np.float32), encoded >> 24)
    return np.ascontiguousarray(floats, "<f4").view(np.uint8)


FILTERS: dict[str, Callable[[U8], U8]] = {
    "NONE": lambda elements: elements,
    "OCTAHEDRAL": _octahedral,
    "EXPONENTIAL": _exponential,
}
