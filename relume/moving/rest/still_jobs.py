"""What is made where an eye rests: a few exact samples, which correct the moving picture, then the exact picture."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.errors import CancelledError, NotMadeError, RelumeError
from relume.look import Look
from relume.memory import Memory
from relume.moving.correction import Places, correction
from relume.moving.picture import MovingPicture
from relume.picture.finish import finish
from relume.picture.jobs import Cancelled, Progress
from relume.picture.light import Solo
from relume.picture.picture import Picture
from relume.picture.transfer import Transfer
from relume.scene.model import Camera

F32 = NDArray[np.float32]
Eye = tuple[Camera, tuple[int, int]]

TRACING = 0.5  # of what a still tells to be done; the rest is shading
STEP = 8  # pixels from one sparse sample to the next
_FEWEST_SPARSE = 1000  # samples; with fewer the exact picture itself is as soon there


class MakeStill(Protocol):
    """Finds what an eye sees: an opened bake of this one fixed view."""

    def __call__(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: Progress,
        cancelled: Cancelled,
        *,
        smooths_edges: bool = True,
    ) -> Transfer:
        """Trace it; see `relume.methods.stills.Stills.make`."""
        ...


@dataclass(frozen=True)
class ExactView:
    """What is to be seen exactly.

    Attributes:
        make_still: finds what it sees; heavy. memory: of what is made for the picture.
        eye: camera, and size of its picture. look, solo: that it is shown in.
    """

    make_still: MakeStill
    memory: Memory
    eye: Eye
    look: Look
    solo: Solo

    @property
    def reflects(self) -> bool:
        """Whether light between surfaces is shown."""
        return self.look.transport.paths.reflect

    def picture(self, progress: Progress, cancelled: Cancelled, *, smooths_edges: bool = True) -> Picture:
        """Trace and shade it.

        Args:
            progress: called with about the share done. cancelled: asked now and then.
            smooths_edges: whether pixels across edges have several samples.
        Raises:
            CancelledError: `cancelled` said so.
        """
        (camera, size), look = self.eye, self.look
        transfer = self.make_still(
            camera, size, self.reflects, lambda share: progress(TRACING * share), cancelled, smooths_edges=smooths_edges
        )
        picture = Picture(transfer, next(iter(transfer.views)), self.memory)
        picture.set_look(look, solo=self.solo)
        finish(picture, look, lambda share: progress(TRACING + (1 - TRACING) * share), cancelled)
        return picture


@dataclass(frozen=True)
class SparseJob:
    """By how much a moving picture's straight light is off, from few samples; a `relume.picture.jobs.Job`.

    Attributes:
        wanted: what is to be seen exactly. moving: the picture that is off, for this job alone.
        key: equal for jobs of one eye and look. take: gets what was made; None where nothing is to be corrected.
    """

    wanted: ExactView
    moving: MovingPicture
    key: tuple[Hashable, ...]
    take: Callable[[F32 | None], None]

    what = "a first exact look from here"
    state: ClassVar[Literal["shading"]] = "shading"
    refines = True
    goes_on = False

    @staticmethod
    def is_worth(wanted: ExactView) -> bool:
        """Whether light comes straight, to a picture that is large enough."""
        width, height = wanted.eye[1]
        return wanted.look.transport.paths.direct and (width // STEP) * (height // STEP) >= _FEWEST_SPARSE

    def make(self, progress: Progress, cancelled: Cancelled) -> F32 | None:
        """Trace, shade and compare. (height, width, 3). Raises CancelledError where `cancelled` said so."""
        moving, (camera, size), seen = self.moving, self.wanted.eye, self.moving.seen
        if len(seen.panes.ray):  # of what glass shows and what is behind it, each is off by something else
            return None
        transport = self.wanted.look.transport.model_copy(update={"show": "direct"})
        look = self.wanted.look.model_copy(update={"transport": transport})
        few = size[0] // STEP, size[1] // STEP
        straight = replace(self.wanted, eye=(camera, few), look=look)
        try:
            exact = straight.picture(progress, cancelled, smooths_edges=False).image()
        except CancelledError:
            raise
        except RelumeError:  # the scene is gone, or it needs more memory than there is
            return None
        moving.set_look(look, solo=straight.solo)
        radiance, seen_by_few = moving.along_middles(few)
        of_samples = Places.of(moving.surface, seen_by_few, camera, few[0]).off_edges(seen.owner, size)
        of_pixels = Places.of(moving.surface, seen.middles(size[0] * size[1]), camera, size[0])
        by = correction(radiance, exact, of_samples, of_pixels)
        return by if by.any() else None

    def install(self, made: F32 | None) -> None:
        """Hand it over."""
        self.take(made)


@dataclass(frozen=True)
class StillJob:
    """The exact picture of where an eye rests, made beside the frames; a `relume.picture.jobs.Job`.

    Attributes:
        wanted: what is made; looks that came meanwhile are followed from there.
        key: jobs of one eye and look are one: while hands edit, nothing takes a core from them.
        take: gets whether light between surfaces can be shown, and the picture when it is there; None where it cannot
            be had.
    """

    wanted: ExactView
    key: tuple[Hashable, ...]
    take: Callable[[bool, Picture | None], None]

    what = "the exact picture from here"
    state: ClassVar[Literal["shading"]] = "shading"
    refines = True
    goes_on = False

    def make(self, progress: Progress, cancelled: Cancelled) -> Picture | NotMadeError:
        """Trace and shade it, or why not. Raises CancelledError where `cancelled`, asked now and then, said so."""
        try:
            return self.wanted.picture(progress, cancelled)
        except CancelledError:
            raise
        except RelumeError as error:  # the scene is gone, or it needs more memory than there is
            return NotMadeError(f"the moving picture stays: {self.what} cannot be had, for {error}")

    def install(self, made: Picture | NotMadeError) -> None:
        """Hand it over."""
        self.take(self.wanted.reflects, None if isinstance(made, NotMadeError) else made)
