"""One view on its way to the client: its picture, and what of it the client has."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.pending_requests import PendingRequests
from relume_server.client_state.target import CameraState, Target
from relume_server.runtime.protocols import FreeCameraPicture, Picture, Progress, Tile
from relume_server.schemas.protocol import HighlightMessage
from relume_server.session.frames.client_render_state import ClientRenderState
from relume_server.session.frames.coefficient_budget import CoefficientBudget
from relume_server.session.frames.painter import Format, FrameRequest, Painted

if TYPE_CHECKING:
    from relume.live.fixed_camera.jobs import Job
    from relume.live.fixed_camera.protocols import CameraView

REFINE_SEND_INTERVAL_S = 0.100


def fit_size(size: tuple[int, int], space: tuple[int, int]) -> tuple[int, int]:
    """The largest width and height of a picture's shape that fit into a space, never more than its own, at least 1."""
    (width, height), (max_width, max_height) = size, space
    fitted_width = min(width, max_width, width * max_height // height)
    fitted_height = min(height, max_height, height * max_width // width)
    return max(1, fitted_width), max(1, fitted_height)


class Viewport:
    """Says what the next frame should be, and learns from what came of it.

    Attributes:
        target: the look that it was painted with last.
        job: what the picture waits for.
        is_converged: painting again would show nothing new.
        is_exact: the client's picture of it is exact. progress: what the picture shows since it was painted last.
        not_before_s: no refined frame goes out earlier.
        camera_state: that the picture was painted with last, where it moves.
        highlight: a stretch of a curve whose pixels are to be sent. served_s: when it had its last turn.
    """

    def __init__(self, view: CameraView, picture: Picture, *, is_free_camera: bool) -> None:
        """
        Args:
            is_free_camera: its eye does; then it shows something at once.
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
        self._is_blank = not is_free_camera  # nothing of it has been shaded: a frame would be black
        self._has_unsent = self._is_link_slow = False
        self._answered_target: Target | None = None
        self._visible_exact_target: Target | None = None
        self._region: Tile | None = None
        self._interactive_bytes = 0
        self._last_sent_s = 0.0
        self._budget = CoefficientBudget()

    def needs_camera_update(self, pending: PendingRequests) -> bool:
        """Whether it has not been painted with its newest eye."""
        return pending.camera_states.get(self.name) is not self.camera_state

    def has_new_renderer(self, pending: PendingRequests) -> bool:
        """Whether its pixels are to be found elsewhere than they were."""
        return self._is_free_camera and pending.renderer != self._renderer

    def has_new_region(self, pending: PendingRequests) -> bool:
        """Whether something else of it is on the client's screen than was."""
        return not self._is_free_camera and pending.regions.get(self.name) != self._region

    def is_outdated(self, newest: Target) -> bool:
        """Whether it has not been painted with this look."""
        return self.target is not newest

    def resend(self) -> None:
        """The client has nothing of it."""
        self._missing_tiles, self._has_unsent = self._all_tiles, True
        self.is_converged = self.is_exact = False

    def on_installed(self, job: Job | None) -> None:
        """The picture was handed what it waited for, and needs this now."""
        self.job = job
        self._is_blank = self.is_converged = False
        self.not_before_s = 0.0

    def request(
        self, newest: Target, pending: PendingRequests, window: FrameWindow, accepting: Sequence[Picture]
    ) -> FrameRequest:
        """The next frame: of a new look whatever can be shown, else what refines it."""
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
        is_client_rendered = self._has_shader and pending.form != "jpeg"
        was_sent_recently = time.perf_counter() - self._last_sent_s < REFINE_SEND_INTERVAL_S
        if is_interactive and is_client_rendered:
            is_client_rendered = not self._client_render_state.are_too_large(newest, window, self.is_outdated(newest))
        elif self._client_render_state.is_outdated and was_sent_recently:  # a hand may go on
            is_client_rendered = False
        self._is_link_slow = is_slow = window.is_slow_for(self._interactive_bytes, was_slow=self._is_link_slow)
        needs_jpeg = pending.form == "auto" and is_slow and is_interactive and not is_client_rendered
        form: Format = "jpeg" if pending.form == "jpeg" or needs_jpeg else "rgb9e5"
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
        """Whether something is to come at rest: tiles in HDR after a JPEG or after steps that were not sent, or what a
        shader lacks after pictures that were sent in its place."""
        return (bool(self._missing_tiles) or self._has_outdated_tables) and pending.form != "jpeg"

    @property
    def _has_outdated_tables(self) -> bool:
        return self._has_shader and self._client_render_state.is_outdated

    @property
    def _has_shader(self) -> bool:
        return self._is_free_camera and self._renderer == "client"

    def on_painted(self, request: FrameRequest, painted: Painted, pending: PendingRequests) -> None:
        """Remember what the client has when `painted` is sent."""
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
            if painted.deferred_tiles:  # until what is being made is there, or something else is looked at
                self.is_converged = is_done
            else:
                self._wait(is_done, pending)
            return
        self._missing_tiles = self._all_tiles if request.form == "jpeg" else painted.deferred_tiles
        self._has_unsent, self._answered_target, self.is_exact = False, request.target, exact
        self._visible_exact_target = request.target if painted.progress.fidelity == "exact" else None
        self._is_blank = self._is_blank and not exact
        self.is_converged = is_done and not self._has_unsent_data(pending)
        self.not_before_s = 0.0

    def _wait(self, is_done: bool, pending: PendingRequests) -> None:
        """Nothing was sent: nothing is to be shown, or it is too early; a slow link waits for the exact picture."""
        has_unsent_data = self._has_unsent or self._has_unsent_data(pending)
        is_late = self._is_link_slow and not self._has_outdated_tables
        self.is_converged = is_done and (self._is_blank or is_late or not has_unsent_data)
        self.not_before_s = self._last_sent_s + REFINE_SEND_INTERVAL_S if is_done else 0.0

    def on_sent(self, now_s: float) -> None:
        """A frame has been handed to the socket."""
        self._last_sent_s = now_s
