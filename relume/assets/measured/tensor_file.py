"""Tensor files of EPFL's RGL material database, little-endian: named arrays in one file.

magic      12 bytes "tensor_file\\0"
version    2 bytes: 1, 0
fields     uint32, how many
then each  uint16 length of the name, name, uint16 number of axes, uint8 type, uint64 offset of the data, uint64 per
           axis
"""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import MaterialError

MAGIC = b"tensor_file\0"
MAX_BYTES = 1 << 30
_MAX_FIELDS, _MAX_NAME, _MAX_AXES = 64, 256, 8
_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8"}


def read_tensors(path: Path, label: str) -> dict[str, NDArray[np.generic]]:
    """Map the arrays of a file into memory by name, without reading them.

    Raises:
        MaterialError: the header is damaged, or an array does not lie within the file.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MaterialError(f"{label} has {size:,} bytes; a tensor file may have {MAX_BYTES:,}")
    with path.open("rb") as file:
        try:
            return _read_fields(file, path, size)
        except (struct.error, UnicodeDecodeError, ValueError) as error:
            raise MaterialError(f"{label} is damaged ({str(error)[:80]}); download it again") from error


def _read_fields(file: BinaryIO, path: Path, size: int) -> dict[str, NDArray[np.generic]]:
    def unpack(form: str) -> tuple[int, ...]:
        return struct.unpack("<" + form, file.read(struct.calcsize("<" + form)))

    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("no tensor file")
    *version, num_fields = unpack("BBI")
    if version != [1, 0] or num_fields > _MAX_FIELDS:
        raise ValueError(f"version {version} with {num_fields} arrays")
    tensors = {}
    for _ in range(num_fields):
        (name_length,) = unpack("H")
        name = file.read(min(name_length, _MAX_NAME)).decode("ascii")
        num_axes, kind, offset = unpack("HBQ")
        if name_length > _MAX_NAME or num_axes > _MAX_AXES or kind not in _TYPES:
            raise ValueError(f"an array {name[:20]!r} of {num_axes} axes and type {kind}")
        shape = unpack(f"{num_axes}Q")
        dtype = np.dtype(_TYPES[kind])
        if offset + math.prod(shape) * dtype.itemsize > size:
            raise ValueError(f"the array {name[:20]!r} ends after the file")
        tensors[name] = np.memmap(path, dtype, "r", offset, shape) if math.prod(shape) > 0 else np.empty(shape, dtype)
    return tensors
