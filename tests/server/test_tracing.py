"""Tracing: spans of an edit, a rejected edit and a freeze; none if tracing is off."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from typing import Any

import pytest
from fastapi.testclient import TestClient
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from server_fakes import Control
from session_client import SIGMA, THETA_D, Baked, open_session

from relume_server.settings import Settings
from relume_server.telemetry.collector import TraceExporter


@pytest.fixture
def sent() -> list[ExportTraceServiceRequest]:
    """Requests to the collector."""
    return []


@pytest.fixture
def settings(
    settings: Settings, sent: list[ExportTraceServiceRequest], monkeypatch: pytest.MonkeyPatch
) -> Iterator[Settings]:
    class Collector(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            sent.append(ExportTraceServiceRequest.FromString(body))
            self.send_response(200)
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    collector = ThreadingHTTPServer(("127.0.0.1", 0), Collector)
    threading.Thread(target=collector.serve_forever, args=(0.01,), daemon=True).start()
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", f"http://127.0.0.1:{collector.server_port}")
    monkeypatch.setenv("OTEL_BSP_SCHEDULE_DELAY", "50")
    settings.traces = True
    yield settings
    collector.shutdown()
    collector.server_close()


def spans_of(sent: list[ExportTraceServiceRequest]) -> list[Any]:
    return [
        span
        for request in sent
        for resource_spans in request.resource_spans
        for scope in resource_spans.scope_spans
        for span in scope.spans
    ]


def attributes_of(span: Any) -> dict[str, Any]:
    return {each.key: getattr(each.value, each.value.WhichOneof("value")) for each in span.attributes}


def test_edit_is_traced_from_the_socket_to_the_frame(
    client: TestClient, baked: Baked, control: Control, sent: list[ExportTraceServiceRequest]
) -> None:
    with open_session(client, baked.bake, headers={"X-Request-ID": "r-1"}) as session:
        hello = session.text("hello")
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        control.freeze_gate.set()
        while (status := session.text("status"))["state"] != "ready":
            pass
        session.edit(1, SIGMA, 0.3, control=SIGMA)
        frame = session.exact(1)
        session.edit(1, SIGMA, 0.4)
        session.text("problem")
    traces = client.app.state.services.live.traces  # type: ignore[attr-defined]
    traces.close()
    assert {
        value.value.string_value for request in sent for value in request.resource_spans[0].resource.attributes
    } >= {"relume"}
    spans = spans_of(sent)
    (root,) = (span for span in spans if span.name == "edit" and not span.status.code)
    attributes = attributes_of(root)
    assert attributes["relume.session"] == hello["session"]
    assert (attributes["relume.request"], attributes["relume.bake"]) == ("r-1", baked.bake)
    assert (attributes["relume.revision"], attributes["relume.view"], attributes["relume.active_control"]) == (
        1,
        "front",
        SIGMA,
    )
    assert attributes["relume.frame"] <= frame.header["frame"]
    children = [span for span in spans if span.parent_span_id == root.span_id]
    assert [child.name for child in children] == [
        f"edit.{name}" for name in ("apply", "wait", "update", "encode", "send")
    ]
    times = [time for child in children for time in (child.start_time_unix_nano, child.end_time_unix_nano)]
    assert all(early <= late for early, late in pairwise(times))
    assert (times[0], times[-1]) == (root.start_time_unix_nano, root.end_time_unix_nano)
    (refused,) = (span for span in spans if span.name == "edit" and span.status.code)
    assert "is not newer than" in refused.status.message
    assert {attributes_of(span)["relume.label"] for span in spans if span.name == "freeze"} == {status["label"]}


def test_collector_outage_and_recovery_are_logged_once(
    settings: Settings, sent: list[ExportTraceServiceRequest], caplog: pytest.LogCaptureFixture
) -> None:
    exporter = OTLPSpanExporter(timeout=1)
    reachable, unreachable = exporter._client._endpoint, "http://127.0.0.1:9/v1/traces"
    collector = TraceExporter(exporter)
    for endpoint in (reachable, unreachable, unreachable, reachable):
        exporter._client._endpoint = endpoint
        collector.export(())
    collector.shutdown()
    (lost, recovered) = caplog.records
    assert (lost.levelname, recovered.levelname) == ("ERROR", "WARNING")
    assert "the trace collector does not answer" in lost.getMessage()
    assert len(sent) == 2
