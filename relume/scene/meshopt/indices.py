"""Triangles, whose edges and corners are mostly those of a few triangles before; and plain sequences of indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.scene.meshopt.errors import MeshoptError

TAIL_BYTES = 16  # of common pairs of corners, after the triangles
SEQUENCE_TAIL_BYTES = 4
WORD = 0xFFFFFFFF
RING = 15  # the newest sixteen edges and corners are known by how long ago they were


def decode_triangles(source: bytes, count: int) -> NDArray[np.uint32]:
    """Corner indices of triangles. (count,), count a multiple of 3

    Raises:
        MeshoptError: the data is damaged, or holds another number of triangles.
    """
    num_triangles = count // 3
    if count % 3 or not source or source[0] != 0xE1 or len(source) < 1 + num_triangles + TAIL_BYTES:
        raise MeshoptError("these are not so many packed triangles")
    reader = _Triangles(source, 1 + num_triangles)
    corners: list[int] = []
    for code in source[1 : 1 + num_triangles]:
        corners += reader.along_edge(code >> 4, code & 15) if code < 0xF0 else reader.apart(code & 15)
    if reader.at != len(source) - TAIL_BYTES:
        raise MeshoptError("the data is damaged, or holds another number of triangles")
    return np.array(corners, np.int64).astype(np.uint32)


def decode_sequence(source: bytes, count: int) -> NDArray[np.uint32]:
    """Indices in any order. (count,) Raises MeshoptError where the data is damaged, or holds another number of them."""
    if not source or source[0] != 0xD1 or len(source) < 1 + count + SEQUENCE_TAIL_BYTES:
        raise MeshoptError("these are not so many packed indices")
    reader = _Numbers(source, 1)
    last = [0, 0]
    indices = []
    for _ in range(count):
        step = reader.number()
        last[step & 1] = (last[step & 1] + _signed(step >> 1)) & WORD
        indices.append(last[step & 1])
    if reader.at != len(source) - SEQUENCE_TAIL_BYTES:
        raise MeshoptError("the data is damaged, or holds another number of indices")
    return np.array(indices, np.int64).astype(np.uint32)


def _signed(step: int) -> int:
    return (step >> 1) ^ -(step & 1)


class _Numbers:
    """Reads numbers of seven bits a byte."""

    def __init__(self, source: bytes, at: int) -> None:
        self._source, self.at = source, at

    def byte(self) -> int:
        if self.at >= len(self._source):
            raise MeshoptError("the data is truncated")
        self.at += 1
        return self._source[self.at - 1]

    def number(self) -> int:
        number = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            number |= (byte & 0x7F) << shift
            if byte < 0x80:
                return number & WORD
        raise MeshoptError("the data is damaged")


class _Triangles(_Numbers):
    """What the codes of triangles refer to: the newest edges and corners, the next new corner, the last odd one."""

    def __init__(self, source: bytes, at: int) -> None:
        super().__init__(source, at)
        self._pairs = source[len(source) - TAIL_BYTES :]
        self._edges, self._num_edges = [(0, 0)] * (RING + 1), 0
        self._recent, self._num_recent = [0] * (RING + 1), 0
        self._next = self._last = 0

    def along_edge(self, edge: int, how: int) -> tuple[int, int, int]:
        """A triangle at an edge of one before."""
        a, b = self._edges[(self._num_edges - 1 - edge) & RING]
        if how == 0:
            c = self._new()
        elif how < 13:
            c = self._recent[(self._num_recent - 1 - how) & RING]
        else:
            c = self._remembered(self._far() if how == 15 else self._moved(1 if how == 14 else -1))
        self._keep_edges((c, b), (a, c))
        return a, b, c

    def apart(self, how: int) -> tuple[int, int, int]:
        """A triangle of its own; `how` says whether its corners stand in the table of common pairs."""
        is_odd = how >= 14
        pair = self.byte() if is_odd else self._pairs[how]
        if is_odd and pair == 0:
            self._next = 0
        # All corners are found before any is remembered: those that a code points back to are older.
        a = self._far() if how == 15 else self._next_one()
        b, is_new_b = self._corner(pair >> 4, is_odd)
        c, is_new_c = self._corner(pair & 15, is_odd)
        for corner, is_new in ((a, True), (b, is_new_b), (c, is_new_c)):
            if is_new:
                self._remembered(corner)
        self._keep_edges((b, a), (c, b), (a, c))
        return a, b, c

    def _corner(self, code: int, can_be_far: bool) -> tuple[int, bool]:
        """A corner, and whether it is a new one."""
        if code == 0:
            return self._next_one(), True
        if code == 15 and can_be_far:
            return self._far(), True
        return self._recent[(self._num_recent - code) & RING], False

    def _next_one(self) -> int:
        self._next += 1
        return self._next - 1

    def _new(self) -> int:
        return self._remembered(self._next_one())

    def _far(self) -> int:
        return self._moved(_signed(self.number()))

    def _moved(self, step: int) -> int:
        self._last = (self._last + step) & WORD
        return self._last

    def _remembered(self, corner: int) -> int:
        self._recent[self._num_recent & RING] = corner
        self._num_recent += 1
        return corner

    def _keep_edges(self, *edges: tuple[int, int]) -> None:
        for edge in edges:
            self._edges[self._num_edges & RING] = edge
            self._num_edges += 1
