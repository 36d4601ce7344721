"""How lines of the log look: text for people, or JSON for machines, with what they are about."""

from __future__ import annotations

import json
import logging
from datetime import UTC, datetime
from typing import Any, Literal

from relume_server.telemetry.logs.context import current

Format = Literal["plain", "json"]


class JsonFormatter(logging.Formatter):
    """One JSON object a line: time, level, logger, message, what it is about, and the trace where there is one."""

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
    """A line of text; what it is about stands at its end.

    What clients chose is in it: line breaks and codes for terminals are shown, so that nobody writes lines of their
    own, and lines of a trace are set in.
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
    """A text with what cannot be printed as Python writes it."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def _attach_context(record: logging.LogRecord) -> bool:
    """Write down what is worked on where a line is logged, which may not be where it is formatted."""
    record.about = current()
    return True


_CONNECTION_LOGGERS = "uvicorn.error", "websockets"
"""Loggers that below a warning write down addresses with their queries, headers, and messages: all of them may hold
tokens, and `relume_server.telemetry.logs.requests` says the rest."""


def _is_relevant(record: logging.LogRecord) -> bool:
    """Not what uvicorn says of each WebSocket that is answered by a refusal: it takes that for no answer."""
    return record.name != "uvicorn.error" or "without completing handshake" not in record.getMessage()


def set_up(form: Format, level: str) -> None:
    """Log this process's lines in a form, from a level on, or from a lower one where --verbose asked for that."""
    root = logging.getLogger()
    handler = logging.StreamHandler()
    handler.setFormatter(JsonFormatter() if form == "json" else PlainFormatter())
    handler.addFilter(_is_relevant)
    handler.addFilter(_attach_context)
    verbose = [logging.INFO] if any(each.level == logging.INFO for each in root.handlers) else []
    handler.setLevel(min([logging.getLevelNamesMapping()[level.upper()], *verbose]))
    root.handlers = [handler]
    logging.captureWarnings(True)  # they are lines of this log, too
    root.setLevel(handler.level)
    for name in _CONNECTION_LOGGERS:
        logging.getLogger(name).setLevel(max(logging.WARNING, handler.level))
