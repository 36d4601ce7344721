"""A server with a known image, in a thread, and the client of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from running_server import Running, running_server
from server_fakes import Control
from server_fixtures import ack_seconds, control, empty_ledger, settings

from relume_client import Bake, Client
from relume_server.settings import Settings

__all__ = ["ack_seconds", "control", "empty_ledger", "settings"]


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.delenv("RELUME_TOKEN", raising=False)
    monkeypatch.setattr("relume_client.transport.backoff_s", lambda attempt: 0.02)
    monkeypatch.setattr("relume_client.session_socket.backoff_s", lambda attempt: 0.02)


@pytest.fixture
def running(settings: Settings, control: Control) -> Iterator[Running]:
    with running_server(settings, control) as running:
        yield running


@pytest.fixture
def client(running: Running) -> Iterator[Client]:
    with Client(f"http://127.0.0.1:{running.port}", retry_seconds=1.0) as client:
        yield client


@pytest.fixture
def bake(running: Running, client: Client) -> Bake:
    """A finished bake of the tiny scene."""
    return client.bake(running.bake())
