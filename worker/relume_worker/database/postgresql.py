"""Connections to PostgreSQL by pg8000 that notice after seconds when nobody answers, and say so in one way."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pg8000

TIMEOUT_S = 10.0  # to connect, and for each answer: of a host that is gone as of a server that hangs
PORT = 5432
TLS_MODES = ("prefer", "require", "verify-full")  # as libpq calls them; the first is what is done without a word


class _Connection(pg8000.Connection):  # type: ignore[misc]  # it has no types
    """pg8000's, which lets errors of the socket through where the first byte of an answer is what fails.

    Here they are always its InterfaceError, by which SQLAlchemy drops connections; and what fails is closed.
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
        stream = self._sock  # which pg8000 leaves open where its last word cannot be sent
        with suppress(pg8000.InterfaceError):  # nobody is there to say goodbye to
            super().close()
        if stream is not None:
            with suppress(OSError):
                stream.close()


def connect_postgresql(_: object, __: object, ___: object, settings: dict[str, Any]) -> _Connection:
    """A connection of an engine; listens to its `do_connect`. Raises pg8000's errors.

    Args:
        _, __, ___: dialect, pool record and arguments of that event; not needed.
        settings: what the URL says: user, host, and port, database, password, sslmode where it has them.
    """
    address = settings["host"], settings.get("port", PORT)
    password = settings.get("password", "")  # without one, pg8000 fails on servers that ask for it
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
    """What a connection demands: None takes TLS where it is offered, a context refuses to go on without."""
    if mode == "prefer":
        return None
    context = ssl.create_default_context()
    if mode == "require":  # whoever answers
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


@contextmanager
def _network() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise pg8000.InterfaceError(f"network error: {error}") from error
