"""OpenTelemetry traces of edits: from receiving an edit to sending its frame.

Spans are created after a frame is sent, from times that are measured anyway: without an exporter there is no cost, and
OpenTelemetry's SDK is not imported. Destination, service name and sampling are set by its own variables
(`OTEL_EXPORTER_OTLP_ENDPOINT`, `OTEL_SERVICE_NAME`, `OTEL_TRACES_SAMPLER`, …).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from relume_server.telemetry.logs.context import current

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import SpanExporter
    from opentelemetry.trace import Span

SERVICE = "relume"


@dataclass(frozen=True)
class SpanTimes:
    """Times of one frame, seconds of `time.perf_counter`.

    Attributes:
        received_s: the edit or camera message was received. applied_s: it was validated and applied.
        started_s: a thread started to update the image. updated_s: the image was updated. encoded_s: the frame was
            packed.
        send_start_s: sending started. send_end_s: the socket had accepted the frame.
    """

    received_s: float
    applied_s: float
    started_s: float
    updated_s: float
    encoded_s: float
    send_start_s: float
    send_end_s: float

    def spans(self) -> Mapping[str, tuple[float, float]]:
        """Child spans of the frame's span: start and end."""
        return {
            "apply": (self.received_s, self.applied_s),
            "wait": (self.applied_s, self.started_s),
            "update": (self.started_s, self.updated_s),
            "encode": (self.updated_s, self.encoded_s),
            "send": (self.send_start_s, self.send_end_s),
        }


class Traces:
    """Creates spans. Thread-safe."""

    def __init__(self, provider: TracerProvider) -> None:
        self._provider, self._tracer = provider, provider.get_tracer(SERVICE)

    def record_frame(self, name: str, times: SpanTimes, attributes: Mapping[str, str | int | bool]) -> None:
        """Record a frame that answers an edit.

        Args:
            name: "edit" or "camera". times: times of the frame. attributes: attributes without the common prefix.
        """
        from opentelemetry.trace import set_span_in_context

        zero_ns = _zero_ns()
        span = self._span(name, times.received_s, attributes, zero_ns)
        context = set_span_in_context(span)
        for span_name, (start_s, end_s) in times.spans().items():
            child_span = self._tracer.start_span(
                f"{name}.{span_name}", context, start_time=zero_ns + round(start_s * 1e9)
            )
            child_span.end(zero_ns + round(end_s * 1e9))
        span.end(zero_ns + round(times.send_end_s * 1e9))

    def record_freeze(self, start_s: float, attributes: Mapping[str, str | int | bool]) -> None:
        """Record the precomputing of a curve, or of other static light, from `start_s` until now."""
        self._span("freeze", start_s, attributes, _zero_ns()).end()

    def record_refusal(self, received_s: float, reason: str, attributes: Mapping[str, str | int | bool]) -> None:
        """Record a rejected edit."""
        from opentelemetry.trace import Status, StatusCode

        span = self._span("edit", received_s, attributes, _zero_ns())
        span.set_status(Status(StatusCode.ERROR, reason))
        span.end()

    def _span(self, name: str, start_s: float, attributes: Mapping[str, str | int | bool], zero_ns: int) -> Span:
        span_attributes = {
            f"relume.{key}": value for key, value in {**current(), **attributes}.items() if key != "user"
        }
        return self._tracer.start_span(name, start_time=zero_ns + round(start_s * 1e9), attributes=span_attributes)

    def close(self) -> None:
        """Send buffered spans."""
        self._provider.shutdown()


def open_traces(exporter: SpanExporter | None = None) -> Traces:
    """Open traces to a collector by OTLP, or to the given exporter."""
    from opentelemetry.sdk.resources import SERVICE_NAME, Resource
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor

    from relume_server.telemetry.collector import TraceExporter

    if exporter is None:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter

        exporter = OTLPSpanExporter()
    resource = Resource.create()
    if str(resource.attributes[SERVICE_NAME]).startswith("unknown_service"):
        resource = resource.merge(Resource({SERVICE_NAME: SERVICE}))
    provider = TracerProvider(resource=resource, shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(TraceExporter(exporter)))
    return Traces(provider)


def _zero_ns() -> int:
    """Time since 1970 at `time.perf_counter` 0, nanoseconds."""
    return time.time_ns() - time.perf_counter_ns()
