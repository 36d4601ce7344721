"""`relume worker`: joins a cluster."""

from __future__ import annotations

from typing import Annotated

import typer


def worker(
    scheduler: Annotated[str, typer.Option(metavar="tcp://…", help="Address of the Dask scheduler to join.")],
    processes: Annotated[int | None, typer.Option(min=1, max=1024, help="Worker processes; else one per core.")] = None,
) -> int:
    """Bake for a cluster until stopped. Every worker needs the data folder at the same path as the server."""
    from worker.cluster import join

    return join(scheduler, processes)
