"""One view on its way to the client: its picture, and what of it the client has."""

from __future__ import annotations

import time
from collections.abc import Sequence

from server.live.pace import Pace
from server.live.painter import Format, Order, Painted, Target
from server.live.ports import Advance, Need, Picture, View
from server.live.window import Window
from server.live.wishes import Wishes
from server.protocol import BrushMessage

REFINE_SEND_S = 0.100


class Viewport:
    """Says what the next frame should be, and learns from what came of it.

    Attributes:
        target: the look that it was painted with last.
        need: what the picture waits for.
        is_settled: painting again would show nothing new.
        is_exact: the client's picture of it is exact. advance: what the picture shows since it was painted last.
        not_before_s: no refined frame goes out earlier.
        brush: a stretch of a curve whose pixels are to be sent. served_s: when it had its last turn.
    """

    def __init__(self, view: View, picture: Picture) -> None:
        self.name, self.size, self.picture = view.name, (view.width, view.height), picture
        self.target: Target | None = None
        self.need: Need | None = None
        self.is_settled = self.is_exact = False
        self.advance: Advance | None = None
        self.not_before_s = 0.0
        self.brush: BrushMessage | None = None
        self.served_s = 0.0
        self._all_tiles = self._lacking = frozenset(picture.all_tiles())
        self._is_blank = True  # nothing of it has been shaded: a frame would be black
        self._has_unsent = self._is_link_slow = False
        self._answered: Target | None = None
        self._moving_bytes = 0
        self._sent_s = 0.0
        self._pace = Pace()

    def is_behind(self, newest: Target) -> bool:
        """Whether it has not been painted with this look."""
        return self.target is not newest

    def show_again(self) -> None:
        """The client has nothing of it."""
        self._lacking, self._has_unsent = self._all_tiles, True
        self.is_settled = self.is_exact = False

    def adopted(self, need: Need | None) -> None:
        """The picture was handed what it waited for, and needs this now."""
        self.need = need
        self._is_blank = self.is_settled = False
        self.not_before_s = 0.0

    def order(self, newest: Target, wishes: Wishes, window: Window, accepting: Sequence[Picture]) -> Order:
        """The next frame: of a new look whatever can be shown, else what refines it."""
        is_new = self.is_behind(newest)
        self._is_link_slow = is_slow = window.is_slow_for(self._moving_bytes)
        is_moving_slowly = wishes.form == "auto" and is_slow and is_new and newest.received_s is not None
        form: Format = "jpeg" if wishes.form == "jpeg" or is_moving_slowly else "rgb9e5"
        is_early = is_slow or time.perf_counter() - self._sent_s < REFINE_SEND_S
        is_answered = self._answered is newest
        return Order(
            target=newest,
            accepting=accepting,
            max_coefficients=self._pace.max_coefficients,
            lacking=self._lacking,
            form=form,
            quality=wishes.quality,
            only_exact=self._is_blank or (not is_new and is_early),
            is_due=self._has_unsent or (self._has_other_display(newest) if is_new else self._is_owed(wishes)),
            is_told=self.is_exact and is_answered,
            received_s=None if is_answered else newest.received_s,
            frame=window.next_frame,
            view=self.name,
            size=self.size,
        )

    def _has_other_display(self, newest: Target) -> bool:
        return self._answered is not None and self._answered.look.display != newest.look.display

    def _is_owed(self, wishes: Wishes) -> bool:
        """Whether there are tiles in HDR to come after a JPEG, or after steps that were not sent."""
        return bool(self._lacking) and wishes.form != "jpeg"

    def painted(self, order: Order, painted: Painted, wishes: Wishes) -> None:
        """Remember what the client has when `painted` is sent."""
        tiles, exact = painted.advance.tiles, painted.advance.exact
        if tiles:
            self._pace.learn(painted.update_ms, exact)
        if self.is_behind(order.target) and tiles and order.received_s is not None:
            self._moving_bytes = 4 * sum(w * h for _, _, w, h in tiles)
        self.target, self.need, self.advance = order.target, painted.need, painted.advance
        is_done = exact or not tiles
        if painted.message is None:
            self._lacking = self._lacking.union(tiles)
            self._has_unsent = self._has_unsent or bool(tiles)
            self._wait(is_done, wishes)
            return
        self._lacking = self._all_tiles if order.form == "jpeg" else frozenset()
        self._has_unsent, self._answered, self.is_exact = False, order.target, exact
        self._is_blank = self._is_blank and not exact
        self.is_settled = is_done and not self._is_owed(wishes)
        self.not_before_s = 0.0

    def _wait(self, is_done: bool, wishes: Wishes) -> None:
        """Nothing was sent: nothing is to be shown, or it is too early; a slow link waits for the exact picture."""
        has_more = self._has_unsent or self._is_owed(wishes)
        self.is_settled = is_done and (self._is_blank or self._is_link_slow or not has_more)
        self.not_before_s = self._sent_s + REFINE_SEND_S if is_done else 0.0

    def sent(self, now_s: float) -> None:
        """A frame has been handed to the socket."""
        self._sent_s = now_s
