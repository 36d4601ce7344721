"""`relume bench`: run the benchmarks."""

from __future__ import annotations

from typing import Annotated

import typer


def bench(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME]", help="Run benchmarks whose name starts with this, and those measured with them."
        ),
    ] = "",
    json: Annotated[bool, typer.Option("--json", help="Print a JSON list of name, value, unit, context.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Only the accuracy figures that take seconds.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Fail if a figure is past its target.")] = False,
    older: Annotated[bool, typer.Option("--older", help="List stored figures older than the code.")] = False,
) -> int:
    """Run the benchmarks.

    Both sides of a ratio are measured in the same run.
    """
    from relume_bench.registry import print_older, run

    if older:
        return print_older(name)
    result = run(name, json, quick=quick, check=check)
    return result if isinstance(result, int) else 0
