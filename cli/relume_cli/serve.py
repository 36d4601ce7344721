"""`relume serve`: start the server."""

from __future__ import annotations

import logging
import socket
from typing import Annotated

import typer

from relume_cli.options import Data, Scheduler

log = logging.getLogger(__name__)
Host = Annotated[str | None, typer.Option(help="Address to listen on. [default: 127.0.0.1]")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Port to listen on. [default: 8420]")]


def serve(data: Data = None, host: Host = None, port: Port = None, scheduler: Scheduler = None) -> None:
    """Serve the editor and the API, with an embedded worker unless --scheduler is given."""
    from relume.image_io.ocio.active_config import get_config
    from relume_cli.data_folder import open_settings, private_files
    from relume_server.app import serve as run_server
    from relume_server.auth.access_check import check_access_settings
    from relume_worker.database import open_database
    from relume_worker.storage.remote import get_storage

    settings = open_settings(data, host=host, port=port, scheduler=scheduler)
    check_access_settings(settings)
    check_port(settings.host, settings.port)
    with private_files():
        open_database(settings.database_url).dispose()  # all three fail early if they are misconfigured
        get_config()
        get_storage()
        url = address(settings.host, settings.port)
        run_server(settings, on_started=lambda: announce(f"relume listens on {url}", settings.log_format))


def announce(line: str, log_format: str) -> None:
    """Print a line at any log level; in JSON logs, as a log record."""
    if log_format == "json":
        log.warning(line)
    else:
        typer.echo(line, err=True)


def check_port(host: str, port: int) -> None:
    """Raise ParameterError if the address cannot be bound."""
    from relume.core.errors import ParameterError

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.create_server((host, port), family=family).close()
    except OSError as error:
        raise ParameterError("--port", port, f"a free port of {host} ({error.strerror})") from None


def address(host: str, port: int) -> str:
    """URL of the server for a browser on this machine."""
    browser_host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)  # noqa: S104
    return f"http://{browser_host}:{port}/"
