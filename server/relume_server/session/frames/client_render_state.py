"""Data of a view that the client renders itself, and whether the connection is fast enough for its updates."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING

from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.target import Target

if TYPE_CHECKING:
    from relume_server.session.frames.painter import Painted


class ClientRenderState:
    """State of one view. A light change updates the coefficients of all probes, megabytes on glossy surfaces: on a
    connection too slow for them, the client gets images while dragging, and the tables afterwards (ADR 24).

    Attributes:
        client_keys: keys of the parts that the client's shader has.
        is_outdated: an image was sent instead.
    """

    def __init__(self) -> None:
        self.client_keys: Mapping[str, Hashable] = {}
        self._update_bytes: dict[str, int] = {}  # bytes of the last update, by kind of edit
        self._first_update_bytes = 0
        self._last_kind = ""
        self.is_outdated = False
        self._are_slow = False

    def are_too_large(self, newest: Target, window: FrameWindow, is_outdated: bool) -> bool:
        """True if the tables for the newest look would stutter on this connection.

        Args:
            newest: target. window: measures the connection. is_outdated: the client has no frame of this look yet.
        """
        if not is_outdated and not self.is_outdated:  # only the camera has moved
            return False
        num_bytes = self._update_bytes.get(self._edit_kind(newest), self._first_update_bytes)
        self._are_slow = window.is_slow_for(num_bytes, was_slow=self._are_slow)
        return self._are_slow

    def on_painted(self, is_outdated: bool, target: Target, painted: Painted) -> None:
        """Record a sent frame.

        Args:
            is_outdated: it is the first of its look. target: target of the frame. painted: result of the step.
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
        """First name of the active pointer: materials and lights change different parts."""
        return self._last_kind if target.active_pointer is None else target.active_pointer.split("/")[1]
