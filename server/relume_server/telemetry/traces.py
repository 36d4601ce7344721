"""Traces of edits by OpenTelemetry: what happens between an edit's coming in and its frame's going out.

Spans are made when a frame has been sent, of times that were taken anyhow: without an exporter nothing of this exists,
and OpenTelemetry's SDK is not even imported. Where spans go, as what service and how many of them, its own
variables say (`OTEL_EXPORTER_OTLP_ENDPOINT`, `OTEL_SERVICE_NAME`, `OTEL_TRACES_SAMPLER`, …).
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
    """When the parts of an answer were done, seconds of `time.perf_counter`.

    Attributes:
        received_s: the edit, or the eye, came out of the socket. applied_s: it was checked and applied.
        started_s: a thread began to bring the picture on. updated_s: that was done. encoded_s: the frame was packed.
        send_start_s: it was given to the socket. send_end_s: the socket had taken it.
    """

    received_s: float
    applied_s: float
    started_s: float
    updated_s: float
    encoded_s: float
    send_start_s: float
    send_end_s: float

    def spans(self) -> Mapping[str, tuple[float, float]]:
        """Spans in a frame's: from when to when."""
        return {
            "apply": (self.received_s, self.applied_s),
            "wait": (self.applied_s, self.started_s),
            "update": (self.started_s, self.updated_s),
            "encode": (self.updated_s, self.encoded_s),
            "send": (self.send_start_s, self.send_end_s),
        }


class Traces:
    """Makes spans; may be used from any thread."""

    def __init__(self, provider: TracerProvider) -> None:
        self._provider, self._tracer = provider, provider.get_tracer(SERVICE)

    def record_frame(self, name: str, times: SpanTimes, attributes: Mapping[str, str | int | bool]) -> None:
        """An edit has been answered by a frame.

        Args:
            name: "edit" or "camera". times: of its parts. attributes: without the prefix that all have.
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
        """A curve, or what else stands still beside a hand, has been made ready; it took from then until now."""
        self._span("freeze", start_s, attributes, _zero_ns()).end()

    def record_refusal(self, received_s: float, reason: str, attributes: Mapping[str, str | int | bool]) -> None:
        """An edit that came then was refused."""
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
        """Send what waits."""
        self._provider.shutdown()


def open_traces(exporter: SpanExporter | None = None) -> Traces:
    """Traces that go to a collector by OTLP, or to another exporter."""
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
    """Since 1970, when `time.perf_counter` was 0."""
    return time.time_ns() - time.perf_counter_ns()
