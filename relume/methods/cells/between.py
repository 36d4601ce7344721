"""Light between surfaces: what cells send, reflection after reflection, until it is even.

    t^0: from the lights;   L^b = F t^b;   t^(b+1)(c) = mean over the rays r of c of π L^b(link(c, r), −ω_r) h(ω_r)

The first reflections keep the directions that highlights give light, the more of them the more highlights send. What is
reflected once more has come from everywhere: from then on a cell sends the same to all others, the mean of what they
see of it (`relume.methods.cells.bounces`). Of what comes straight from lights, sharp highlights send what tables say in
the place of functions (`relume.methods.cells.in_lobes`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relume.methods.cells.bounces import bounce, bounced, preview_bounced
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.leaving import NOTHING, InLobes, Leaving, padded, sent_once
from relume.methods.cells.quick import arriving_quickly
from relume.methods.cells.reflecting import Arrived, Reflecting

F32 = NDArray[np.float32]

_DIRECTED, _MOST_DIRECTED = 2, 4  # reflections
_LITTLE = 0.1  # of the light, that highlights have sent on each time


def sent_between(
    cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int, in_lobes: InLobes | None = None
) -> Leaving:
    """What every cell sends out of light that surfaces have reflected `first` to `last` times, its own included.

    Args:
        cells: that send it. reflecting: what they make of light.
        arrived: from the lights. first: at least 1. last: not less.
        in_lobes: sharp highlights, and what they send of it; None: functions say it.
    """
    links, rho = cells.links, reflecting.reflectance

    def again(now: Leaving) -> Leaving:
        return sent_once(reflecting, cells.arriving(now.sent(cells, to_narrow_lobes=False), now.rows))

    once = sent_once(reflecting, arrived, in_lobes)
    return _between(cells, reflecting, once, first, last, again, lambda even, num: bounced(links, rho, even, num))


def _num_directed(reflecting: Reflecting) -> int:
    """How many reflections keep directions: until highlights have sent little each time."""
    share = float(reflecting.reflectance[reflecting.rows].sum(dtype=np.float64)) / max(1, reflecting.reflectance.size)
    return int(np.clip(np.ceil(np.log(_LITTLE) / np.log(np.clip(share, 1e-6, 0.999))), _DIRECTED, _MOST_DIRECTED))


def quickly_between(
    cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int, in_lobes: InLobes | None = None
) -> Leaving:
    """The same for a moving hand: by squares in place of directions, and few rays where light is even.

    Args:
        cells, reflecting, arrived, first, last, in_lobes: as of `sent_between`.
    """
    links, few, rho = cells.links, cells.few_links, reflecting.reflectance

    def again(now: Leaving) -> Leaving:
        return sent_once(reflecting, arriving_quickly(cells, now.sent(cells, to_narrow_lobes=False), now.rows))

    return _between(
        cells, reflecting, sent_once(reflecting, arrived, in_lobes), first, last, again,
        lambda even, num: preview_bounced(links, few, rho, even, num),
    )  # fmt: skip


def _between(
    cells: CellLight, reflecting: Reflecting, once: Leaving, first: int, last: int,
    again: Callable[[Leaving], Leaving], summed: Callable[[F32, int], F32],
) -> Leaving:  # fmt: skip
    """Reflect light between cells.

    Args:
        once: what they send of light that comes from the lights.
        again: reflects light that has directions once more.
        summed: the sum of even light and what becomes of it in some reflections.
    """
    now, number = once, 1
    directed = min(last, _num_directed(reflecting)) if len(once.rows) else 1
    total, vectors = (float(first == 1) * array.astype(np.float64) for array in (once.even, once.vectors))
    while number < directed:
        now, number = again(now), number + 1
        if number >= first:
            total, vectors = total + now.even, vectors + now.vectors
    if number < last:
        even = now.seen(cells)
        start = max(first, number + 1)
        for _ in range(start - number):
            even = bounce(cells.links, reflecting.reflectance, even)
        total += summed(even, last - start)
    found = total.astype(np.float32), once.rows, vectors.astype(np.float32)
    return Leaving(*found, once.widening, once.squares if first == 1 else NOTHING)


def preview_between(cells: CellLight, reflecting: Reflecting, arrived: Arrived, first: int, last: int) -> F32:
    """The same roughly, without directions, as others see it in the mean. (NO_CELL + 1, 3) float32

    Args:
        cells, reflecting, arrived, first, last: as of `sent_between`.
    """
    even = cells.seen(*reflecting.sent(arrived), reflecting.rows)
    for _ in range(first - 1):
        even = bounce(cells.links, reflecting.reflectance, even)
    return padded(preview_bounced(cells.links, cells.few_links, reflecting.reflectance, even, last - first))
