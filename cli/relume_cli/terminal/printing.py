"""The one way in which commands print results.

stdout has results alone: ids and names that the next command takes, or files that were written, a line each; with
--json the same as JSON objects, a line each. All else, in words for people, goes to stderr.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON, one object a line.")]
is_quiet: ContextVar[bool] = ContextVar("is_quiet", default=False)
"""Whether --quiet was given: nothing of progress, and no notes."""


def print_result(document: Mapping[str, Any], line: str, *, as_json: bool, details: Iterable[str] = ()) -> None:
    """Print one result.

    Args:
        document: all that is to be said of it, for machines. line: what goes to stdout else. as_json: whether it was
            asked for. details: lines for people beside it, which JSON has as well.
    """
    typer.echo(json.dumps(document) if as_json else line)
    if not as_json:
        for detail in details:
            note(detail)


def note(line: str) -> None:
    """Tell people something that no result depends on."""
    if not is_quiet.get():
        typer.echo(line, err=True)


def iso_time(posix_s: float) -> str:
    """A time as REST writes it: ISO 8601, UTC."""
    return datetime.fromtimestamp(posix_s, UTC).isoformat()


def size_text(num_bytes: float) -> str:
    """A size for people."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if num_bytes >= size:
            return f"{num_bytes / size:,.1f} {unit}"
    return f"{num_bytes / 1e3:,.1f} kB"
