"""What surfaces send each other while a hand moves: of the light as it was some frames ago, and of a change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.look.model import Rgb
from relume.moving.transfer import MovingTransfer
from relume.moving.vectors.arriving import Arriving, Found
from relume.picture.light import Light, vector_of
from relume.project.light_vectors import add_scaled

F32 = NDArray[np.float32]


class Between(NamedTuple):
    """What surfaces send to points under a light.

    Attributes:
        light: that they send. is_there: points that all of it has been found for. (points,) uint8
        exact: what is known of some sources, with their gains. quick: of the others, of points that were asked about.
    """

    light: Light
    is_there: NDArray[np.uint8]
    exact: Mapping[Light, tuple[Found, Rgb]]
    quick: Sequence[tuple[Found, Rgb]]

    @property
    def parts(self) -> Sequence[tuple[Found, Rgb]]:
        """All of it."""
        return [*self.exact.values(), *self.quick]


def is_between_same(one: Light, other: Light) -> bool:
    """Whether surfaces send each other the same under two lights."""
    return _alone(one) == _alone(other)


def _alone(light: Light) -> Light:
    return light._replace(paths=light.paths.without_direct())


def _elements(light: Light) -> dict[Light, Rgb]:
    """What surfaces send of the light of each source, gain 1, and its gain."""
    return {element: gain for element, gain in vector_of(light).items() if element.paths.reflect}


def are_known(transfer: MovingTransfer, light: Light) -> bool:
    """Whether all that surfaces send under a light is there at once."""
    return all(transfer.knows(element, beside_suns=False) for element in _elements(light))


def between_of(transfer: MovingTransfer, light: Light, is_needed: NDArray[np.uint8]) -> Between:
    """Find what surfaces send to some points, exactly where that is known, else quickly.

    Args:
        transfer: of the points. light: that surfaces send. is_needed: points that are asked about. (points,) uint8
    """
    exact = {
        element: (Found(transfer.vectors(element, beside_suns=False)), gain)
        for element, gain in _elements(light).items()
        if transfer.knows(element, beside_suns=False)
    }
    return widened(transfer, Between(light, np.zeros_like(is_needed), exact, ()), is_needed)


def widened(transfer: MovingTransfer, between: Between, is_needed: NDArray[np.uint8]) -> Between:
    """Find the same for points that it has not been found for: those that an eye sees since.

    Args:
        transfer, is_needed: as of `between_of`. between: what has been found.
    """
    new = np.flatnonzero(is_needed & ~between.is_there)
    if not len(new):
        return between
    found = [
        (Found(transfer.preview_vectors(element, new, beside_suns=False), new), gain)
        for element, gain in _elements(between.light).items()
        if element not in between.exact
    ]
    return between._replace(is_there=between.is_there | is_needed, quick=[*between.quick, *found])


def changed(
    transfer: MovingTransfer, before: Light, known: Arriving, light: Light, chosen: NDArray[np.intp]
) -> Arriving:
    """Find what arrives at some points where surfaces reflect otherwise than before, quickly: what arrived, changed.

    Args:
        transfer: of the points. before: a light of the same sources. known: what arrives of it, exactly.
        light: that arrives. chosen: points that are asked about. (n,)
    """
    change, found = transfer.change_between(before, light, chosen), known.copy()
    for into in (found.total, found.others):
        add_scaled(into, change, np.ones(3, np.float32), chosen)
    return found
