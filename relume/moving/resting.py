"""A moving picture that becomes exact when its eye rests: a still of that place replaces it, until the eye moves on."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from relume.errors import CancelledError, ParameterError, RelumeError
from relume.look import Look
from relume.memory import Memory
from relume.moving.arriving import LightJob
from relume.moving.picture import MovingPicture
from relume.moving.shader.tables import Numbers, Part
from relume.picture.finish import finish
from relume.picture.jobs import Cancelled, Progress
from relume.picture.light import Solo
from relume.picture.picture import Advance, Picture
from relume.picture.transfer import Transfer
from relume.scene.model import Camera

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]
Eye = tuple[Camera, tuple[int, int]]
MakeStill = Callable[[Camera, tuple[int, int], bool, Progress, Cancelled], Transfer]
"""Finds what an eye sees, in a picture of this size: an opened bake of this one fixed view, with light between surfaces
where that is wanted."""

TRACING = 0.5  # of what a still tells to be done; the rest is shading


def exact_picture(
    make_still: MakeStill, eye: Eye, look: Look, solo: Solo, memory: Memory, progress: Progress, cancelled: Cancelled
) -> Picture:
    """Trace and shade what an eye sees.

    Args:
        make_still: finds what it sees. eye: camera, and size of its picture. look, solo: that it is shown in.
        memory: of what is made for the picture. progress: called with about the share done.
        cancelled: asked now and then.
    Raises:
        CancelledError: `cancelled` said so.
    """
    transfer = make_still(*eye, _reflects(look), lambda share: progress(TRACING * share), cancelled)
    picture = Picture(transfer, next(iter(transfer.views)), memory)
    picture.set_look(look, solo=solo)
    finish(picture, look, lambda share: progress(TRACING + (1 - TRACING) * share), cancelled)
    return picture


@dataclass(frozen=True)
class StillJob:
    """The exact picture of where an eye rests, made beside the frames; a `relume.picture.jobs.Job`.

    Attributes:
        number: of the eye, among those that the picture was given. num_looks: that it was given, too.
        look, solo: that the picture is made in; others that came meanwhile are followed from there.
        take: gets the number of the eye, whether light between surfaces can be shown, and the picture when it is there;
            None where it cannot be had.
    """

    make_still: MakeStill
    memory: Memory
    eye: Eye
    number: int
    num_looks: int
    look: Look
    solo: Solo
    take: Callable[[int, bool, Picture | None], None]

    what = "the exact picture from here"
    state: ClassVar[Literal["shading"]] = "shading"
    refines = True

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Jobs of one eye and look are one: while hands edit, nothing takes a core from them."""
        return "still", self.number, self.num_looks

    def make(self, progress: Progress, cancelled: Cancelled) -> Picture | None:
        """Trace and shade it. Raises CancelledError where `cancelled`, asked now and then, said so."""
        try:
            return exact_picture(self.make_still, self.eye, self.look, self.solo, self.memory, progress, cancelled)
        except CancelledError:
            raise
        except RelumeError:  # the scene is gone, or it needs more memory than there is: the moving picture stays
            return None

    def install(self, made: Picture | None) -> None:
        """Hand it over."""
        self.take(self.number, _reflects(self.look), made)


