"""What a client's shader has of a view that it draws, and whether the link carries what changes while a hand moves."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING

from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.target import Target

if TYPE_CHECKING:
    from relume_server.session.frames.painter import Painted


class ClientRenderState:
    """Of one view. Light that changes brings vectors of all points anew, megabytes where surfaces are glossy: a link
    that is too slow for them gets pictures while a hand moves, and tables when it rests (ADR 24).

    Attributes:
        client_keys: keys of the parts that the client's shader has.
        is_outdated: a picture was sent in their place.
    """

    def __init__(self) -> None:
        self.client_keys: Mapping[str, Hashable] = {}
        self._update_bytes: dict[str, int] = {}  # that a change took last, by what the hand was on
        self._first_update_bytes = 0
        self._last_kind = ""
        self.is_outdated = False
        self._are_slow = False

    def are_too_large(self, newest: Target, window: FrameWindow, is_outdated: bool) -> bool:
        """Whether those that the newest look needs would stutter on this link.

        Args:
            newest: the look. window: that knows the link. is_outdated: the client has no frame of that look yet.
        """
        if not is_outdated and not self.is_outdated:  # the eye alone has moved
            return False
        num_bytes = self._update_bytes.get(self._edit_kind(newest), self._first_update_bytes)
        self._are_slow = window.is_slow_for(num_bytes, was_slow=self._are_slow)
        return self._are_slow

    def on_painted(self, is_outdated: bool, target: Target, painted: Painted) -> None:
        """Remember what the client has when a frame is sent.

        Args:
            is_outdated: it is the first of its look. target: that it shows. painted: what came of it.
        """
        self._last_kind = self._edit_kind(target)
        if painted.client_keys is None:
            self.is_outdated = self.is_outdated or is_outdated
            return
        if painted.message is not None and painted.client_keys != self.client_keys:
            self._update_bytes[self._last_kind] = len(painted.message)
            self._first_update_bytes = self._first_update_bytes or len(painted.message)
        self.client_keys, self.is_outdated = painted.client_keys, False

    def _edit_kind(self, target: Target) -> str:
        """Of what a hand is on, the first name: materials and lights change different parts."""
        return self._last_kind if target.active_pointer is None else target.active_pointer.split("/")[1]
