"""Light between surfaces: what cells send, reflection after reflection, until it is even.

    t^0: from the lights;   L^b = F t^b;   t^(b+1)(c) = mean over the rays r of c of π L^b(link(c, r), −ω_r) h(ω_r)

The first reflections keep the directions that highlights give light. What is reflected once more has come from
everywhere: from then on a cell sends the same to all others, the mean of what they see of it
(`relume.methods.cells.bounces`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.methods.cells.bounces import bounce, bounced, preview_bounced
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.quick import arriving_quickly
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.project.sent import Sent, falls_of, sent_by
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]

_DIRECTED = 2  # reflections


class Leaving(NamedTuple):
    """What cells send out.

    Attributes:
        even: the part that is the same everywhere. (C, 3) float32
        rows: the cells that send more one way than another. (G,) intp. vectors: L_j of each. (G, 3, J) float32
        widening: by their highlights, see `Reflecting`. (G,) float32
    """

    even: F32
    rows: NDArray[np.intp]
    vectors: F32
    widening: F32

    def sent(self, cells: CellLight, *, to_narrow_lobes: bool = True) -> Sent:
        """As rays look it up. to_narrow_lobes: whether rays of pictures do"""
        falls = falls_of(self.widening) if to_narrow_lobes else None
        return sent_by(_padded(self.even), self.rows, cells.frames[self.rows], self.vectors, falls)

    def seen(self, cells: CellLight) -> F32:
        """What other cells see of each in the mean. (C, 3) float32"""
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
        return Leaving(self.even - other.even, rows, vectors, widening)


def sent_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> Leaving:
    """What every cell sends out of light that surfaces have reflected `first` to `last` times, its own included.

    Args:
        cells: that send it. reflecting: what they make of light.
        arrived: from the lights. first: at least 1. last: not less.
    """
    links, rho = cells.links, reflecting.reflectance

    def arriving(now: Leaving) -> Arrived:
        return cells.arriving(now.sent(cells, to_narrow_lobes=False), now.rows)

    return _between(cells, reflecting, arrived, first, last, arriving, lambda even, num: bounced(links, rho, even, num))


def quickly_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> Leaving:
    """The same for a moving hand: by squares in place of directions, and few rays where light is even.

    Args:
        cells, reflecting, arrived, first, last: as of `sent_between`.
    """
    links, few, rho = cells.links, cells.few_links, reflecting.reflectance

    def arriving(now: Leaving) -> Arrived:
        return arriving_quickly(cells, now.sent(cells, to_narrow_lobes=False), now.rows)

    return _between(
        cells, reflecting, arrived, first, last, arriving, lambda even, num: preview_bounced(links, few, rho, even, num)
    )


def _between(
    cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int,
    arriving: Callable[[Leaving], Arrived], summed: Callable[[F32, int], F32],
) -> Leaving:  # fmt: skip
    """Reflect light between cells.

    Args:
        arriving: finds what comes to cells out of light that has directions.
        summed: the sum of even light and what becomes of it in some reflections.
    """
    rows = reflecting.rows
    even, vectors = reflecting.sent(arrived)
    number, directed = 1, min(last, _DIRECTED) if len(rows) else 1
    total, total_vectors = (float(first == 1) * array.astype(np.float64) for array in (even, vectors))
    while number < directed:
        leaving = Leaving(even, rows, vectors, reflecting.widening)
        (even, vectors), number = reflecting.sent(arriving(leaving)), number + 1
        if number >= first:
            total, total_vectors = total + even, total_vectors + vectors
    if number < last:
        even = cells.seen(even, vectors, rows)
        start = max(first, number + 1)
        for _ in range(start - number):
            even = bounce(cells.links, reflecting.reflectance, even)
        total += summed(even, last - start)
    return Leaving(total.astype(np.float32), rows, total_vectors.astype(np.float32), reflecting.widening)


def preview_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> F32:
    """The same roughly, without directions, as others see it in the mean. (NO_CELL + 1, 3) float32

    Args:
        cells, reflecting, arrived, first, last: as of `sent_between`.
    """
    even = cells.seen(*reflecting.sent(arrived), reflecting.rows)
    for _ in range(first - 1):
        even = bounce(cells.links, reflecting.reflectance, even)
    return _padded(preview_bounced(cells.links, cells.few_links, reflecting.reflectance, even, last - first))


def _padded(even: NDArray[np.floating[Any]]) -> F32:
    """Radiance of cells, (C, 3), and black for those that are none. (NO_CELL + 1, 3) float32"""
    out = np.zeros((NO_CELL + 1, 3), np.float32)
    out[: len(even)] = even
    return out
