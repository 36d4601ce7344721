"""What gather cells send out: evenly, by few functions, and by squares where those do not tell a highlight."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import NUM_SQUARES
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.lobes import Lobes
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.project.sent import Sent, falls_of, sent_by
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]
InLobes = tuple[Lobes, F32]
"""Highlights of cells, and what these send of light, see `relume.methods.cells.in_lobes`. (F, 3, squares) float32"""


class InSquares(NamedTuple):
    """What some cells send besides, by squares.

    Attributes:
        rows: these cells. (F,) intp. radiance: of each. (F, 3, squares) float32
    """

    rows: NDArray[np.intp]
    radiance: F32

    def less(self, other: InSquares) -> InSquares:
        """The difference to another, whose rows may be others."""
        rows = np.union1d(self.rows, other.rows)
        radiance = np.zeros((len(rows), *self.radiance.shape[1:]), np.float32)
        radiance[np.searchsorted(rows, self.rows)] = self.radiance
        radiance[np.searchsorted(rows, other.rows)] -= other.radiance
        return InSquares(rows, radiance)


NOTHING = InSquares(np.empty(0, np.intp), np.empty((0, 3, NUM_SQUARES), np.float32))


class Leaving(NamedTuple):
    """What cells send out.

    Attributes:
        even: the part that is the same everywhere. (C, 3) float32
        rows: the cells that send more one way than another. (G,) intp. vectors: L_j of each. (G, 3, J) float32
        widening: by their highlights, see `Reflecting`. (G,) float32
        squares: what those of them send besides whose highlights are sharp.
    """

    even: F32
    rows: NDArray[np.intp]
    vectors: F32
    widening: F32
    squares: InSquares = NOTHING

    def sent(self, cells: CellLight, *, to_narrow_lobes: bool = True) -> Sent:
        """As rays look it up. to_narrow_lobes: whether rays of pictures do"""
        falls = falls_of(self.widening) if to_narrow_lobes else None
        at = np.searchsorted(self.rows, self.squares.rows)
        frames = cells.frames[self.rows]
        return sent_by(padded(self.even), self.rows, frames, self.vectors, falls, (at, self.squares.radiance))

    def seen(self, cells: CellLight) -> F32:
        """What other cells see of each in the mean, that by squares left out. (C, 3) float32"""
        return cells.seen(self.even, self.vectors, self.rows)

    def less(self, other: Leaving) -> Leaving:
        """The difference to another, whose rows may be others."""
        rows = np.union1d(self.rows, other.rows)
        vectors = np.zeros((len(rows), *self.vectors.shape[1:]), np.float32)
        vectors[np.searchsorted(rows, self.rows)] += self.vectors
        vectors[np.searchsorted(rows, other.rows)] -= other.vectors
        widening = np.zeros(len(rows), np.float32)
        for one in (other, self):
            widening[np.searchsorted(rows, one.rows)] = one.widening
        return Leaving(self.even - other.even, rows, vectors, widening, self.squares.less(other.squares))


def sent_once(reflecting: Reflecting, arrived: Arrived, in_lobes: InLobes | None = None) -> Leaving:
    """What cells send of what comes to them.

    Args:
        reflecting: what they make of it. arrived: what comes.
        in_lobes: what sharp highlights send; None: functions say it.
    """
    even, vectors = reflecting.sent(arrived)
    if in_lobes is None:
        return Leaving(even, reflecting.rows, vectors, reflecting.widening)
    lobes, radiance = in_lobes
    vectors[np.searchsorted(reflecting.rows, lobes.rows)] = 0
    even[lobes.rows] -= lobes.reflectance / np.float32(np.pi) * arrived.irradiance[lobes.rows]
    return Leaving(even, reflecting.rows, vectors, reflecting.widening, InSquares(lobes.rows, radiance))


def padded(even: NDArray[np.floating[Any]]) -> F32:
    """Radiance of cells, (C, 3), and black for those that are none. (NO_CELL + 1, 3) float32"""
    out = np.zeros((NO_CELL + 1, 3), np.float32)
    out[: len(even)] = even
    return out
