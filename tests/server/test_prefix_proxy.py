"""The API and sessions behind nginx, below /relume/."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from prefix_proxy import proxy_below_prefix
from running_server import Running, open_socket, running_server
from server_fakes import Control
from websockets.sync.client import ClientConnection

from relume_server import app as server_app
from relume_server.settings import Settings

IDLE_S = 60.0
"""Time after which proxies cut idle connections; nginx's default."""


def test_pings_come_well_before_proxies_cut_idle_sockets() -> None:
    assert 3 * server_app.PING_INTERVAL_S < IDLE_S


def receive_until_idle(session: ClientConnection, seconds: float) -> None:
    """Receive frames until none has come for so long. Raises ConnectionClosed."""
    with suppress(TimeoutError):
        while True:
            session.recv(timeout=seconds)


@pytest.mark.parametrize("is_stripped", [True, False])
class TestBehindNginx:
    @pytest.fixture
    def running(
        self, settings: Settings, control: Control, monkeypatch: pytest.MonkeyPatch, is_stripped: bool
    ) -> Iterator[Running]:
        monkeypatch.setattr(server_app, "PING_INTERVAL_S", 0.2)
        settings.root_path = "" if is_stripped else "/relume"
        settings.client.mkdir(parents=True)
        (settings.client / "index.html").write_text("<title>editor</title>")
        with running_server(settings, control) as running:
            yield running

    def test_page_api_and_idle_sessions(self, running: Running, tmp_path: Path, is_stripped: bool) -> None:
        session_path = running.baked_url().partition(str(running.port))[2].removeprefix("/")
        with proxy_below_prefix(tmp_path, running.port, is_stripped=is_stripped, timeout_s=1) as url:
            for address in (url, f"{url}scenes/0123", url.removesuffix("/")):
                with urllib.request.urlopen(address) as page:
                    assert (page.read(), page.url) == (b"<title>editor</title>", url)
            with urllib.request.urlopen(f"{url}api/looks") as looks:
                assert json.load(looks) == []
            with open_socket(url.replace("http", "ws") + session_path) as session:
                assert json.loads(session.recv())["type"] == "hello"
                receive_until_idle(session, 1.6)  # longer than nginx lets an idle socket live
                session.send(json.dumps({"type": "ping"}))
                assert json.loads(session.recv(timeout=10))["type"] == "pong"
