"""`relume worker`: bakes for others, from the ledger or for a cluster."""

from __future__ import annotations

import signal
import threading
from typing import Annotated

import typer

from relume_cli.options import Data


def worker(
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://…", help="Address of the Dask scheduler to join; else the ledger's own."),
    ] = None,
    processes: Annotated[int | None, typer.Option(min=1, max=1024, help="Worker processes; else one per core.")] = None,
    data: Data = None,
) -> int:
    """Bake for others until stopped: what waits in the ledger (RELUME_DATABASE), or what a Dask scheduler hands out.

    From the ledger this machine takes whole bakes; it needs the server's data folder, or RELUME_STORAGE and a folder of
    its own. For a scheduler every worker needs the data folder at the same path as the server.
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
