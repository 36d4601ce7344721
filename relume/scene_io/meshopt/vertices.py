"""Decoder of vertex attributes: each byte of an element is stored as a difference to the previous element, in groups.

A first pass walks over the groups of sixteen, whose lengths depend on their content; then all groups with the same
number of bits are decoded at once.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene_io.meshopt.errors import MeshoptError

U8 = NDArray[np.uint8]
GROUP = 16
MAX_BLOCK, BLOCK_BYTES = 256, 8192
GROUPS_PER_BATCH = 1 << 16

# Bits of a difference by the mode in the header: version 0, and version 1 by its control mode.
WIDTHS = {None: (0, 2, 4, 8), 0: (0, 1, 2, 4), 1: (1, 2, 4, 8)}
ZEROS, RAW = 2, 3  # the other control modes


def _full_fields(byte: int, bits: int) -> int:
    """Number of fields in a byte with all bits set, which mark differences that follow as whole bytes."""
    top = (1 << bits) - 1
    return sum((byte >> shift) & top == top for shift in range(0, 8, bits))


_FULL_FIELDS = {bits: bytes(_full_fields(byte, bits) for byte in range(256)) for bits in (1, 2, 4)}
_SHIFTS = {1: np.arange(8), 2: np.array([6, 4, 2, 0]), 4: np.array([4, 0])}


def decode_vertices(source: bytes, count: int, stride: int) -> Shaped[U8, "n stride"]:
    """Decode the elements of a vertex stream.

    Args:
        source: the compressed bytes.
        count: number of elements.
        stride: bytes of an element, a multiple of 4, at most 256.
    Raises:
        MeshoptError: the data is damaged, or contains another number of elements.
    """
    if not source or source[0] not in (0xA0, 0xA1):
        raise MeshoptError("the data is not a vertex stream")
    version = source[0] & 0x0F
    tail = stride + (stride // 4 if version else 0)
    end = len(source) - max(tail, 24 if version else 32)
    if end < 1:
        raise MeshoptError("the data is truncated")
    first = np.frombuffer(source, np.uint8, stride, len(source) - tail)
    channels = source[len(source) - tail + stride :] if version else bytes(stride // 4)
    deltas = _deltas(source, end, count, stride, version)
    elements = np.empty((count, stride), np.uint8)
    for byte, channel in zip(range(0, stride, 4), channels, strict=True):
        channel_deltas = np.ascontiguousarray(deltas[byte : byte + 4, :count].T)
        elements[:, byte : byte + 4] = _integrate(channel_deltas, np.ascontiguousarray(first[byte : byte + 4]), channel)
    return elements


def _deltas(source: bytes, end: int, count: int, stride: int, version: int) -> U8:
    """Stored differences. (stride, count rounded up to whole groups)"""
    padded = -(-count // GROUP) * GROUP
    deltas = np.zeros((stride, padded), np.uint8)
    groups_by_width: dict[int, tuple[list[int], list[int]]] = {bits: ([], []) for bits in (1, 2, 4, 8)}
    max_block = min((BLOCK_BYTES // stride) & ~(GROUP - 1), MAX_BLOCK)
    offset = 1
    data = np.frombuffer(source, np.uint8)
    for start in range(0, count, max_block):
        num_elements = min(count - start, max_block)
        num_groups = -(-num_elements // GROUP)
        controls = source[offset : offset + stride // 4] if version else b""
        offset += len(controls)
        for byte in range(stride):
            control = (controls[byte // 4] >> 2 * (byte % 4)) & 3 if version else None
            if control == ZEROS:
                continue
            if control == RAW:
                if offset + num_elements > end:
                    raise MeshoptError("the data is truncated")
                deltas[byte, start : start + num_elements] = data[offset : offset + num_elements]
                offset += num_elements
            else:
                offset = _index_groups(
                    source, offset, end, num_groups, WIDTHS[control], byte * padded + start, groups_by_width
                )
    if offset != end:
        raise MeshoptError("the data is damaged, or contains another number of elements")
    for bits, (starts, targets) in groups_by_width.items():
        _unpack_groups(data, bits, np.array(starts, np.int64), np.array(targets, np.int64), deltas.reshape(-1))
    return deltas


def _index_groups(
    source: bytes,
    offset: int,
    end: int,
    num_groups: int,
    widths: tuple[int, ...],
    target: int,
    groups_by_width: dict[int, tuple[list[int], list[int]]],
) -> int:
    """Record start and target of the groups for one byte of a block; return the offset of their end."""
    header = source[offset : offset + (num_groups + 3) // 4]
    offset += (num_groups + 3) // 4
    for group in range(num_groups):
        if offset > end:
            raise MeshoptError("the data is truncated")
        bits = widths[(header[group >> 2] >> 2 * (group & 3)) & 3]
        if bits == 0:
            continue
        starts, targets = groups_by_width[bits]
        starts.append(offset)
        targets.append(target + GROUP * group)
        packed_bytes = GROUP * bits // 8
        offset += (
            packed_bytes
            if bits == 8
            else packed_bytes + sum(source[offset : offset + packed_bytes].translate(_FULL_FIELDS[bits]))
        )
    if offset > end:
        raise MeshoptError("the data is truncated")
    return offset


def _unpack_groups(data: U8, bits: int, starts: NDArray[np.int64], targets: NDArray[np.int64], deltas: U8) -> None:
    """Decode the differences of all groups with one number of bits."""
    for batch_start in range(0, len(starts), GROUPS_PER_BATCH):
        start, target = (
            starts[batch_start : batch_start + GROUPS_PER_BATCH, None],
            targets[batch_start : batch_start + GROUPS_PER_BATCH, None],
        )
        packed_bytes = GROUP * bits // 8
        values = data[start + np.arange(packed_bytes)]
        if bits < 8:
            top = (1 << bits) - 1
            fields = ((values[:, :, None] >> _SHIFTS[bits]) & top).reshape(-1, GROUP).astype(np.uint8)
            is_full = fields == top
            escape_index = np.minimum(start + packed_bytes + np.cumsum(is_full, axis=1) - 1, len(data) - 1)
            values = np.where(is_full, data[escape_index], fields)
        deltas[target + np.arange(GROUP)] = values


def _integrate(deltas: U8, first: U8, channel: int) -> U8:
    """Elements of four bytes from their differences and the first element. (count, 4)"""
    kind = channel & 3
    if kind == 2:
        values, rotation = deltas.view("<u4")[:, 0], channel >> 4
        rotated = (values >> np.uint32(rotation)) | (values << np.uint32((32 - rotation) & 31))
        total = np.bitwise_xor.accumulate(rotated) ^ first.view("<u4")[0]
        return np.ascontiguousarray(total, "<u4")[:, None].view(np.uint8)
    if kind == 3:
        raise MeshoptError("the data has an unknown channel mode")
    dtype = np.dtype("<u2" if kind == 1 else "u1")
    steps = deltas.view(dtype)
    signed = (steps >> 1) ^ (np.zeros_like(steps) - (steps & 1))
    return (np.cumsum(signed, axis=0, dtype=dtype) + first.view(dtype)).astype(dtype).view(np.uint8)
