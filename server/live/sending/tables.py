"""What a client's shader has of a view that it draws, and whether the link carries what changes while a hand moves."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING

from server.live.state.frame_window import FrameWindow
from server.live.state.target import Target

if TYPE_CHECKING:
    from server.live.sending.painter import Painted


class Tables:
    """Of one view. Light that changes brings vectors of all points anew, megabytes where surfaces are glossy: a link
    that is too slow for them gets pictures while a hand moves, and tables when it rests (ADR 91).

    Attributes:
        known: keys of the parts that the client's shader has.
        is_behind: a picture was sent in their place.
    """

    def __init__(self) -> None:
        self.known: Mapping[str, Hashable] = {}
        self._num_bytes: dict[str, int] = {}  # that a change took last, by what the hand was on
        self._of_all = 0
        self._kind = ""
        self.is_behind = False
        self._are_slow = False

    def are_too_large(self, newest: Target, window: FrameWindow, is_behind: bool) -> bool:
        """Whether those that the newest look needs would stutter on this link.

        Args:
            newest: the look. window: that knows the link. is_behind: the client has no frame of that look yet.
        """
        if not is_behind and not self.is_behind:  # the eye alone has moved
            return False
        num_bytes = self._num_bytes.get(self._kind_of(newest), self._of_all)
        self._are_slow = window.is_slow_for(num_bytes, was_slow=self._are_slow)
        return self._are_slow

    def painted(self, is_behind: bool, target: Target, painted: Painted) -> None:
        """Remember what the client has when a frame is sent.

        Args:
            is_behind: it is the first of its look. target: that it shows. painted: what came of it.
        """
        self._kind = self._kind_of(target)
        if painted.known is None:
            self.is_behind = self.is_behind or is_behind
            return
        if painted.message is not None and painted.known != self.known:
            self._num_bytes[self._kind] = len(painted.message)
            self._of_all = self._of_all or len(painted.message)
        self.known, self.is_behind = painted.known, False

    def _kind_of(self, target: Target) -> str:
        """Of what a hand is on, the first name: materials and lights change different parts."""
        return self._kind if target.hand is None else target.hand.split("/")[1]
