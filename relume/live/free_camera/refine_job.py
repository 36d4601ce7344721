"""Refine highlights in the background when the camera and the look have been idle for a moment."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.free_camera.frame import Frame, FrameRequestState, render_frame
from relume.live.free_camera.highlight_edges import add_samples
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.scene.model import Camera

F32 = NDArray[np.float32]


def render_fine_frame(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    shadow_visibility: Sequence[F32],
) -> Frame:
    """Render the frame with anti-aliased highlight edges.

    Args:
        transfer, state, gbuffer, camera, size, shadow_visibility: as in `relume.live.free_camera.frame.render_frame`;
            `state` is fine.
    """
    frame = render_frame(transfer, state, gbuffer, camera, size, shadow_visibility)
    return add_samples(transfer, state, gbuffer, camera, frame, shadow_visibility)


@dataclass(frozen=True)
class RefineHighlights:
    """Renders the fine frame; a `relume.live.fixed_camera.jobs.Job`.

    Attributes:
        render: render of the camera and look at the start of the job. key: equal for jobs of one camera and look.
        on_done: receives the frame.
    """

    render: Callable[[], Frame]
    key: tuple[Hashable, ...]
    on_done: Callable[[Frame], None]

    label = "finer highlights"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Frame:
        """Render; takes as long as a few frames."""
        return self.render()

    def install(self, result: Frame) -> None:
        """Deliver the frame."""
        self.on_done(result)
