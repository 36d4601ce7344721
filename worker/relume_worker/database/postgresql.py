"""Connections to PostgreSQL by pg8000, with timeouts and uniform errors."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pg8000

TIMEOUT_S = 10.0  # for connecting, and for each answer: covers dead hosts and hanging servers
PORT = 5432


class _Connection(pg8000.Connection):  # type: ignore[misc]  # it has no types
    """A pg8000 connection whose socket errors are always InterfaceError.

    pg8000 itself passes some through. SQLAlchemy drops connections by this error; failed connections are closed.
    """

    def __init__(self, sock: socket.socket, **settings: Any) -> None:
        self._usock = self._sock = None
        try:
            super().__init__(sock=sock, **settings)
        except BaseException:
            self.close()
            sock.close()
            raise

    def handle_messages(self, context: Any) -> None:
        with _network():
            super().handle_messages(context)

    def close(self) -> None:
        stream = self._sock  # pg8000 leaves the socket open if its last message cannot be sent
        with suppress(pg8000.InterfaceError):  # the server is gone
            super().close()
        if stream is not None:
            with suppress(OSError):
                stream.close()


def connect_postgresql(_: object, __: object, ___: object, settings: dict[str, Any]) -> _Connection:
    """Connect for an engine; listens to its `do_connect`. Raises pg8000's errors.

    Args:
        _, __, ___: dialect, pool record and arguments of the event; unused.
        settings: from the URL: user, host, and optionally port, database, password, sslmode.
    """
    address = settings["host"], settings.get("port", PORT)
    password = settings.get("password", "")  # otherwise pg8000 fails on servers that require a password
    extra_settings = {
        "password": password,
        "application_name": "relume",
        "ssl_context": _tls(settings.get("sslmode", "prefer")),
    }
    with _network():
        sock = socket.create_connection(address, TIMEOUT_S)
        return _Connection(
            sock, **{name: value for name, value in settings.items() if name != "sslmode"} | extra_settings
        )


def _tls(mode: str) -> ssl.SSLContext | None:
    """TLS mode: None uses TLS if it is offered, a context requires it."""
    if mode == "prefer":
        return None
    context = ssl.create_default_context()
    if mode == "require":  # any certificate
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


@contextmanager
def _network() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise pg8000.InterfaceError(f"network error: {error}") from error
