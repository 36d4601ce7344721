"""Light vectors made beside the frames; both are a `relume.picture.jobs.Job`."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from relume.errors import CancelledError
from relume.moving.transfer import MovingTransfer
from relume.moving.vectors.arriving import Arriving, Found, summed
from relume.parallel import beside_frames
from relume.picture.jobs import Cancelled, Progress
from relume.picture.light import Light, vector_of


@dataclass(frozen=True)
class LightJob:
    """What arrives, exactly, when a hand rests.

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
    goes_on = False

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
        return summed(self.transfer, self.light, found, beams)

    def install(self, made: Arriving) -> None:
        """Hand it over."""
        self.take(self.light, self.has_beams, made)


@dataclass(frozen=True)
class FollowJob:
    """What surfaces send each other under a hand, quickly: some frames behind it, and never given up for a newer look.

    Attributes:
        light: of the look when it was begun. find: finds it. take: gets it when it is there.
    """

    light: Light
    find: Callable[[], Any]
    take: Callable[[Any], None]

    what = "light between surfaces"
    state: ClassVar[Literal["following"]] = "following"
    refines = False
    goes_on = False

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Jobs of one light are one."""
        return "light that follows", self.light

    def make(self, progress: Progress, cancelled: Cancelled) -> Any:
        """Find it, by threads that let frames go first."""
        with beside_frames():
            return self.find()

    def install(self, made: Any) -> None:
        """Hand it over."""
        self.take(made)
