"""What arrives at the points of a moving picture: summed over sources."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.look.model import Rgb
from relume.moving.beams.beam import Beam
from relume.moving.transfer import MovingTransfer
from relume.picture.light import Light, vector_of
from relume.project.light_vectors import add_scaled

F32 = NDArray[np.float32]


class Arriving(NamedTuple):
    """What arrives at points.

    Attributes:
        total: light vectors of all light but that of beams. (points, 3, K) float32
        others: of that which is not the sky's own, lamps that are beams included. (points, 3, K) float32
        beams: whose shadows pixels find by themselves.
    """

    total: F32
    others: F32
    beams: tuple[Beam, ...] = ()

    def copy(self) -> Arriving:
        """One that may be added to."""
        return self._replace(total=self.total.copy(), others=self.others.copy())


class Found(NamedTuple):
    """Light vectors of some points.

    Attributes:
        vectors: of fewer functions, maybe. (m, 3, ≤ K) float32. rows: the points. (m,); None: all.
    """

    vectors: F32
    rows: NDArray[np.intp] | None = None


def summed(
    transfer: MovingTransfer,
    light: Light,
    vectors_of: Callable[[Light], Found],
    beams: tuple[Beam, ...] = (),
    between: Sequence[tuple[Found, Rgb]] | None = None,
    chosen: NDArray[np.intp] | None = None,
) -> Arriving:
    """Sum over sources: transport is linear in them.

    Args:
        transfer: of the points. light: that arrives.
        vectors_of: finds those of one source and one kind of way, suns that are beams left out.
        beams: of the light.
        between: what surfaces send, with its gains, in place of what `vectors_of` finds of it.
        chosen: points that are asked about, the others have anything; None: all.
    """
    total, others = (np.zeros(transfer.vectors_shape, np.float32) for _ in range(2))
    of_beams = {beam.key for beam in beams}
    for element, gain in vector_of(light).items():
        if element.paths.reflect and between is not None:
            continue
        found = vectors_of(element)
        if not (element.paths.direct and any(lamp in of_beams for lamp, _ in element.local)):
            _add(total, found, gain, chosen)
        if not element.shows_sky:
            _add(others, found, gain, chosen)
    for found, gain in between or ():
        for into in (total, others):
            _add(into, found, gain, chosen)
    return Arriving(total, others, beams)


def _add(total: F32, found: Found, gain: Rgb, chosen: NDArray[np.intp] | None) -> None:
    is_of_all = found.rows is None
    rows = chosen if is_of_all else found.rows
    add_scaled(total, found.vectors, np.array(gain, np.float32), rows, is_of_all=is_of_all)


def wholly(transfer: MovingTransfer, light: Light, *, has_beams: bool = False) -> Arriving:
    """Find what arrives at all points, where it is not known too.

    Args:
        transfer: of the points. light: that arrives. has_beams: pixels find the shadows of beams.
    """
    beams = transfer.beams(light, None) if has_beams else ()
    return summed(transfer, light, lambda element: Found(transfer.vectors(element, has_beams)), beams)
