"""Print results and notes.

stdout has results only, one per line: ids and names for the next command, or written files; with --json one JSON object
per line. All other text goes to stderr.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON, one object per line.")]
is_quiet: ContextVar[bool] = ContextVar("is_quiet", default=False)
"""Whether --quiet was given: no progress, no notes."""


def print_result(document: Mapping[str, Any], line: str, *, as_json: bool, details: Iterable[str] = ()) -> None:
    """Print one result.

    Args:
        document: the result as JSON. line: the result as text. as_json: whether JSON was asked for.
        details: more lines for stderr, which the JSON contains as well.
    """
    typer.echo(json.dumps(document) if as_json else line)
    if not as_json:
        for detail in details:
            note(detail)


def note(line: str) -> None:
    """Print a note on stderr, unless --quiet was given."""
    if not is_quiet.get():
        typer.echo(line, err=True)


def iso_time(posix_s: float) -> str:
    """Format a time like REST: ISO 8601, UTC."""
    return datetime.fromtimestamp(posix_s, UTC).isoformat()
