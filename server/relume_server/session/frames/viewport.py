"""One visible view: its image, and what the client has of it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from relume.live.fixed_camera.fidelity import Fidelity
from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.client_state.target import CameraState, Target
from relume_server.runtime.protocols import FreeCameraPicture, Picture, Tile
from relume_server.schemas.protocol import HighlightMessage
from relume_server.session.frames.client_render_state import ClientRenderState
from relume_server.session.frames.coefficient_budget import CoefficientBudget
from relume_server.session.frames.painter import DISPLAYED, Format, FrameRequest, Painted

if TYPE_CHECKING:
    from relume.live.fixed_camera.jobs import Job
    from relume.live.fixed_camera.picture import Progress
    from relume.live.fixed_camera.protocols import CameraView

REFINE_SEND_INTERVAL_S = 0.100


def fit_size(size: tuple[int, int], space: tuple[int, int]) -> tuple[int, int]:
    """Largest size with the image's aspect ratio that fits into a space, at most the image's own, at least 1."""
    (width, height), (max_width, max_height) = size, space
    fitted_width = min(width, max_width, width * max_height // height)
    fitted_height = min(height, max_height, height * max_width // width)
    return max(1, fitted_width), max(1, fitted_height)


class Viewport:
    """Chooses the next frame of a view, and records its result.

    Attributes:
        target: target of the last step.
        job: what the image waits for.
        is_converged: another step would change nothing.
        is_exact: the client's image is exact. progress: progress of the last step.
        not_before_s: no refined frame is sent earlier.
        camera_state: camera state of the last step, for a free camera.
        highlight: pending interval of a curve to highlight. served_s: time of its last turn.
    """

    def __init__(self, view: CameraView, picture: Picture, *, is_free_camera: bool) -> None:
        """
        Args:
            view: view of the bake. picture: its live image. is_free_camera: then it has something to show at once.
        """
        self.name, self.size, self.picture = view.name, (view.width, view.height), picture
        self.target: Target | None = None
        self.job: Job | None = None
        self.is_converged = self.is_exact = False
        self.progress: Progress | None = None
        self.not_before_s = 0.0
        self.highlight: HighlightMessage | None = None
        self.served_s = 0.0
        self._all_tiles = self._missing_tiles = frozenset(picture.all_tiles())
        self.camera_state: CameraState | None = None
        self._is_free_camera, self._renderer = is_free_camera, "server"
        self._client_render_state = ClientRenderState()
        self._is_blank = not is_free_camera  # nothing is shaded yet: a frame would be black
        self._has_unsent = self._is_link_slow = False
        self._answered_target: Target | None = None
        self._visible_exact_target: Target | None = None
        self._region: Tile | None = None
        self._interactive_bytes = 0
        self._last_sent_s = 0.0
        self._budget = CoefficientBudget()

    def needs_camera_update(self, pending: PendingRequests) -> bool:
        """True if the newest camera has not been painted."""
        return pending.camera_states.get(self.name) is not self.camera_state

    def has_new_renderer(self, pending: PendingRequests) -> bool:
        """True if another renderer is requested."""
        return self._is_free_camera and pending.renderer != self._renderer

    def has_new_region(self, pending: PendingRequests) -> bool:
        """True if the visible region changed."""
        return not self._is_free_camera and pending.regions.get(self.name) != self._region

    def is_outdated(self, newest: Target) -> bool:
        """True if the view has not been painted with this look."""
        return self.target is not newest

    def resend(self) -> None:
        """Forget what the client has."""
        self._missing_tiles, self._has_unsent = self._all_tiles, True
        self.is_converged = self.is_exact = False

    def on_installed(self, job: Job | None) -> None:
        """Record that a result was installed, and the next job."""
        self.job = job
        self._is_blank = self.is_converged = False
        self.not_before_s = 0.0

    def request(
        self, newest: Target, pending: PendingRequests, window: FrameWindow, accepting: Sequence[Picture]
    ) -> FrameRequest:
        """Request for the next frame: for a new look whatever can be shown, otherwise a refinement."""
        camera_state = pending.camera_states.get(self.name)
        has_moved = self.needs_camera_update(pending)
        if self.has_new_renderer(pending):
            self._renderer, self._client_render_state, self._missing_tiles = (
                pending.renderer,
                ClientRenderState(),
                self._all_tiles,
            )
        is_new = self.is_outdated(newest) or has_moved
        size = self.size if camera_state is None else camera_state.size
        received_s = camera_state.received_s if camera_state is not None and has_moved else newest.received_s
        is_interactive = is_new and received_s is not None
        is_client_rendered = self._has_shader and pending.form not in DISPLAYED
        was_sent_recently = time.perf_counter() - self._last_sent_s < REFINE_SEND_INTERVAL_S
        if is_interactive and is_client_rendered:
            is_client_rendered = not self._client_render_state.are_too_large(newest, window, self.is_outdated(newest))
        elif self._client_render_state.is_outdated and was_sent_recently:  # the drag may continue
            is_client_rendered = False
        self._is_link_slow = is_slow = window.is_slow_for(self._interactive_bytes, was_slow=self._is_link_slow)
        needs_jpeg = pending.form == "auto" and is_slow and is_interactive and not is_client_rendered
        form: Format = "png" if pending.form == "png" else "jpeg" if pending.form == "jpeg" or needs_jpeg else "rgb9e5"
        is_early = is_slow or was_sent_recently
        is_answered = self._answered_target is newest
        if self._is_free_camera:
            cast("FreeCameraPicture", self.picture).renders_pixels = not is_client_rendered
        return FrameRequest(
            target=newest,
            accepting=accepting,
            max_coefficients=self._budget.max_coefficients,
            missing_tiles=frozenset() if has_moved else self._missing_tiles,
            form=form,
            quality=pending.quality,
            only_exact=self._is_blank or (not is_new and is_early),
            region=None if self._is_free_camera else pending.regions.get(self.name),
            has_new_region=self.has_new_region(pending),
            is_interactive=is_interactive,
            is_visible_exact=self._visible_exact_target is newest,
            is_due=self._has_unsent or (self._has_new_display(newest) if is_new else self._has_unsent_data(pending)),
            is_client_exact=self.is_exact and is_answered,
            received_s=None if is_answered and not has_moved else received_s,
            camera_state=camera_state if has_moved else None,
            camera_seq=None if camera_state is None else camera_state.seq,
            client_keys=self._client_render_state.client_keys if is_client_rendered else None,
            frame=window.next_frame,
            view=self.name,
            size=size,
            jpeg_size=size if pending.space is None else fit_size(size, pending.space),
        )

    def _has_new_display(self, newest: Target) -> bool:
        return self._answered_target is not None and self._answered_target.look.display != newest.look.display

    def _has_unsent_data(self, pending: PendingRequests) -> bool:
        """True if something is to be sent after a drag: HDR tiles after a JPEG or after unsent steps, or shader inputs
        after images that were sent instead.
        """
        return (bool(self._missing_tiles) or self._has_outdated_tables) and pending.form not in DISPLAYED

    @property
    def _has_outdated_tables(self) -> bool:
        return self._has_shader and self._client_render_state.is_outdated

    @property
    def _has_shader(self) -> bool:
        return self._is_free_camera and self._renderer == "client"

    def on_painted(self, request: FrameRequest, painted: Painted, pending: PendingRequests) -> None:
        """Record what the client has after `painted` is sent."""
        tiles, exact = painted.progress.tiles, painted.is_exact
        if request.has_new_region:
            self._region, self._visible_exact_target = request.region, None
        if request.camera_state is not None:
            self.camera_state, self.size = request.camera_state, request.size
            self._missing_tiles, self._all_tiles = frozenset(), frozenset(self.picture.all_tiles())
        if tiles:
            self._budget.learn(painted.update_ms, exact)
        if self.is_outdated(request.target) and tiles and request.received_s is not None:
            self._interactive_bytes = 4 * sum(w * h for _, _, w, h in tiles)
        self._client_render_state.on_painted(self.is_outdated(request.target), request.target, painted)
        self.target, self.job, self.progress = request.target, painted.job, painted.progress
        is_done = exact or not tiles
        if painted.message is None:
            self._missing_tiles = self._missing_tiles.union(tiles)
            self._has_unsent = self._has_unsent or bool(tiles)
            if painted.deferred_tiles:  # until the job is finished, or another region is visible
                self.is_converged = is_done
            else:
                self._wait(is_done, pending)
            return
        self._missing_tiles = self._all_tiles if request.form in DISPLAYED else painted.deferred_tiles
        self._has_unsent, self._answered_target, self.is_exact = False, request.target, exact
        self._visible_exact_target = request.target if painted.progress.fidelity == Fidelity.EXACT else None
        self._is_blank = self._is_blank and not exact
        self.is_converged = is_done and not self._has_unsent_data(pending)
        self.not_before_s = 0.0

    def _wait(self, is_done: bool, pending: PendingRequests) -> None:
        """Record that nothing was sent: nothing to show, or too early; a slow connection waits for the exact image."""
        has_unsent_data = self._has_unsent or self._has_unsent_data(pending)
        is_late = self._is_link_slow and not self._has_outdated_tables
        self.is_converged = is_done and (self._is_blank or is_late or not has_unsent_data)
        self.not_before_s = self._last_sent_s + REFINE_SEND_INTERVAL_S if is_done else 0.0

    def on_sent(self, now_s: float) -> None:
        """Record that a frame is being sent."""
        self._last_sent_s = now_s
