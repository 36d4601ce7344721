"""`relume bench`: the project's own figures."""

from __future__ import annotations

from typing import Annotated

import typer


def bench(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Run those whose name starts with this.")] = "",
    json: Annotated[bool, typer.Option("--json", help="Print a JSON list of name, value, unit, context.")] = False,
) -> int:
    """Measure; ratios have both sides measured in the same run."""
    from relume_bench.registry import run

    result = run(name, json)
    return result if isinstance(result, int) else 0
