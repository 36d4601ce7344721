"""Jobs when the camera stops: a few exact samples that correct the image, then the exact image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.specular import is_mirror
from relume.core.cache import Cache
from relume.core.errors import CancelledError, RelumeError, ResultUnavailableError
from relume.live.fixed_camera.fidelity import ImageError
from relume.live.fixed_camera.illumination import Solo
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.picture import Picture, render_exact
from relume.live.fixed_camera.protocols import StaticViewFactory
from relume.live.fixed_camera.view_images import material_documents
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.image_error import pixel_errors
from relume.live.free_camera.residual_correction import CorrectionSamples, residual
from relume.look import Look
from relume.look.glass import glass_of
from relume.scene.model import Camera

F32 = NDArray[np.float32]
SizedCamera = tuple[Camera, tuple[int, int]]

TRACING_FRACTION = 0.5  # of the progress of a static view; the rest is shading
SAMPLE_SPACING = 8  # pixels from one sparse sample to the next
_MIN_SPARSE_SAMPLES = 1000  # with fewer samples, the exact image takes no longer


@dataclass(frozen=True)
class StaticViewState:
    """The target of an exact image.

    Attributes:
        make_static_view: traces the view; expensive. cache: for its results.
        sized_camera: camera and image size. look, solo: of the image.
    """

    make_static_view: StaticViewFactory
    cache: Cache
    sized_camera: SizedCamera
    look: Look
    solo: Solo

    @property
    def is_indirect(self) -> bool:
        """True if indirect light is shown."""
        return self.look.transport.paths.has_indirect

    def static_picture(
        self, progress: ProgressCallback, is_canceled: CancelCheck, *, smooths_edges: bool = True
    ) -> Picture:
        """Trace and shade the view.

        Args:
            progress: called with the approximate fraction done. is_canceled: polled regularly.
            smooths_edges: pixels on edges have several samples.
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
            glass=glass_of(look),
        )
        picture = Picture(transfer, next(iter(transfer.views)), self.cache, make_static_view=self.make_static_view)
        picture.set_look(look, solo=self.solo)
        render_exact(
            picture, look, lambda share: progress(TRACING_FRACTION + (1 - TRACING_FRACTION) * share), is_canceled
        )
        return picture


def should_correct(view_state: StaticViewState) -> bool:
    """Return whether direct light is shown and the image is large enough for a residual from sparse samples."""
    width, height = view_state.sized_camera[1]
    return (
        view_state.look.transport.paths.direct
        and (width // SAMPLE_SPACING) * (height // SAMPLE_SPACING) >= _MIN_SPARSE_SAMPLES
    )


def residual_job(
    view_state: StaticViewState,
    free_camera_picture: FreeCameraPicture,
    key: tuple[int, int],
    apply: Callable[[F32 | None], None],
) -> Job:
    """Return the job that computes the residual of direct light from few exact samples.

    Args:
        view_state: the exact target. free_camera_picture: the image to correct, a copy for this job alone.
        key: equal for jobs of one camera and look. apply: receives the residual; None if there is nothing to correct.
    """
    return Job(
        ("exact samples", *key),
        "exact samples of this camera",
        Priority.REFINEMENT,
        lambda progress, is_canceled: _sparse_residual(view_state, free_camera_picture, progress, is_canceled),
        apply,
    )


def _sparse_residual(
    view_state: StaticViewState, picture: FreeCameraPicture, progress: ProgressCallback, is_canceled: CancelCheck
) -> Shaped[F32, "height width 3"] | None:
    """Trace, shade and compare; None for no residual."""
    (camera, size), gbuffer = view_state.sized_camera, picture.gbuffer
    if len(gbuffer.glass.ray):  # reflections and the background of glass have different residuals
        return None
    transport = view_state.look.transport.model_copy(update={"show": "direct"})
    look = view_state.look.model_copy(update={"transport": transport})
    coarse_size = size[0] // SAMPLE_SPACING, size[1] // SAMPLE_SPACING
    direct_view = replace(view_state, sized_camera=(camera, coarse_size), look=look)
    try:
        exact = direct_view.static_picture(progress, is_canceled, smooths_edges=False).image()
    except CancelledError:
        raise
    except RelumeError:  # the scene is gone, or it needs more memory than there is
        return None
    picture.set_look(look, solo=direct_view.solo)
    radiance, sample_gbuffer = picture.render_pixel_centers(coarse_size)
    # in direct light alone, mirrors of the exact image reflect lit surfaces, and lobe rays of the other reflect none
    mirrors = [is_mirror(material_documents(look, name)) for name in picture.material_names]
    samples = CorrectionSamples.from_gbuffer(picture.stored_scene, sample_gbuffer, camera, coarse_size[0])
    samples = samples.exclude_edges(gbuffer.owner, size).exclude_materials(np.flatnonzero(mirrors))
    pixels = CorrectionSamples.from_gbuffer(
        picture.stored_scene, gbuffer.pixel_centers(size[0] * size[1]), camera, size[0]
    )
    residual_image = residual(radiance, exact, samples, pixels)
    return residual_image if residual_image.any() else None


class ExactImage(NamedTuple):
    """Result of `static_view_job`.

    Attributes:
        picture: the static view. error: of the image of the moving camera, in the same look; None if all is black.
    """

    picture: Picture
    error: ImageError | None


def static_view_job(
    view_state: StaticViewState,
    free_camera_picture: FreeCameraPicture,
    key: tuple[int, int],
    apply: Callable[[bool, ExactImage | None], None],
) -> Job:
    """Return the job that renders the exact image of a stopped camera.

    Args:
        view_state: the target; the result continues with looks that were set meanwhile.
        free_camera_picture: the image that it replaces, a copy for this job alone.
        key: equal for jobs of one camera and look, so that edits replace it.
        apply: receives whether indirect light was traced, and the result, or None if it is not available.
    """
    label = "the exact image of this camera"

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> ExactImage | ResultUnavailableError:
        try:
            picture = view_state.static_picture(progress, is_canceled)
        except CancelledError:
            raise
        except RelumeError as error:  # the scene is gone, or it needs more memory than there is
            return ResultUnavailableError(f"{label} is not available: {error}")
        image, gbuffer = free_camera_picture.render_moving()
        return ExactImage(picture, pixel_errors(image, picture.image(), gbuffer, view_state.look.display).sum())

    def apply_result(result: ExactImage | ResultUnavailableError) -> None:
        apply(view_state.is_indirect, None if isinstance(result, ResultUnavailableError) else result)

    return Job(("static view", *key), label, Priority.REFINEMENT, run, apply_result)
