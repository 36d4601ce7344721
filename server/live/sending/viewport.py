"""One view on its way to the client: its picture, and what of it the client has."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from server.library.ports import Advance, MovingPicture, Picture, Tile
from server.live.sending.coefficient_budget import CoefficientBudget
from server.live.sending.painter import Format, FrameRequest, Painted
from server.live.sending.tables import Tables
from server.live.state.frame_window import FrameWindow
from server.live.state.pending_requests import PendingRequests
from server.live.state.target import Eye, Target
from server.wire.protocol import BrushMessage

if TYPE_CHECKING:
    from relume.picture.jobs import Job
    from relume.picture.transfer import AnyView

REFINE_SEND_S = 0.100


def fitted(size: tuple[int, int], space: tuple[int, int]) -> tuple[int, int]:
    """The largest width and height of a picture's shape that fit into a space, never more than its own, at least 1."""
    (width, height), (most_width, most_height) = size, space
    fitted_width = min(width, most_width, width * most_height // height)
    fitted_height = min(height, most_height, height * most_width // width)
    return max(1, fitted_width), max(1, fitted_height)


class Viewport:
    """Says what the next frame should be, and learns from what came of it.

    Attributes:
        target: the look that it was painted with last.
        job: what the picture waits for.
        is_settled: painting again would show nothing new.
        is_exact: the client's picture of it is exact. advance: what the picture shows since it was painted last.
        not_before_s: no refined frame goes out earlier.
        eye: that the picture was painted with last, where it moves.
        brush: a stretch of a curve whose pixels are to be sent. served_s: when it had its last turn.
    """

    def __init__(self, view: AnyView, picture: Picture, *, moves: bool) -> None:
        """
        Args:
            moves: its eye does; then it shows something at once.
        """
        self.name, self.size, self.picture = view.name, (view.width, view.height), picture
        self.target: Target | None = None
        self.job: Job | None = None
        self.is_settled = self.is_exact = False
        self.advance: Advance | None = None
        self.not_before_s = 0.0
        self.brush: BrushMessage | None = None
        self.served_s = 0.0
        self._all_tiles = self._lacking = frozenset(picture.all_tiles())
        self.eye: Eye | None = None
        self._moves, self._evaluator = moves, "server"
        self._tables = Tables()
        self._is_blank = not moves  # nothing of it has been shaded: a frame would be black
        self._has_unsent = self._is_link_slow = False
        self._answered: Target | None = None
        self._seen_exact: Target | None = None
        self._region: Tile | None = None
        self._moving_bytes = 0
        self._sent_s = 0.0
        self._budget = CoefficientBudget()

    def has_to_move(self, pending: PendingRequests) -> bool:
        """Whether it has not been painted with its newest eye."""
        return pending.eyes.get(self.name) is not self.eye

    def has_other_evaluator(self, pending: PendingRequests) -> bool:
        """Whether its pixels are to be found elsewhere than they were."""
        return self._moves and pending.evaluator != self._evaluator

    def has_other_region(self, pending: PendingRequests) -> bool:
        """Whether something else of it is on the client's screen than was."""
        return not self._moves and pending.regions.get(self.name) != self._region

    def is_behind(self, newest: Target) -> bool:
        """Whether it has not been painted with this look."""
        return self.target is not newest

    def show_again(self) -> None:
        """The client has nothing of it."""
        self._lacking, self._has_unsent = self._all_tiles, True
        self.is_settled = self.is_exact = False

    def installed(self, job: Job | None) -> None:
        """The picture was handed what it waited for, and needs this now."""
        self.job = job
        self._is_blank = self.is_settled = False
        self.not_before_s = 0.0

    def request(
        self, newest: Target, pending: PendingRequests, window: FrameWindow, accepting: Sequence[Picture]
    ) -> FrameRequest:
        """The next frame: of a new look whatever can be shown, else what refines it."""
        eye = pending.eyes.get(self.name)
        has_moved = self.has_to_move(pending)
        if self.has_other_evaluator(pending):
            self._evaluator, self._tables, self._lacking = pending.evaluator, Tables(), self._all_tiles
        is_new = self.is_behind(newest) or has_moved
        size = self.size if eye is None else eye.size
        received_s = eye.received_s if eye is not None and has_moved else newest.received_s
        is_moving = is_new and received_s is not None
        is_drawn_there = self._has_shader and pending.form != "jpeg"
        has_just_sent = time.perf_counter() - self._sent_s < REFINE_SEND_S
        if is_moving and is_drawn_there:
            is_drawn_there = not self._tables.are_too_large(newest, window, self.is_behind(newest))
        elif self._tables.is_behind and has_just_sent:  # a hand may go on
            is_drawn_there = False
        self._is_link_slow = is_slow = window.is_slow_for(self._moving_bytes, was_slow=self._is_link_slow)
        is_moving_slowly = pending.form == "auto" and is_slow and is_moving and not is_drawn_there
        form: Format = "jpeg" if pending.form == "jpeg" or is_moving_slowly else "rgb9e5"
        is_early = is_slow or has_just_sent
        is_answered = self._answered is newest
        if self._moves:
            cast("MovingPicture", self.picture).draws = not is_drawn_there
        return FrameRequest(
            target=newest,
            accepting=accepting,
            max_coefficients=self._budget.max_coefficients,
            lacking=frozenset() if has_moved else self._lacking,
            form=form,
            quality=pending.quality,
            only_exact=self._is_blank or (not is_new and is_early),
            region=None if self._moves else pending.regions.get(self.name),
            is_turned=self.has_other_region(pending),
            is_moving=is_moving,
            is_seen_exact=self._seen_exact is newest,
            is_due=self._has_unsent or (self._has_other_display(newest) if is_new else self._is_owed(pending)),
            is_told=self.is_exact and is_answered,
            received_s=None if is_answered and not has_moved else received_s,
            eye=eye if has_moved else None,
            shown_eye=None if eye is None else eye.number,
            known=self._tables.known if is_drawn_there else None,
            frame=window.next_frame,
            view=self.name,
            size=size,
            jpeg_size=size if pending.space is None else fitted(size, pending.space),
        )

    def _has_other_display(self, newest: Target) -> bool:
        return self._answered is not None and self._answered.look.display != newest.look.display

    def _is_owed(self, pending: PendingRequests) -> bool:
        """Whether something is to come at rest: tiles in HDR after a JPEG or after steps that were not sent, or what a
        shader lacks after pictures that were sent in its place."""
        return (bool(self._lacking) or self._lacks_tables) and pending.form != "jpeg"

    @property
    def _lacks_tables(self) -> bool:
        return self._has_shader and self._tables.is_behind

    @property
    def _has_shader(self) -> bool:
        return self._moves and self._evaluator == "browser"

    def painted(self, request: FrameRequest, painted: Painted, pending: PendingRequests) -> None:
        """Remember what the client has when `painted` is sent."""
        tiles, exact = painted.advance.tiles, painted.is_exact
        if request.is_turned:
            self._region, self._seen_exact = request.region, None
        if request.eye is not None:
            self.eye, self.size = request.eye, request.size
            self._lacking, self._all_tiles = frozenset(), frozenset(self.picture.all_tiles())
        if tiles:
            self._budget.learn(painted.update_ms, exact)
        if self.is_behind(request.target) and tiles and request.received_s is not None:
            self._moving_bytes = 4 * sum(w * h for _, _, w, h in tiles)
        self._tables.painted(self.is_behind(request.target), request.target, painted)
        self.target, self.job, self.advance = request.target, painted.job, painted.advance
        is_done = exact or not tiles
        if painted.message is None:
            self._lacking = self._lacking.union(tiles)
            self._has_unsent = self._has_unsent or bool(tiles)
            if painted.held_back:  # until what is being made is there, or something else is looked at
                self.is_settled = is_done
            else:
                self._wait(is_done, pending)
            return
        self._lacking = self._all_tiles if request.form == "jpeg" else painted.held_back
        self._has_unsent, self._answered, self.is_exact = False, request.target, exact
        self._seen_exact = request.target if painted.advance.fidelity == "exact" else None
        self._is_blank = self._is_blank and not exact
        self.is_settled = is_done and not self._is_owed(pending)
        self.not_before_s = 0.0

    def _wait(self, is_done: bool, pending: PendingRequests) -> None:
        """Nothing was sent: nothing is to be shown, or it is too early; a slow link waits for the exact picture."""
        has_more = self._has_unsent or self._is_owed(pending)
        is_late = self._is_link_slow and not self._lacks_tables
        self.is_settled = is_done and (self._is_blank or is_late or not has_more)
        self.not_before_s = self._sent_s + REFINE_SEND_S if is_done else 0.0

    def sent(self, now_s: float) -> None:
        """A frame has been handed to the socket."""
        self._sent_s = now_s