class RestingPicture:
    """Two pictures of one view that take turns; one session's, used from one thread at a time.

    Args:
        moving: shown while the eye moves, and until there is something better.
        make_still: finds what an eye sees; heavy. memory: of what is made for stills.
    """

    def __init__(self, moving: MovingPicture, make_still: MakeStill, memory: Memory) -> None:
        self._moving, self._make_still, self._memory = moving, make_still, memory
        self._number, self._num_looks, self._rests = 0, 0, True
        self._still: Picture | None = None
        self._has_reflections = False  # the still, if a look wants them
        self._is_still = False  # the still is what is shown
        self._is_asked_again = False  # for a picture from the eye that it has
        self._look: Look | None = None
        self._hand: str | None = None
        self._touched: str | None = None
        self._solo: Solo = None

    @property
    def _shown(self) -> MovingPicture | Picture:
        return self._still if self._still is not None and self._is_still else self._moving

    def check(self, look: Look) -> None:
        """Whether a look can be shown at all; see `Picture.check`."""
        self._shown.check(look)

    def set_look(self, look: Look, *, hand: str | None = None, solo: Solo = None) -> None:
        """A new target for both; nothing is computed yet.

        Args:
            look: that is to be shown. hand: pointer to what the user's hand is on, or None.
            solo: names of sources of light that alone are shown; None: all.
        Raises:
            ParameterError, NotFoundError, SceneError: as by `Picture.set_look`; both stay as they were.
        """
        still = self._still if self._has_reflections or not _reflects(look) else None
        if still is not None:  # first, for it refuses whatever the other does
            still.set_look(look, hand=hand, solo=solo)
        self._moving.set_look(look, hand=hand, solo=solo)
        if still is None:
            self._still, self._is_still = None, False
        self._look, self._hand, self._solo = look, hand, solo
        self._num_looks += 1

    def set_eye(self, camera: Camera, size: tuple[int, int], *, rests: bool = True) -> None:
        """See from elsewhere; nothing is computed yet.

        Args:
            camera: a rigid one. size: width and height in pixels.
            rests: an exact picture is to follow.
        """
        self._rests = rests
        if _is_same(self._moving.eye, (camera, size)):
            self._is_asked_again = True
            return
        self._moving.set_eye(camera, size)
        self._number += 1
        self._still, self._is_still = None, False

    @property
    def draws(self) -> bool:
        """Whether the pixels of the moving picture are wanted at every step; see `MovingPicture`."""
        return self._moving.draws

    @draws.setter
    def draws(self, draws: bool) -> None:
        self._moving.draws = draws

    def parts(self) -> tuple[dict[str, Part], Numbers] | None:
        """What a shader needs to draw the moving picture; None while the still is shown."""
        return None if self._shown is self._still else self._moving.parts()

    def touch(self, pointer: str) -> None:
        """Prepare what a hand takes hold of; see `Picture.touch`."""
        self._shown.touch(pointer)
        self._touched = pointer

    def next_job(self) -> Any:
        """What must be made next; a still last."""
        if self._still is not None:
            return self._still.next_job()
        job = self._moving.next_job()
        if job is not None or not self._rests or self._look is None:
            return job
        wanted = self._number, self._num_looks, self._look, self._solo
        return StillJob(self._make_still, self._memory, self._moving.eye, *wanted, self._take)

    def _take(self, number: int, has_reflections: bool, still: Picture | None) -> None:
        if number != self._number or self._look is None:
            return
        if still is None:
            self._rests = False
            return
        if _reflects(self._look) and not has_reflections:  # asked for meanwhile: it goes on from what was traced
            return
        still.set_look(self._look, hand=self._hand, solo=self._solo)
        if self._touched is not None:
            with suppress(ParameterError):  # an edit may have removed it
                still.touch(self._touched)
        self._still, self._has_reflections = still, has_reflections

    def install(self, job: Any, made: Any) -> None:
        """Go on with what a job has made."""
        if isinstance(job, StillJob):
            job.install(made)
        elif isinstance(job, LightJob):
            self._moving.install(job, made)
        elif self._still is not None:  # else it was made for one that is gone
            self._still.install(job, made)

    def advance(self, max_coefficients: int | None) -> Advance:
        """Bring what is shown to its look and its eye; a still is shown once it is exact, and from then on."""
        step = self._step(max_coefficients)
        if not self._is_asked_again:
            return step
        self._is_asked_again = False
        return replace(step, tiles=self.all_tiles())

    def _step(self, max_coefficients: int | None) -> Advance:
        if self._still is None:
            return self._moving.advance(max_coefficients)
        step = self._still.advance(max_coefficients)
        if self._is_still:
            return step
        if not step.exact:
            return self._moving.advance(max_coefficients)
        self._is_still = True
        return replace(step, tiles=self._still.all_tiles(), was_off=self._was_off(self._still))

    def _was_off(self, still: Picture) -> float | None:
        """How far the moving picture is from a still, relative RMS; None where it has not caught up, or all is dark."""
        if self._moving.advance(None).fidelity != "approximate":
            return None
        exact = still.image()
        size = float(np.mean(np.square(exact, dtype=np.float64)))
        return float(np.sqrt(np.mean((self._moving.image() - exact) ** 2) / size)) if size else None

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the picture."""
        return self._shown.all_tiles()

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Payload of a frame; see `Picture.encode`."""
        return self._shown.encode(tiles, form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """How much it hides of what is behind it; see `Picture.encode_alpha`."""
        return self._shown.encode_alpha(tiles)

    def image(self) -> F32:
        """Linear radiance. (height, width, 3) float32"""
        return self._shown.image()

    def probe(self, x: int, y: int) -> dict[str, Any]:
        """What makes up a pixel; see `Picture.probe`. Raises ParameterError where it lies outside the picture."""
        return self._shown.probe(x, y)

    def brush(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """Which pixels a stretch of a curve lights; see `Picture.brush`.

        Args:
            pointer: to a curve. from_deg, to_deg: ends of a stretch of it, degrees.
        Raises:
            EditNotSupportedError: no still is shown.
        """
        return self._shown.brush(pointer, from_deg, to_deg)


def _reflects(look: Look) -> bool:
    """Whether a look shows light between surfaces."""
    return look.transport.paths.reflect


def _is_same(one: Eye, other: Eye) -> bool:
    (camera, size), (other_camera, other_size) = one, other
    return bool(
        size == other_size
        and camera.yfov == other_camera.yfov
        and np.array_equal(camera.to_world, other_camera.to_world)
    )
