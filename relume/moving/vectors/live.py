"""The light vectors of one session's moving picture, under a light that changes.

What is exact is found when a hand rests. While it moves, light that comes straight is found at once for the points that
an eye sees, in every frame. What surfaces send each other takes longer than a frame: it is found beside the frames,
which show what was found last (`relume.moving.vectors.jobs.FollowJob`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.moving.transfer import MovingTransfer
from relume.moving.vectors.arriving import Arriving, Found, summed, wholly
from relume.moving.vectors.between import Between, are_known, between_of, changed, is_between_same, widened
from relume.moving.vectors.jobs import FollowJob, LightJob
from relume.picture.light import Light, is_same_but_for_surfaces, vector_of


class Asked(NamedTuple):
    """What is to arrive.

    Attributes:
        light: of the look. has_beams: pixels find the shadows of beams.
    """

    light: Light
    has_beams: bool


class _Changed(NamedTuple):
    """What is exact, with what surfaces send otherwise.

    Attributes:
        base: that it was made from. light: that arrives. is_there: points that know it. (points,) uint8
    """

    base: Arriving
    light: Light
    is_there: NDArray[np.uint8]
    arriving: Arriving


class _Rough(NamedTuple):
    """What was found in a frame, and of what."""

    direct: Asked
    is_needed: NDArray[np.uint8]
    between: Between
    arriving: Arriving


class LiveVectors:
    """State of one picture; used from one thread at a time.

    Attributes:
        version: another one where what follows a hand has gone on.
    """

    def __init__(self, transfer: MovingTransfer) -> None:
        self._transfer = transfer
        self._exact: tuple[Asked, Arriving] | None = None
        self._changed: _Changed | None = None
        self._between: Between | None = None
        self._rough: _Rough | None = None
        self.version = 0

    def are_there(self, asked: Asked) -> bool:
        """Whether nobody has to wait for what is exact."""
        is_found = self._exact is not None and self._exact[0] == asked
        return is_found or all(self._transfer.knows(one, asked.has_beams) for one in vector_of(asked.light))

    def follow(self, asked: Asked) -> bool:
        """Whether all that somebody would wait for is what surfaces send each other."""
        if self._exact is None:
            return False
        before, has_beams = self._exact[0]
        return has_beams == asked.has_beams and is_same_but_for_surfaces(before, asked.light)

    def exactly(self, asked: Asked) -> Arriving:
        """All of it, at all points."""
        if self._exact is None or self._exact[0] != asked:
            self.take(*asked, wholly(self._transfer, asked.light, has_beams=asked.has_beams))
        assert self._exact is not None
        return self._exact[1]

    def take(self, light: Light, has_beams: bool, arriving: Arriving) -> None:
        """Go on from what is exact.

        Args:
            light, has_beams: under which, see `Asked`. arriving: at all points.
        """
        self._exact = Asked(light, has_beams), arriving
        self._changed = self._between = self._rough = None

    def quickly(self, asked: Asked, is_needed: NDArray[np.uint8]) -> Arriving:
        """What is there at once for some points; what surfaces send, as of some frames ago.

        Args:
            asked: what is to arrive. is_needed: points that are asked about. (points,) uint8
        """
        if self.follow(asked):
            assert self._exact is not None
            return self._exact[1] if self._changed is None else self._changed.arriving
        self._between = between = self._last_between(asked.light, is_needed)
        direct = asked._replace(light=asked.light._replace(reflectances=()))
        last = self._rough
        is_same = last is not None and last.between is between and last.is_needed is is_needed
        if last is None or not is_same or last.direct != direct:
            self._rough = last = _Rough(direct, is_needed, between, self._direct(asked, is_needed, between))
        return last.arriving

    def _direct(self, asked: Asked, is_needed: NDArray[np.uint8], between: Between) -> Arriving:
        """Find what comes straight, and add the rest."""
        transfer, (light, has_beams), chosen = self._transfer, asked, np.flatnonzero(is_needed)

        def found(element: Light) -> Found:
            if transfer.knows(element, has_beams):
                return Found(transfer.vectors(element, has_beams))
            return Found(transfer.preview_vectors(element, chosen, has_beams), chosen)

        beams = transfer.beams(light, chosen) if has_beams else ()
        return summed(transfer, light, found, beams, between.parts, chosen)

    def _last_between(self, light: Light, is_needed: NDArray[np.uint8]) -> Between:
        """What surfaces sent when that was found last, or now where it never was."""
        transfer, last = self._transfer, self._between
        if last is None or last.light.paths.reflect != light.paths.reflect:
            before = light if self._exact is None else self._exact[0].light
            is_kept = before.paths.reflect == light.paths.reflect and are_known(transfer, before)
            last = between_of(transfer, before if is_kept else light, is_needed)
        return widened(transfer, last, is_needed)

    def next_job(self, asked: Asked, is_needed: NDArray[np.uint8]) -> FollowJob | LightJob:
        """What brings light that is not there: first what surfaces send some points, then all there is.

        Args:
            asked, is_needed: as of `quickly`, after it.
        """
        transfer, (light, has_beams) = self._transfer, asked
        if self.follow(asked):
            assert self._exact is not None
            before, base = self._exact[0].light, self._exact[1]
            last = self._changed
            if last is None or last.light != light or (is_needed & ~last.is_there).any():
                return FollowJob(light, lambda: self._change(before, base, light, is_needed), self._take_changed)
        elif self._between is not None and light.paths.reflect and not is_between_same(self._between.light, light):
            return FollowJob(light, lambda: between_of(transfer, light, is_needed), self._take_between)
        return LightJob(transfer, light, has_beams, self.take)

    def _change(self, before: Light, base: Arriving, light: Light, is_needed: NDArray[np.uint8]) -> _Changed:
        arriving = changed(self._transfer, before, base, light, np.flatnonzero(is_needed))
        return _Changed(base, light, is_needed, arriving)

    def _take_changed(self, made: _Changed) -> None:
        if self._exact is not None and made.base is self._exact[1]:  # else the light has moved
            self._changed, self.version = made, self.version + 1

    def _take_between(self, made: Between) -> None:
        if self._between is not None:  # else all is exact by now
            self._between, self.version = made, self.version + 1
