"""Flow control of one client: at most two unacknowledged frames, and throughput measured from acknowledgments."""

from __future__ import annotations

from dataclasses import dataclass

from relume.core.errors import ProtocolError
from relume_server.client_state.visible_views import VisibleViews
from relume_server.errors import CLOSE_NO_ACKNOWLEDGEMENT
from relume_server.schemas.protocol import MAX_FRAMES_IN_FLIGHT

MEASURED_BYTES = 16 * 1024
SLOW_S, QUICK_S = 0.066, 0.040


@dataclass(frozen=True)
class _InFlightFrame:
    view: str
    sent_s: float
    num_bytes: int


class FrameWindow:
    """Frames that the client has not acknowledged. Times are monotonic, in seconds."""

    def __init__(self, ack_seconds: float) -> None:
        self._ack_seconds = ack_seconds
        self._in_flight: dict[int, _InFlightFrame] = {}
        self._last_frame = 0
        self._last_ack_s = 0.0
        self._round_trip_s = float("inf")
        self._bytes_per_s: float | None = None

    def has_room(self, view: str, visible_views: VisibleViews) -> bool:
        """True if another frame of a view may be sent: a single view has all slots; of several, the focused one has a
        slot of its own, and the others share the rest.
        """
        if len(self._in_flight) >= MAX_FRAMES_IN_FLIGHT:
            return False
        if len(visible_views.names) == 1:
            return True
        is_focused = view == visible_views.focus
        num_alike = sum((in_flight.view == visible_views.focus) == is_focused for in_flight in self._in_flight.values())
        return num_alike < (1 if is_focused else MAX_FRAMES_IN_FLIGHT - 1)

    @property
    def num_in_flight(self) -> int:
        """Number of unacknowledged frames."""
        return len(self._in_flight)

    @property
    def next_frame(self) -> int:
        """Id of the next frame."""
        return self._last_frame + 1

    def on_sent(self, view: str, num_bytes: int, now_s: float) -> None:
        """Record a frame that is sent."""
        self._last_frame += 1
        self._in_flight[self._last_frame] = _InFlightFrame(view, now_s, num_bytes)

    def on_acknowledged(self, frame: int, now_s: float) -> None:
        """Record an acknowledgment of this frame and all before it.

        Raises:
            ProtocolError: the frame was never sent.
        """
        if frame > self._last_frame or frame < 1:
            raise ProtocolError(f"frame {frame} was never sent; acknowledge received frames only", 1002)
        in_flight = self._in_flight.get(frame)
        for earlier in [f for f in self._in_flight if f <= frame]:
            del self._in_flight[earlier]
        if in_flight is not None:
            self._measure(in_flight, now_s)
        self._last_ack_s = now_s

    def _measure(self, in_flight: _InFlightFrame, now_s: float) -> None:
        """Throughput from bytes over the time beyond the fastest round trip; frames queue behind each other."""
        transfer_s = max(now_s - max(in_flight.sent_s, self._last_ack_s), 1e-4)
        self._round_trip_s = min(self._round_trip_s, now_s - in_flight.sent_s)
        if in_flight.num_bytes < MEASURED_BYTES:
            return
        rate = in_flight.num_bytes / max(transfer_s - 0.5 * self._round_trip_s, 1e-4)
        self._bytes_per_s = rate if self._bytes_per_s is None else 0.7 * self._bytes_per_s + 0.3 * rate

    def is_slow_for(self, num_bytes: int, *, was_slow: bool) -> bool:
        """True if frames of this size would stutter on this connection.

        Args:
            num_bytes: size in bytes of a frame. was_slow: result for the previous frame, for hysteresis.
        """
        if self._bytes_per_s is None:
            return was_slow
        return num_bytes / self._bytes_per_s > (QUICK_S if was_slow else SLOW_S)

    def check(self, now_s: float) -> None:
        """Raise ProtocolError if a frame is unacknowledged for too long."""
        if self._in_flight and now_s - next(iter(self._in_flight.values())).sent_s > self._ack_seconds:
            raise ProtocolError(
                f"no frame was acknowledged for {self._ack_seconds:g} s; reload the page", CLOSE_NO_ACKNOWLEDGEMENT
            )
