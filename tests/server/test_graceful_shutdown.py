"""SIGTERM: sessions are notified, no new work starts, and the server exits within a bound."""

from __future__ import annotations

import asyncio
import json
import signal
import threading
import time
import urllib.request
from collections.abc import Iterator
from typing import Any
from urllib.error import HTTPError

import pytest
import uvicorn
from running_server import Running, open_socket, running_server
from server_fakes import Control
from sse_starlette.sse import AppStatus
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from relume_server.lifecycle.drain import DrainState
from relume_server.lifecycle.server import ServerProcess
from relume_server.settings import Settings


@pytest.fixture(autouse=True)
def _others_events_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reset the flag that a signal sets for all event streams of this process."""
    monkeypatch.setattr(AppStatus, "should_exit", False)


@pytest.fixture
def running(settings: Settings, control: Control) -> Iterator[Running]:
    settings.drain_seconds = 60.0
    with running_server(settings, control) as running:
        yield running


def text(session: ClientConnection, kind: str) -> dict[str, Any]:
    while True:
        received = session.recv(timeout=30)
        if isinstance(received, str) and (message := json.loads(received))["type"] == kind:
            return message


def test_sessions_are_notified_and_the_server_exits_after_they_leave(running: Running) -> None:
    url = running.baked_url()
    with open_socket(url) as session:
        text(session, "hello")
        running.process.handle_exit(signal.SIGTERM, None)
        assert text(session, "server_draining") == {"type": "server_draining", "seconds": 60.0}
        with pytest.raises(HTTPError, match="503") as refused:
            urllib.request.urlopen(f"http://127.0.0.1:{running.port}/readyz")
        assert "is restarting" in json.load(refused.value)["detail"]
        with pytest.raises(InvalidStatus) as elsewhere, open_socket(url):
            pass
        answer = elsewhere.value.response
        assert (answer.status_code, json.loads(answer.body)["type"]) == (503, "urn:relume:problem:draining")
        edit = {"op": "replace", "path": "/materials/Paper/terms/1/params/sigma", "value": 0.3}
        session.send(json.dumps({"type": "edit", "revision": 1, "patch": [edit], "active_control": None}))
        while not isinstance(session.recv(timeout=30), bytes):  # frames continue meanwhile
            pass
        assert running.thread.is_alive()
    running.thread.join(timeout=30)
    assert not running.thread.is_alive()


def test_remaining_sessions_are_closed(settings: Settings, control: Control) -> None:
    settings.drain_seconds = 0.2
    with running_server(settings, control) as running, open_socket(running.baked_url()) as session:
        text(session, "hello")
        running.process.handle_exit(signal.SIGTERM, None)
        with pytest.raises(ConnectionClosed) as closed:
            text(session, "never")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code in (1001, 1012)
        running.thread.join(timeout=30)
        assert not running.thread.is_alive()


def test_second_signal_exits_immediately(running: Running) -> None:
    with open_socket(running.baked_url()) as session:
        text(session, "hello")
        running.process.handle_exit(signal.SIGTERM, None)
        running.process.handle_exit(signal.SIGTERM, None)
        running.thread.join(timeout=30)
        assert not running.thread.is_alive()


class Stubborn:
    """A process whose app stops when `may_stop` is set; `ended`: it was killed."""

    def __init__(self) -> None:
        self.ended, self.may_stop = threading.Event(), threading.Event()
        config = uvicorn.Config(self._app, port=0, interface="asgi3", lifespan="on", log_config=None)
        limits = {"drain_seconds": 5.0, "stop_seconds": 0.2}
        leave, end = DrainState(), lambda _: self.ended.set()
        self.process = ServerProcess(config, drain=leave, num_sessions=lambda: 0, end=end, **limits)
        self.thread = threading.Thread(target=self.process.run)

    def stop(self) -> None:
        self.thread.start()
        while not self.process.started:
            time.sleep(0.01)
        self.process.handle_exit(signal.SIGTERM, None)

    async def _app(self, scope: Any, receive: Any, send: Any) -> None:
        await receive()
        await send({"type": "lifespan.startup.complete"})
        await receive()
        while not self.may_stop.is_set():
            await asyncio.sleep(0.01)
        await send({"type": "lifespan.shutdown.complete"})


def test_app_that_does_not_stop_is_killed(caplog: pytest.LogCaptureFixture) -> None:
    stubborn = Stubborn()
    stubborn.stop()
    assert stubborn.ended.wait(30)
    assert "not stopped after 0.2 s" in caplog.text
    stubborn.may_stop.set()
    stubborn.thread.join()


def test_app_that_stops_in_time_is_not_killed() -> None:
    willing = Stubborn()
    willing.may_stop.set()
    willing.stop()
    willing.thread.join()
    assert not willing.ended.wait(0.4)


def test_readiness_is_notified_once() -> None:
    notifications: list[bool] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await receive()
        await asyncio.sleep(0.2)
        await send({"type": "lifespan.startup.complete"})
        await receive()
        await send({"type": "lifespan.shutdown.complete"})

    config = uvicorn.Config(app, port=0, interface="asgi3", lifespan="on", log_config=None)
    limits = {"drain_seconds": 5.0, "stop_seconds": 60.0}

    def notify() -> None:
        notifications.append(process.started)
        process.should_exit = True

    process = ServerProcess(config, drain=DrainState(), num_sessions=lambda: 0, on_started=notify, **limits)
    thread = threading.Thread(target=process.run)  # browser tests may run an event loop in this thread
    thread.start()
    thread.join(timeout=30)
    assert notifications == [True]
