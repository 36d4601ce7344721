"""Jobs that refine the image when the camera stops: sparse exact samples that correct it, then the static view."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.errors import CancelledError, RelumeError, ResultUnavailableError
from relume.live.fixed_camera.finish import render_exact
from relume.live.fixed_camera.illumination import Solo
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.residual_correction import CorrectionSamples, residual
from relume.look import Look
from relume.scene.model import Camera

F32 = NDArray[np.float32]
SizedCamera = tuple[Camera, tuple[int, int]]

TRACING_FRACTION = 0.5  # of the progress of a static view; the rest is shading
SAMPLE_SPACING = 8  # pixels between sparse samples
_MIN_SPARSE_SAMPLES = 1000  # with fewer the exact image is ready as early


class StaticViewFactory(Protocol):
    """Traces the view of a camera: an opened bake with this one fixed view."""

    def __call__(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        *,
        smooths_edges: bool = True,
    ) -> FixedViewTransfer:
        """Trace the view; see `relume.methods.static_views.StaticViewBuilder.make_static_view`."""
        ...


@dataclass(frozen=True)
class StaticViewState:
    """Camera and look of an exact image.

    Attributes:
        make_static_view: traces the view; slow. cache: of the picture.
        sized_camera: camera and image size. look, solo: to display.
    """

    make_static_view: StaticViewFactory
    cache: Cache
    sized_camera: SizedCamera
    look: Look
    solo: Solo

    @property
    def is_indirect(self) -> bool:
        """True if the look shows indirect light."""
        return self.look.transport.paths.has_indirect

    def static_picture(
        self, progress: ProgressCallback, is_canceled: CancelCheck, *, smooths_edges: bool = True
    ) -> Picture:
        """Trace and shade the view.

        Args:
            progress: called with the approximate fraction done. is_canceled: polled.
            smooths_edges: take several samples in edge pixels.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        (camera, size), look = self.sized_camera, self.look
        transfer = self.make_static_view(
            camera,
            size,
            self.is_indirect,
            lambda share: progress(TRACING_FRACTION * share),
            is_canceled,
            smooths_edges=smooths_edges,
        )
        picture = Picture(transfer, next(iter(transfer.views)), self.cache)
        picture.set_look(look, solo=self.solo)
        render_exact(
            picture, look, lambda share: progress(TRACING_FRACTION + (1 - TRACING_FRACTION) * share), is_canceled
        )
        return picture


@dataclass(frozen=True)
class SparseExactJob:
    """Estimate the error of direct light in a free-camera image from sparse exact samples; a
    `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        view_state: camera and look. free_camera_picture: a copy of the picture for this job alone.
        key: equal for jobs of one camera and look. on_done: receives the residual image; None if nothing is to be
            corrected.
    """

    view_state: StaticViewState
    free_camera_picture: FreeCameraPicture
    key: tuple[Hashable, ...]
    on_done: Callable[[F32 | None], None]

    label = "the first exact samples"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    @staticmethod
    def should_refine(view_state: StaticViewState) -> bool:
        """True if direct light is shown in an image that is large enough."""
        width, height = view_state.sized_camera[1]
        return (
            view_state.look.transport.paths.direct
            and (width // SAMPLE_SPACING) * (height // SAMPLE_SPACING) >= _MIN_SPARSE_SAMPLES
        )

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> F32 | None:
        """Trace, shade and compare. (height, width, 3). Raises CancelledError if `is_canceled`."""
        picture, (camera, size), gbuffer = (
            self.free_camera_picture,
            self.view_state.sized_camera,
            self.free_camera_picture.gbuffer,
        )
        if len(gbuffer.glass.ray):  # the errors of a glass surface and of what is behind it differ
            return None
        transport = self.view_state.look.transport.model_copy(update={"show": "direct"})
        look = self.view_state.look.model_copy(update={"transport": transport})
        coarse_size = size[0] // SAMPLE_SPACING, size[1] // SAMPLE_SPACING
        direct_view = replace(self.view_state, sized_camera=(camera, coarse_size), look=look)
        try:
            exact = direct_view.static_picture(progress, is_canceled, smooths_edges=False).image()
        except CancelledError:
            raise
        except RelumeError:  # the scene was deleted, or needs more memory than is free
            return None
        picture.set_look(look, solo=direct_view.solo)
        radiance, sample_gbuffer = picture.render_pixel_centers(coarse_size)
        samples = CorrectionSamples.from_gbuffer(
            picture.stored_scene, sample_gbuffer, camera, coarse_size[0]
        ).exclude_edges(gbuffer.owner, size)
        pixels = CorrectionSamples.from_gbuffer(
            picture.stored_scene, gbuffer.pixel_centers(size[0] * size[1]), camera, size[0]
        )
        residual_image = residual(radiance, exact, samples, pixels)
        return residual_image if residual_image.any() else None

    def install(self, result: F32 | None) -> None:
        """Deliver the result."""
        self.on_done(result)


@dataclass(frozen=True)
class StaticViewJob:
    """Render the exact static view in the background; a `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        view_state: camera and look; the picture follows later looks from there.
        key: equal for jobs of one camera and look, so that edits do not start further jobs.
        on_done: receives whether indirect light can be shown, and the picture; None if it is unavailable.
    """

    view_state: StaticViewState
    key: tuple[Hashable, ...]
    on_done: Callable[[bool, Picture | None], None]

    label = "the exact image from this camera"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Picture | ResultUnavailableError:
        """Trace and shade, or return why that failed. Raises CancelledError if `is_canceled`."""
        try:
            return self.view_state.static_picture(progress, is_canceled)
        except CancelledError:
            raise
        except RelumeError as error:  # the scene was deleted, or needs more memory than is free
            return ResultUnavailableError(f"the approximate image stays; {self.label} cannot be rendered: {error}")

    def install(self, result: Picture | ResultUnavailableError) -> None:
        """Deliver the result."""
        self.on_done(self.view_state.is_indirect, None if isinstance(result, ResultUnavailableError) else result)
