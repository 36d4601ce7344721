"""Jobs when the camera stops: exact direct light corrects the image, then the exact image replaces it.

    C = max(M + E_d − M_d, 0)

M is the free-camera image, M_d the same under direct light alone, and E_d exact direct light, which is traced before
the gather rays of the exact image and takes about half of its time. What is left is the error of indirect light. A
sparse E_d, interpolated, brings less than it harms (docs/free-camera.md#when-the-camera-stops).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import lobe_of
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
from relume.look import Look, TermLook
from relume.look.glass import glass_of
from relume.look.object_materials import object_materials_of
from relume.scene.model import Camera

F32 = NDArray[np.float32]
SizedCamera = tuple[Camera, tuple[int, int]]

TRACING_FRACTION = 0.5  # of the progress of a static view; the rest is shading
_NUM_COMPARED = 50_000  # pixels, about: of all pixels of 640×480 the error took 0.1 s before the image was shown


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
            object_materials=object_materials_of(look),
        )
        picture = Picture(transfer, next(iter(transfer.views)), self.cache, make_static_view=self.make_static_view)
        picture.set_look(look, solo=self.solo)
        render_exact(
            picture, look, lambda share: progress(TRACING_FRACTION + (1 - TRACING_FRACTION) * share), is_canceled
        )
        return picture


def should_correct(look: Look) -> bool:
    """Return whether direct light is exact before all light is."""
    return look.transport.paths.direct and look.transport.paths.has_indirect


def correction_job(
    view_state: StaticViewState,
    free_camera_picture: FreeCameraPicture,
    key: tuple[int, int],
    apply: Callable[[F32 | None], None],
) -> Job:
    """Return the job that computes the error of direct light in the free-camera image.

    Args:
        view_state: the exact target. free_camera_picture: another picture of its camera, for this job alone.
        key: equal for jobs of one camera and look. apply: receives E_d − M_d; None if it is not available.
    """
    return Job(
        ("direct light", *key),
        "exact direct light",
        Priority.REFINEMENT,
        lambda progress, is_canceled: _direct_residual(view_state, free_camera_picture, progress, is_canceled),
        apply,
    )


def _direct_residual(
    view_state: StaticViewState, picture: FreeCameraPicture, progress: ProgressCallback, is_canceled: CancelCheck
) -> Shaped[F32, "height width 3"] | None:
    """E_d − M_d, zero behind glass, whose refracted background differs; None if the view is not available."""
    look = _direct_look(view_state.look)
    try:
        exact = replace(view_state, look=look).static_picture(progress, is_canceled).image()
    except CancelledError:
        raise
    except RelumeError:  # the scene is gone, or it needs more memory than there is
        return None
    picture.set_look(look, solo=view_state.solo)
    picture.advance(None)
    residual = exact - picture.image()
    residual.reshape(-1, 3)[picture.gbuffer.pixels_behind_glass(residual.size // 3)] = 0
    return residual


def _direct_look(look: Look) -> Look:
    """The look under direct light, without mirrors and narrow terms, which reflect light of all paths."""
    materials = {
        name: material.model_copy(update={"terms": _broad_terms(material_documents(look, name))})
        for name, material in look.materials.items()
    }
    transport = look.transport.model_copy(update={"show": "direct"})
    return look.model_copy(update={"transport": transport, "materials": materials})


def _broad_terms(terms: Sequence[TermLook]) -> tuple[TermLook, ...]:
    """Return the terms whose direct light needs no rays along their lobes."""
    return () if is_mirror(terms) else tuple(term for term in terms if lobe_of(term) is None)


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
        free_camera_picture: another picture of its camera, for this job alone.
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
        if is_canceled():
            raise CancelledError("the exact image was canceled")
        try:
            free_camera_picture.set_look(view_state.look, solo=view_state.solo)
            image, gbuffer = free_camera_picture.render_moving()
        except RelumeError:  # the image is exact without knowing the error of the other
            return ExactImage(picture, None)
        step = max(1, math.isqrt(image.size // (3 * _NUM_COMPARED)))
        return ExactImage(picture, pixel_errors(image, picture.image(), gbuffer, view_state.look.display, step).sum())

    def apply_result(result: ExactImage | ResultUnavailableError) -> None:
        apply(view_state.is_indirect, None if isinstance(result, ResultUnavailableError) else result)

    return Job(("static view", *key), label, Priority.REFINEMENT, run, apply_result)
