"""Span attributes of a frame that answers an edit or a camera message."""

from __future__ import annotations

from relume_server.session.frames.painter import FrameRequest, Painted
from relume_server.telemetry.traces import SpanTimes


def trace_fields(
    request: FrameRequest, painted: Painted, num_bytes: int, send_start_s: float, send_end_s: float
) -> tuple[str, SpanTimes, dict[str, str | int | bool]]:
    """Return the name, times and attributes of a frame's span.

    Args:
        request: answered by the frame. painted: result of the step. num_bytes: size in bytes of the message.
        send_start_s, send_end_s: before and after sending, seconds of `time.perf_counter`.
    """
    received_s = request.received_s or painted.started_s
    applied_s = received_s if request.camera_state is not None else max(received_s, request.target.applied_s)
    updated_s = painted.started_s + painted.update_ms / 1e3
    times = SpanTimes(
        received_s,
        applied_s,
        painted.started_s,
        updated_s,
        updated_s + painted.encode_ms / 1e3,
        send_start_s,
        send_end_s,
    )
    attributes: dict[str, str | int | bool] = {
        "view": request.view,
        "frame": request.frame,
        "revision": request.target.revision,
        "room_revision": request.target.room_revision,
        "active_control": request.target.active_pointer or "",
        "format": request.form,
        "fidelity": painted.progress.fidelity.value,
        "bytes": num_bytes,
    }
    return "edit" if request.camera_state is None else "camera", times, attributes
