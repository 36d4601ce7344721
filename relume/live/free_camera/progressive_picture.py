"""Progressive refinement of the free-camera image: when the camera stops, a static view replaces it.

Until the static view is ready, its direct light corrects the free-camera image.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.fixed_camera.fidelity import ImageError
from relume.live.fixed_camera.illumination import Solo
from relume.live.fixed_camera.jobs import Job
from relume.live.fixed_camera.picture import Picture, Progress
from relume.live.fixed_camera.protocols import StaticViewFactory
from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.static_view_jobs import (
    ExactImage,
    SizedCamera,
    StaticViewState,
    correction_job,
    should_correct,
    static_view_job,
)
from relume.look import Look
from relume.look.object_materials import object_materials_of
from relume.scene.model import Camera

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class ProgressivePicture:
    """The free-camera image and the static view of one view; of one session, used from one thread at a time.

    Args:
        free_camera_picture: displayed while the camera moves, and until the static view is exact.
        make_static_view: traces the view of a camera; slow. cache: cache of static views.
    """

    def __init__(
        self, free_camera_picture: FreeCameraPicture, make_static_view: StaticViewFactory, cache: Cache
    ) -> None:
        self._free_camera_picture, self._make_static_view, self._cache = free_camera_picture, make_static_view, cache
        self._camera_seq, self._look_seq, self._is_idle = 0, 0, True
        self._corrected_for: tuple[int, int] | None = None  # camera and look that were corrected
        self._static_picture: Picture | None = None
        self._has_indirect = False  # of the static view
        self._moving_error: ImageError | None = None  # of the image that the static view replaces
        self._is_static = False  # the static view is displayed
        self._must_resend = False  # the camera was set again to the same pose
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
        """Raise if the look cannot be displayed; see `Picture.check`."""
        self._displayed.check(look)

    def set_look(self, look: Look, *, active_pointer: str | None = None, solo: Solo = None) -> None:
        """Set the target look of both pictures; nothing is computed yet.

        Args:
            look: target. active_pointer: pointer to the active control, or None.
            solo: names of the only lights to show; None: all.
        Raises:
            ParameterError, NotFoundError, SceneError: as by `Picture.set_look`; both stay as they were.
        """
        static_picture = self._static_picture if self._has_indirect or not _has_indirect(look) else None
        if static_picture is not None and static_picture.object_materials != object_materials_of(look):
            static_picture = None
        if static_picture is not None:  # first, because it rejects every look that the other rejects
            static_picture.set_look(look, active_pointer=active_pointer, solo=solo)
        self._free_camera_picture.set_look(look, active_pointer=active_pointer, solo=solo)
        if static_picture is None:
            self._static_picture, self._is_static = None, False
        self._look, self._active_pointer, self._solo = look, active_pointer, solo
        self._look_seq += 1
        self._moving_error = None

    def set_camera(self, camera: Camera, size: tuple[int, int], *, is_idle: bool = True) -> None:
        """Set the camera; nothing is computed yet.

        Args:
            camera: a rigid one. size: width and height, pixels.
            is_idle: an exact image is to follow.
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
        """True if every step must deliver pixels of the free-camera image; see `FreeCameraPicture`."""
        return self._free_camera_picture.renders_pixels

    @renders_pixels.setter
    def renders_pixels(self, draws: bool) -> None:
        """True if every step must deliver pixels of the free-camera image; see `FreeCameraPicture`."""
        self._free_camera_picture.renders_pixels = draws

    def array_blocks(self) -> tuple[dict[str, ArrayBlock], ShaderConstants] | None:
        """Return what a shader needs to draw the free-camera image; None while the static view is displayed or the
        image exceeds the browser's renderer.
        """
        is_server_rendered = self._displayed is self._static_picture or self._free_camera_picture.exceeds_browser
        return None if is_server_rendered else self._free_camera_picture.array_blocks()

    def prepare(self, pointer: str) -> None:
        """Announce an edit; see `Picture.prepare`."""
        self._displayed.prepare(pointer)
        self._prepared_pointer = pointer

    def next_job(self) -> Job | None:
        """Return the job that must run next, or None; a static view last."""
        if self._static_picture is not None:
            return self._static_picture.next_job()
        job = self._free_camera_picture.next_job()
        if job is not None or not self._is_idle or self._look is None:
            return job
        view_state = StaticViewState(
            self._make_static_view, self._cache, self._free_camera_picture.sized_camera, self._look, self._solo
        )
        request = self._camera_seq, self._look_seq
        unwatched = self._free_camera_picture.unwatched()
        if self._corrected_for != request and should_correct(self._look):
            return correction_job(view_state, unwatched, request, partial(self._correct, request))
        unwatched.renders_pixels = self.renders_pixels  # the error is of what was shown
        return static_view_job(view_state, unwatched, request, partial(self._set_static_picture, request))

    def _correct(self, request: tuple[int, int], residual_image: F32 | None) -> None:
        if request == (self._camera_seq, self._look_seq):  # else the camera or the look has changed
            self._corrected_for = request
            self._free_camera_picture.correct(residual_image)

    def _set_static_picture(self, request: tuple[int, int], has_indirect: bool, result: ExactImage | None) -> None:
        if request[0] != self._camera_seq or self._look is None:
            return
        if result is None:
            self._is_idle = False
            return
        static_picture = result.picture
        if static_picture.object_materials != object_materials_of(self._look):  # the next job traces them
            return
        self._moving_error = result.error if request[1] == self._look_seq else None
        if _has_indirect(self._look) and not has_indirect:  # requested meanwhile; the next job reuses the traced view
            return
        static_picture.set_look(self._look, active_pointer=self._active_pointer, solo=self._solo)
        if self._prepared_pointer is not None:
            with suppress(ParameterError):  # an edit may have removed the target
                static_picture.prepare(self._prepared_pointer)
        self._static_picture, self._has_indirect = static_picture, has_indirect

    def advance(self, max_coefficients: int | None) -> Progress:
        """Advance the displayed picture toward its look and camera; the static view is displayed once it is exact."""
        step = replace(self._step(max_coefficients), traces_lobes=self._free_camera_picture.traces_lobes)
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
        return replace(step, tiles=self._static_picture.all_tiles(), free_camera_error=self._moving_error)

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the image."""
        return self._displayed.all_tiles()

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Return the payload of a frame; see `Picture.encode`."""
        return self._displayed.encode(tiles, form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """Return the coverage of the background; see `Picture.encode_alpha`."""
        return self._displayed.encode_alpha(tiles)

    def image(self) -> Shaped[F32, "height width 3"]:
        """Linear radiance."""
        return self._displayed.image()

    def inspect(self, x: int, y: int) -> dict[str, Any]:
        """Return the contributions to a pixel; see `Picture.inspect`. Raises ParameterError outside of the image."""
        return self._displayed.inspect(x, y)

    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """Return the pixels that a range of a curve lights; see `Picture.highlight_pixels`.

        Args:
            pointer: to a curve. from_deg, to_deg: range of its angle, degrees.
        Raises:
            NotMadeError: no static view is displayed.
        """
        return self._displayed.highlight_pixels(pointer, from_deg, to_deg)


def _has_indirect(look: Look) -> bool:
    """True if a look shows indirect light."""
    return look.transport.paths.has_indirect


def _is_same_camera(first: SizedCamera, second: SizedCamera) -> bool:
    (camera, size), (second_camera, second_size) = first, second
    return bool(
        size == second_size
        and (camera.yfov, camera.near) == (second_camera.yfov, second_camera.near)
        and np.array_equal(camera.to_world, second_camera.to_world)
    )
