"""A moving picture that becomes exact when its eye rests: a still of that place replaces it, until the eye moves on.

Until the still is there the moving picture is corrected by a few exact samples, which are there at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.errors import ParameterError
from relume.look import Look
from relume.memory import Memory
from relume.moving.fine_job import FineJob
from relume.moving.picture import MovingPicture
from relume.moving.rest.still_jobs import ExactView, Eye, MakeStill, SparseJob, StillJob
from relume.moving.shader.tables import Numbers, Part
from relume.moving.vectors.jobs import FollowJob, LightJob
from relume.picture.light import Solo
from relume.picture.picture import Advance, Picture
from relume.scene.model import Camera

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class RestingPicture:
    """Two pictures of one view that take turns; one session's, used from one thread at a time.

    Args:
        moving: shown while the eye moves, and until there is something better.
        make_still: finds what an eye sees; heavy. memory: of what is made for stills.
    """

    def __init__(self, moving: MovingPicture, make_still: MakeStill, memory: Memory) -> None:
        self._moving, self._make_still, self._memory = moving, make_still, memory
        self._number, self._num_looks, self._rests = 0, 0, True
        self._compared: tuple[int, int] | None = None  # numbers of eye and look that a few exact samples were found for
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
        """What a shader needs to draw the moving picture; None while it is corrected, or the still is shown."""
        is_drawn_here = self._shown is self._still or self._moving.is_corrected
        return None if is_drawn_here else self._moving.parts()

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
        wanted = ExactView(self._make_still, self._memory, self._moving.eye, self._look, self._solo)
        asked = self._number, self._num_looks
        if self._compared != asked and SparseJob.is_worth(wanted):
            return SparseJob(wanted, copy(self._moving), ("sparse", *asked), partial(self._correct, asked))
        return StillJob(wanted, ("still", *asked), partial(self._take, self._number))

    def _correct(self, asked: tuple[int, int], by: F32 | None) -> None:
        if asked == (self._number, self._num_looks):  # else the hand has moved on
            self._compared = asked
            self._moving.correct(by)

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
        if isinstance(job, StillJob | SparseJob | FollowJob | LightJob | FineJob):
            job.install(made)
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
        self._moving.correct(None)
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
            NotMadeError: no still is shown.
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
