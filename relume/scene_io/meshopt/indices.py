"""Decoders of triangle lists, which mostly reuse edges and corners of recent triangles, and of index sequences."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene_io.meshopt.errors import MeshoptError

TAIL_BYTES = 16  # table of common corner pairs, after the triangles
SEQUENCE_TAIL_BYTES = 4
UINT32_MASK = 0xFFFFFFFF
RING_MASK = 15  # ring buffers hold the latest sixteen edges and corners


def decode_triangles(source: bytes, count: int) -> Shaped[NDArray[np.uint32], " n"]:
    """Decode the corner indices of triangles; `count` is a multiple of 3.

    Raises:
        MeshoptError: the data is damaged, or contains another number of triangles.
    """
    num_triangles = count // 3
    if count % 3 or not source or source[0] != 0xE1 or len(source) < 1 + num_triangles + TAIL_BYTES:
        raise MeshoptError("the data is not a triangle list of this length")
    reader = _Triangles(source, 1 + num_triangles)
    corners: list[int] = []
    for code in source[1 : 1 + num_triangles]:
        corners += reader.along_edge(code >> 4, code & 15) if code < 0xF0 else reader.lone_triangle(code & 15)
    if reader.offset != len(source) - TAIL_BYTES:
        raise MeshoptError("the data is damaged, or contains another number of triangles")
    return np.array(corners, np.int64).astype(np.uint32)


def decode_sequence(source: bytes, count: int) -> Shaped[NDArray[np.uint32], " n"]:
    """Decode indices in any order. Raises MeshoptError if the data is damaged, or contains another number."""
    if not source or source[0] != 0xD1 or len(source) < 1 + count + SEQUENCE_TAIL_BYTES:
        raise MeshoptError("the data is not an index sequence of this length")
    reader = _Numbers(source, 1)
    last = [0, 0]
    indices = []
    for _ in range(count):
        step = reader.number()
        last[step & 1] = (last[step & 1] + _decode_zigzag(step >> 1)) & UINT32_MASK
        indices.append(last[step & 1])
    if reader.offset != len(source) - SEQUENCE_TAIL_BYTES:
        raise MeshoptError("the data is damaged, or contains another number of indices")
    return np.array(indices, np.int64).astype(np.uint32)


def _decode_zigzag(step: int) -> int:
    return (step >> 1) ^ -(step & 1)


class _Numbers:
    """Reads numbers with seven bits per byte."""

    def __init__(self, source: bytes, offset: int) -> None:
        self._source, self.offset = source, offset

    def byte(self) -> int:
        if self.offset >= len(self._source):
            raise MeshoptError("the data is truncated")
        self.offset += 1
        return self._source[self.offset - 1]

    def number(self) -> int:
        number = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            number |= (byte & 0x7F) << shift
            if byte < 0x80:
                return number & UINT32_MASK
        raise MeshoptError("the data is damaged")


class _Triangles(_Numbers):
    """State of the decoder: the latest edges and corners, the next new corner, the last explicit one."""

    def __init__(self, source: bytes, offset: int) -> None:
        super().__init__(source, offset)
        self._pairs = source[len(source) - TAIL_BYTES :]
        self._edges, self._num_edges = [(0, 0)] * (RING_MASK + 1), 0
        self._recent, self._num_recent = [0] * (RING_MASK + 1), 0
        self._next = self._last = 0

    def along_edge(self, edge: int, code: int) -> tuple[int, int, int]:
        """Decode a triangle that shares an edge with a recent one."""
        a, b = self._edges[(self._num_edges - 1 - edge) & RING_MASK]
        if code == 0:
            c = self._new()
        elif code < 13:
            c = self._recent[(self._num_recent - 1 - code) & RING_MASK]
        else:
            c = self._remember(self._far() if code == 15 else self._advance(1 if code == 14 else -1))
        self._remember_edges((c, b), (a, c))
        return a, b, c

    def lone_triangle(self, code: int) -> tuple[int, int, int]:
        """Decode a triangle without a shared edge; `code` selects an entry of the table of corner pairs."""
        is_odd = code >= 14
        pair = self.byte() if is_odd else self._pairs[code]
        if is_odd and pair == 0:
            self._next = 0
        # All corners are decoded before any is remembered: codes refer to earlier ones.
        a = self._far() if code == 15 else self._next_index()
        b, is_new_b = self._corner(pair >> 4, is_odd)
        c, is_new_c = self._corner(pair & 15, is_odd)
        for corner, is_new in ((a, True), (b, is_new_b), (c, is_new_c)):
            if is_new:
                self._remember(corner)
        self._remember_edges((b, a), (c, b), (a, c))
        return a, b, c

    def _corner(self, code: int, can_be_far: bool) -> tuple[int, bool]:
        """Decode a corner; also return True if it is new."""
        if code == 0:
            return self._next_index(), True
        if code == 15 and can_be_far:
            return self._far(), True
        return self._recent[(self._num_recent - code) & RING_MASK], False

    def _next_index(self) -> int:
        self._next += 1
        return self._next - 1

    def _new(self) -> int:
        return self._remember(self._next_index())

    def _far(self) -> int:
        return self._advance(_decode_zigzag(self.number()))

    def _advance(self, step: int) -> int:
        self._last = (self._last + step) & UINT32_MASK
        return self._last

    def _remember(self, corner: int) -> int:
        self._recent[self._num_recent & RING_MASK] = corner
        self._num_recent += 1
        return corner

    def _remember_edges(self, *edges: tuple[int, int]) -> None:
        for edge in edges:
            self._edges[self._num_edges & RING_MASK] = edge
            self._num_edges += 1
