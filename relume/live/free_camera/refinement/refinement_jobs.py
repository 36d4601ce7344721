"""What is made where an eye rests: a few exact samples, which correct the moving picture, then the exact picture."""

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

TRACING_FRACTION = 0.5  # of what a still tells to be done; the rest is shading
SAMPLE_SPACING = 8  # pixels from one sparse sample to the next
_MIN_SPARSE_SAMPLES = 1000  # samples; with fewer the exact picture itself is as soon there


class StaticViewFactory(Protocol):
    """Finds what an eye sees: an opened bake of this one fixed view."""

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
        """Trace it; see `relume.methods.static_views.StaticViewBuilder.make_static_view`."""
        ...


@dataclass(frozen=True)
class StaticViewState:
    """What is to be seen exactly.

    Attributes:
        make_static_view: finds what it sees; heavy. cache: of what is made for the picture.
        sized_camera: camera, and size of its picture. look, solo: that it is shown in.
    """

    make_static_view: StaticViewFactory
    cache: Cache
    sized_camera: SizedCamera
    look: Look
    solo: Solo

    @property
    def is_indirect(self) -> bool:
        """Whether light between surfaces is shown."""
        return self.look.transport.paths.has_indirect

    def static_picture(
        self, progress: ProgressCallback, is_canceled: CancelCheck, *, smooths_edges: bool = True
    ) -> Picture:
        """Trace and shade it.

        Args:
            progress: called with about the share done. is_canceled: asked now and then.
            smooths_edges: whether pixels across edges have several samples.
        Raises:
            CancelledError: `is_canceled` said so.
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
    """By how much a moving picture's straight light is off, from few samples; a `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        view_state: what is to be seen exactly. free_camera_picture: the picture that is off, for this job alone.
        key: equal for jobs of one eye and look. on_done: gets what was made; None where nothing is to be corrected.
    """

    view_state: StaticViewState
    free_camera_picture: FreeCameraPicture
    key: tuple[Hashable, ...]
    on_done: Callable[[F32 | None], None]

    label = "a first exact look from here"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    @staticmethod
    def should_refine(view_state: StaticViewState) -> bool:
        """Whether light comes straight, to a picture that is large enough."""
        width, height = view_state.sized_camera[1]
        return (
            view_state.look.transport.paths.direct
            and (width // SAMPLE_SPACING) * (height // SAMPLE_SPACING) >= _MIN_SPARSE_SAMPLES
        )

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> F32 | None:
        """Trace, shade and compare. (height, width, 3). Raises CancelledError where `is_canceled` said so."""
        picture, (camera, size), gbuffer = (
            self.free_camera_picture,
            self.view_state.sized_camera,
            self.free_camera_picture.gbuffer,
        )
        if len(gbuffer.glass.ray):  # of what glass shows and what is behind it, each is off by something else
            return None
        transport = self.view_state.look.transport.model_copy(update={"show": "direct"})
        look = self.view_state.look.model_copy(update={"transport": transport})
        coarse_size = size[0] // SAMPLE_SPACING, size[1] // SAMPLE_SPACING
        direct_view = replace(self.view_state, sized_camera=(camera, coarse_size), look=look)
        try:
            exact = direct_view.static_picture(progress, is_canceled, smooths_edges=False).image()
        except CancelledError:
            raise
        except RelumeError:  # the scene is gone, or it needs more memory than there is
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
        """Hand it over."""
        self.on_done(result)


@dataclass(frozen=True)
class StaticViewJob:
    """The exact picture of where an eye rests, made beside the frames; a `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        view_state: what is made; looks that came meanwhile are followed from there.
        key: jobs of one eye and look are one: while hands edit, nothing takes a core from them.
        on_done: gets whether light between surfaces can be shown, and the picture when it is there; None where it
            cannot be had.
    """

    view_state: StaticViewState
    key: tuple[Hashable, ...]
    on_done: Callable[[bool, Picture | None], None]

    label = "the exact picture from here"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Picture | ResultUnavailableError:
        """Trace and shade it, or why not. Raises CancelledError where `is_canceled`, asked now and then, said so."""
        try:
            return self.view_state.static_picture(progress, is_canceled)
        except CancelledError:
            raise
        except RelumeError as error:  # the scene is gone, or it needs more memory than there is
            return ResultUnavailableError(f"the moving picture stays: {self.label} cannot be had, for {error}")

    def install(self, result: Picture | ResultUnavailableError) -> None:
        """Hand it over."""
        self.on_done(self.view_state.is_indirect, None if isinstance(result, ResultUnavailableError) else result)
