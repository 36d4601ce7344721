"""A free-camera image that becomes exact when the camera stops: a static view replaces it until the camera moves.

Until the static view is ready, a few exact samples, which take little time, correct the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.fixed_camera.illumination import Solo
from relume.live.fixed_camera.picture import Picture, Progress
from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.probe_light.jobs import IncrementalProbeLightJob, ProbeLightJob
from relume.live.free_camera.refine_job import RefineHighlights
from relume.live.free_camera.refinement.refinement_jobs import (
    SizedCamera,
    SparseExactJob,
    StaticViewFactory,
    StaticViewJob,
    StaticViewState,
)
from relume.look import Look
from relume.scene.model import Camera

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class ProgressivePicture:
    """The free-camera image and the static view of one session; used from one thread at a time.

    Args:
        free_camera_picture: displayed until there is a static view.
        make_static_view: traces a fixed view; expensive. cache: for results of static views.
    """

    def __init__(
        self, free_camera_picture: FreeCameraPicture, make_static_view: StaticViewFactory, cache: Cache
    ) -> None:
        self._free_camera_picture, self._make_static_view, self._cache = free_camera_picture, make_static_view, cache
        self._camera_seq, self._look_seq, self._is_idle = 0, 0, True
        self._corrected_for: tuple[int, int] | None = None  # camera and look of the last residual
        self._static_picture: Picture | None = None
        self._has_indirect = False  # the static view has indirect light, if the look shows it
        self._is_static = False  # the static view is displayed
        self._must_resend = False  # the client set the same camera again
        self._look: Look | None = None
        self._active_pointer: str | None = None
        self._prepared_pointer: str | None = None
        self._solo: Solo = None

    @property
    def _displayed(self) -> FreeCameraPicture | Picture:
        return (
            self._static_picture if self._static_picture is not None and self._is_static else self._free_camera_picture
        )

    def check(self, look: Look) -> None:
        """Check that a look can be shown; see `Picture.check`."""
        self._displayed.check(look)

    def set_look(self, look: Look, *, active_pointer: str | None = None, solo: Solo = None) -> None:
        """Set a new target for both images; nothing is computed yet.

        Args:
            look: the target. active_pointer: pointer to the active control, or None.
            solo: names of the only light sources to show; None: all.
        Raises:
            ParameterError, NotFoundError, SceneError: as `Picture.set_look`; both images are unchanged.
        """
        static_picture = self._static_picture if self._has_indirect or not _has_indirect(look) else None
        if static_picture is not None:  # first, since it raises whenever the other does
            static_picture.set_look(look, active_pointer=active_pointer, solo=solo)
        self._free_camera_picture.set_look(look, active_pointer=active_pointer, solo=solo)
        if static_picture is None:
            self._static_picture, self._is_static = None, False
        self._look, self._active_pointer, self._solo = look, active_pointer, solo
        self._look_seq += 1

    def set_camera(self, camera: Camera, size: tuple[int, int], *, is_idle: bool = True) -> None:
        """Set the camera and the image size; nothing is computed yet.

        Args:
            camera: with a rigid transform. size: width and height in pixels.
            is_idle: an exact image follows.
        """
        self._is_idle = is_idle
        if _is_same_camera(self._free_camera_picture.sized_camera, (camera, size)):
            self._must_resend = True
            return
        self._free_camera_picture.set_camera(camera, size)
        self._camera_seq += 1
        self._static_picture, self._is_static = None, False

    @property
    def renders_pixels(self) -> bool:
        """True if the server renders the free-camera image at every step; see `FreeCameraPicture`."""
        return self._free_camera_picture.renders_pixels

    @renders_pixels.setter
    def renders_pixels(self, draws: bool) -> None:
        self._free_camera_picture.renders_pixels = draws

    def array_blocks(self) -> tuple[dict[str, ArrayBlock], ShaderConstants] | None:
        """Return the arrays for a browser's renderer; None while a residual or a static view is displayed."""
        is_server_rendered = self._displayed is self._static_picture or self._free_camera_picture.is_corrected
        return None if is_server_rendered else self._free_camera_picture.array_blocks()

    def prepare(self, pointer: str) -> None:
        """Prepare a control before its first edit; see `Picture.prepare`."""
        self._displayed.prepare(pointer)
        self._prepared_pointer = pointer

    def next_job(self) -> Any:
        """Return the next job; a static view comes last."""
        if self._static_picture is not None:
            return self._static_picture.next_job()
        job = self._free_camera_picture.next_job()
        if job is not None or not self._is_idle or self._look is None:
            return job
        view_state = StaticViewState(
            self._make_static_view, self._cache, self._free_camera_picture.sized_camera, self._look, self._solo
        )
        request = self._camera_seq, self._look_seq
        if self._corrected_for != request and SparseExactJob.should_refine(view_state):
            return SparseExactJob(
                view_state, copy(self._free_camera_picture), ("sparse", *request), partial(self._correct, request)
            )
        return StaticViewJob(view_state, ("still", *request), partial(self._install_static_picture, self._camera_seq))

    def _correct(self, request: tuple[int, int], residual_image: F32 | None) -> None:
        if request == (self._camera_seq, self._look_seq):  # else the camera or look has changed
            self._corrected_for = request
            self._free_camera_picture.correct(residual_image)

    def _install_static_picture(self, camera_seq: int, has_indirect: bool, static_picture: Picture | None) -> None:
        if camera_seq != self._camera_seq or self._look is None:
            return
        if static_picture is None:
            self._is_idle = False
            return
        if _has_indirect(self._look) and not has_indirect:  # requested meanwhile: it reuses the traced rays
            return
        static_picture.set_look(self._look, active_pointer=self._active_pointer, solo=self._solo)
        if self._prepared_pointer is not None:
            with suppress(ParameterError):  # an edit may have removed it
                static_picture.prepare(self._prepared_pointer)
        self._static_picture, self._has_indirect = static_picture, has_indirect

    def install(self, job: Any, result: Any) -> None:
        """Use the result of a job."""
        if isinstance(
            job, StaticViewJob | SparseExactJob | IncrementalProbeLightJob | ProbeLightJob | RefineHighlights
        ):
            job.install(result)
        elif self._static_picture is not None:  # else its static view was dropped
            self._static_picture.install(job, result)

    def advance(self, max_coefficients: int | None) -> Progress:
        """Update the displayed image to its look and camera; a static view is displayed once it is exact."""
        step = self._step(max_coefficients)
        if not self._must_resend:
            return step
        self._must_resend = False
        return replace(step, tiles=self.all_tiles())

    def _step(self, max_coefficients: int | None) -> Progress:
        if self._static_picture is None:
            return self._free_camera_picture.advance(max_coefficients)
        step = self._static_picture.advance(max_coefficients)
        if self._is_static:
            return step
        if not step.exact:
            return self._free_camera_picture.advance(max_coefficients)
        self._is_static = True
        return replace(
            step, tiles=self._static_picture.all_tiles(), previous_error=self._relative_error(self._static_picture)
        )

    def _relative_error(self, static_picture: Picture) -> float | None:
        """Relative RMS difference between the free-camera image and a static view; None if the former is outdated or
        black.
        """
        self._free_camera_picture.correct(None)
        if self._free_camera_picture.advance(None).fidelity != "approximate":
            return None
        exact = static_picture.image()
        size = float(np.mean(np.square(exact, dtype=np.float64)))
        return float(np.sqrt(np.mean((self._free_camera_picture.image() - exact) ** 2) / size)) if size else None

    def all_tiles(self) -> list[Tile]:
        """Return the tiles that cover the image."""
        return self._displayed.all_tiles()

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Return the payload of a frame; see `Picture.encode`."""
        return self._displayed.encode(tiles, form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """Return the alpha of tiles; see `Picture.encode_alpha`."""
        return self._displayed.encode_alpha(tiles)

    def image(self) -> Shaped[F32, "height width 3"]:
        """Return linear radiance."""
        return self._displayed.image()

    def inspect(self, x: int, y: int) -> dict[str, Any]:
        """Probe a pixel; see `Picture.inspect`. Raises ParameterError if it lies outside the image."""
        return self._displayed.inspect(x, y)

    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> Shaped[F32, "height width"]:
        """Return the pixels lit by a range of a curve; see `Picture.highlight_pixels`.

        Args:
            pointer: to a curve. from_deg, to_deg: ends of the range, degrees.
        Raises:
            ResultUnavailableError: no static view is displayed.
        """
        return self._displayed.highlight_pixels(pointer, from_deg, to_deg)


def _has_indirect(look: Look) -> bool:
    """Return whether a look shows indirect light."""
    return look.transport.paths.has_indirect


def _is_same_camera(first: SizedCamera, second: SizedCamera) -> bool:
    (camera, size), (second_camera, second_size) = first, second
    return bool(
        size == second_size
        and camera.yfov == second_camera.yfov
        and np.array_equal(camera.to_world, second_camera.to_world)
    )
