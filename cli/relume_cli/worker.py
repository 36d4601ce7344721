"""`relume worker`: bake for servers, from the database or for a Dask cluster."""

from __future__ import annotations

import signal
import threading
from typing import Annotated

import typer

from relume_cli.options import Data


def worker(
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://…", help="Dask scheduler to join. [default: queue in the database]")
    ] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Worker processes. [default: one per core]")
    ] = None,
    data: Data = None,
) -> int:
    """Bake for servers until stopped.

    Takes whole bakes from the queue in the database (RELUME_DATABASE), and needs the server's data directory, or
    RELUME_STORAGE and a directory of its own. With --scheduler it takes tasks of a Dask scheduler, and every worker
    needs the data directory at the same path as the server.
    """
    if scheduler is not None:
        from relume_worker.cluster import join

        return join(scheduler, processes)
    from relume_cli.data_folder import open_settings, private_files
    from relume_server.telemetry.logs.setup import set_up
    from relume_worker.service import BakeService

    settings, stop_requested = open_settings(data), threading.Event()
    set_up(settings.log_format, settings.log_level)
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: stop_requested.set())
    with (
        private_files(),
        BakeService(settings.data, settings.database_url, num_workers=processes, client_weights=settings.fair_shares),
    ):
        typer.echo("waiting for bakes", err=True)
        stop_requested.wait()
    return 0
