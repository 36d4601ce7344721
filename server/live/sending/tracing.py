"""What a trace says of a frame that answers an edit or an eye."""

from __future__ import annotations

from server.live.sending.painter import FrameRequest, Painted
from server.traces import Times


def told_of(
    request: FrameRequest, painted: Painted, num_bytes: int, sending_s: float, sent_s: float
) -> tuple[str, Times, dict[str, str | int | bool]]:
    """Name, times and attributes of its span.

    Args:
        request: that answers something. painted: what came of it. num_bytes: of the message.
        sending_s, sent_s: before and after it went to the socket, seconds of `time.perf_counter`.
    """
    received_s = request.received_s or painted.started_s
    taken_s = received_s if request.eye is not None else max(received_s, request.target.taken_s)
    updated_s = painted.started_s + painted.update_ms / 1e3
    times = Times(
        received_s, taken_s, painted.started_s, updated_s, updated_s + painted.encode_ms / 1e3, sending_s, sent_s
    )
    about: dict[str, str | int | bool] = {
        "view": request.view,
        "frame": request.frame,
        "revision": request.target.revision,
        "shared": request.target.shared,
        "hand": request.target.hand or "",
        "format": request.form,
        "fidelity": painted.advance.fidelity,
        "bytes": num_bytes,
    }
    return "edit" if request.eye is None else "eye", times, about
