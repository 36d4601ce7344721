"""What arrives at the points of a moving picture: summed over sources, found at once or beside the frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.errors import CancelledError
from relume.moving.beams.beam import Beam
from relume.moving.transfer import MovingTransfer
from relume.picture.jobs import Cancelled, Progress
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


class Found(NamedTuple):
    """Light vectors of some points.

    Attributes:
        vectors: of fewer functions, maybe. (m, 3, ≤ K) float32. rows: the points. (m,); None: all.
    """

    vectors: F32
    rows: NDArray[np.intp] | None = None


def arriving(
    transfer: MovingTransfer, light: Light, vectors_of: Callable[[Light], Found], beams: tuple[Beam, ...] = ()
) -> Arriving:
    """Sum over sources: transport is linear in them.

    Args:
        transfer: of the points. light: that arrives.
        vectors_of: finds those of one source and one kind of way, suns that are beams left out.
        beams: of the light.
    """
    total, others = (np.zeros(transfer.vectors_shape, np.float32) for _ in range(2))
    of_beams = {beam.key for beam in beams}
    for element, gain in vector_of(light).items():
        (part, rows), factor = vectors_of(element), np.array(gain, np.float32)
        if not (element.paths.direct and any(lamp in of_beams for lamp, _ in element.local)):
            add_scaled(total, part, factor, rows)
        if not (element.paths.direct and element.is_environment_lit):
            add_scaled(others, part, factor, rows)
    return Arriving(total, others, beams)


def wholly(transfer: MovingTransfer, light: Light, *, has_beams: bool = False) -> Arriving:
    """Find what arrives at all points, where it is not known too.

    Args:
        transfer: of the points. light: that arrives. has_beams: pixels find the shadows of beams.
    """
    beams = transfer.beams(light, None) if has_beams else ()
    return arriving(transfer, light, lambda element: Found(transfer.vectors(element, has_beams)), beams)


def roughly(transfer: MovingTransfer, light: Light, chosen: NDArray[np.intp], *, has_beams: bool = False) -> Arriving:
    """Find what arrives at some points quickly, where it is not known.

    Args:
        transfer: of the points. light: that arrives. chosen: points that are asked about. (n,)
        has_beams: pixels find the shadows of beams.
    """

    def found(element: Light) -> Found:
        if transfer.knows(element, has_beams):
            return Found(transfer.vectors(element, has_beams))
        return Found(transfer.preview_vectors(element, chosen, has_beams), chosen)

    return arriving(transfer, light, found, transfer.beams(light, chosen) if has_beams else ())


def followed(
    transfer: MovingTransfer, before: Light, known: Arriving, light: Light, chosen: NDArray[np.intp]
) -> Arriving:
    """Find what arrives at some points where surfaces reflect otherwise than before, quickly: what arrived, changed.

    Args:
        transfer: of the points. before: a light of the same sources. known: what arrives of it, exactly.
        light: that arrives. chosen: points that are asked about. (n,)
    """
    change, all_of_it = transfer.change_between(before, light, chosen), np.ones(3, np.float32)
    found = known._replace(total=known.total.copy(), others=known.others.copy())
    for vectors in (found.total, found.others):
        add_scaled(vectors, change, all_of_it, chosen)
    return found


@dataclass(frozen=True)
class LightJob:
    """What arrives, made beside the frames; a `relume.picture.jobs.Job`.

    Attributes:
        has_beams: pixels find the shadows of beams. take: gets it when it is there.
    """

    transfer: MovingTransfer
    light: Light
    has_beams: bool
    take: Callable[[Light, bool, Arriving], None]

    what = "light on the points"
    state: ClassVar[Literal["shading"]] = "shading"
    refines = True

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Jobs of one light are one."""
        return self.transfer.key, "light vectors", self.light, self.has_beams

    def make(self, progress: Progress, cancelled: Cancelled) -> Arriving:
        """Find it, source by source. Raises CancelledError where `cancelled`, asked before each, said so."""
        num, done = len(vector_of(self.light)), 0

        def found(element: Light) -> Found:
            nonlocal done
            if cancelled():
                raise CancelledError("light on the points was cancelled")
            vectors, done = self.transfer.vectors(element, self.has_beams), done + 1
            progress(done / num)
            return Found(vectors)

        beams = self.transfer.beams(self.light, None) if self.has_beams else ()
        return arriving(self.transfer, self.light, found, beams)

    def install(self, made: Arriving) -> None:
        """Hand it over."""
        self.take(self.light, self.has_beams, made)
