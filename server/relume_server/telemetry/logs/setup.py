"""Log format: text for people, or JSON for machines, with the context."""

from __future__ import annotations

import json
import logging
from datetime import UTC, datetime
from typing import Any, Literal

from relume_server.telemetry.logs.context import current

Format = Literal["plain", "json"]


class JsonFormatter(logging.Formatter):
    """One JSON object per line: time, level, logger, message, context, and trace if there is one."""

    def format(self, record: logging.LogRecord) -> str:
        """See `logging.Formatter`."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **getattr(record, "about", {}),
            **getattr(record, "fields", {}),
        }
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


class PlainFormatter(logging.Formatter):
    """A line of text with the context at its end.

    Messages contain text from clients: line breaks and terminal codes are escaped, so that nobody forges log lines, and
    tracebacks are indented.
    """

    def __init__(self) -> None:
        super().__init__("%(levelname)s %(name)s: %(message)s")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  (of the base class)
        """See `logging.Formatter`."""
        context = " ".join(f"{name}={value}" for name, value in getattr(record, "about", {}).items())
        return _escape_unprintable(super().formatMessage(record).rstrip()) + (
            f" [{_escape_unprintable(context)}]" if context else ""
        )

    def formatException(self, exc_info: Any) -> str:  # noqa: N802  (of the base class)
        """See `logging.Formatter`."""
        return "\n".join(f"    {_escape_unprintable(line)}" for line in super().formatException(exc_info).split("\n"))


def _escape_unprintable(text: str) -> str:
    """Escape unprintable characters like Python."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def _attach_context(record: logging.LogRecord) -> bool:
    """Store the context in the record at the time of logging; formatting may run in another thread."""
    record.about = current()
    return True


_CONNECTION_LOGGERS = "uvicorn.error", "websockets"
"""Loggers whose lines below WARNING contain URLs with queries, headers and messages, and so possibly tokens;
`relume_server.telemetry.logs.requests` logs requests instead.
"""


def _is_relevant(record: logging.LogRecord) -> bool:
    """Drop uvicorn's line for each refused WebSocket, which it takes for a missing response."""
    return record.name != "uvicorn.error" or "without completing handshake" not in record.getMessage()


def set_up(form: Format, level: str) -> None:
    """Configure the log of this process: format, and minimum level unless --verbose set a lower one."""
    root = logging.getLogger()
    handler = logging.StreamHandler()
    handler.setFormatter(JsonFormatter() if form == "json" else PlainFormatter())
    handler.addFilter(_is_relevant)
    handler.addFilter(_attach_context)
    verbose = [logging.INFO] if any(each.level == logging.INFO for each in root.handlers) else []
    handler.setLevel(min([logging.getLevelNamesMapping()[level.upper()], *verbose]))
    root.handlers = [handler]
    logging.captureWarnings(True)  # include them in this log
    root.setLevel(handler.level)
    for name in _CONNECTION_LOGGERS:
        logging.getLogger(name).setLevel(max(logging.WARNING, handler.level))
