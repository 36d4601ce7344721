"""SIGTERM: sessions are told, nothing new begins, and the server is gone within a bound."""

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
    """What a signal sets for every stream of events in this process is unset again."""
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


def test_sessions_are_told_and_the_server_goes_when_they_have_left(running: Running) -> None:
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
        while not isinstance(session.recv(timeout=30), bytes):  # it goes on meanwhile
            pass
        assert running.thread.is_alive()
    running.thread.join(timeout=30)
    assert not running.thread.is_alive()


def test_who_does_not_leave_is_left(settings: Settings, control: Control) -> None:
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


def test_a_second_signal_waits_for_nobody(running: Running) -> None:
    with open_socket(running.baked_url()) as session:
        text(session, "hello")
        running.process.handle_exit(signal.SIGTERM, None)
        running.process.handle_exit(signal.SIGTERM, None)
        running.thread.join(timeout=30)
        assert not running.thread.is_alive()


class Stubborn:
    """A process whose app stops when `may_stop` says so; `ended`: it was ended by force."""

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


def test_what_does_not_stop_is_ended(caplog: pytest.LogCaptureFixture) -> None:
    stubborn = Stubborn()
    stubborn.stop()
    assert stubborn.ended.wait(30)
    assert "not stopped after 0.2 s" in caplog.text
    stubborn.may_stop.set()
    stubborn.thread.join()


def test_what_stops_in_time_is_left_alone() -> None:
    willing = Stubborn()
    willing.may_stop.set()
    willing.stop()
    willing.thread.join()
    assert not willing.ended.wait(0.4)


def test_it_is_told_once_that_the_server_answers() -> None:
    notifications: list[bool] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await receive()
        await asyncio.sleep(0.2)
        await send({"type": "lifespan.startup.complete"})
        await receive()
        await send({"type": "lifespan.shutdown.complete"})

    config = uvicorn.Config(app, port=0, interface="asgi3", lifespan="on", log_config=None)
    limits = {"drain_seconds": 5.0, "stop_seconds": 60.0}

    def tell() -> None:
        notifications.append(process.started)
        process.should_exit = True

    process = ServerProcess(config, drain=DrainState(), num_sessions=lambda: 0, on_started=tell, **limits)
    thread = threading.Thread(target=process.run)  # browser tests of the same process may have a loop in this one
    thread.start()
    thread.join(timeout=30)
    assert notifications == [True]
