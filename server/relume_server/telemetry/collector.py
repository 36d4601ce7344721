"""Log lines about the trace collector. Importing this loads OpenTelemetry's SDK."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

from opentelemetry.sdk.trace import ReadableSpan
from opentelemetry.sdk.trace.export import SpanExporter, SpanExportResult

from relume.core.errors import RelumeError
from relume_worker.database.failures import Outage

EXPORTER = "opentelemetry.exporter.otlp.proto.http.trace_exporter"
log = logging.getLogger(__name__)


class TraceExporter(SpanExporter):
    """Wraps an exporter; logs one line when the collector is lost, and one when it is back.

    OpenTelemetry itself logs four warnings per batch, every five seconds; the first contains the cause.
    """

    def __init__(self, exporter: SpanExporter) -> None:
        """
        Args:
            exporter: sends the spans.
        """
        self._exporter, self._messages = exporter, list[str]()
        self._outage = Outage(log, "the trace collector")
        logging.getLogger(EXPORTER).addFilter(self._collect_message)

    def _collect_message(self, record: logging.LogRecord) -> bool:
        self._messages.append(record.getMessage())
        return False

    def export(self, spans: Sequence[ReadableSpan]) -> SpanExportResult:
        """Send spans; those that cannot be sent are dropped."""
        self._messages.clear()
        began_s = time.monotonic()
        result = self._exporter.export(spans)
        if result is SpanExportResult.SUCCESS:
            self._outage.report_recovered(began_s)
        else:
            message = self._messages[0] if self._messages else "it accepts none"
            self._outage.report_failure(RelumeError(message), began_s)
        return result

    def shutdown(self) -> None:
        """Shut the exporter down."""
        self._exporter.shutdown()
        logging.getLogger(EXPORTER).removeFilter(self._collect_message)

    def force_flush(self, timeout_millis: int = 30_000) -> bool:
        """True: nothing is buffered here."""
        return True
