"""Sessions that send too many messages: other sessions continue, and persistent senders are disconnected."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest
from fastapi.testclient import TestClient
from running_server import open_socket, running_server
from server_fakes import Control
from session_client import SIGMA, Baked, open_session
from starlette.websockets import WebSocketDisconnect, WebSocketState

from relume.core.errors import ProtocolError
from relume_server.client_state.socket import ClientSocket
from relume_server.schemas.connection import PongMessage
from relume_server.session import message_rate as pacing
from relume_server.session.message_rate import (
    CPU_FRACTION,
    MAX_BUSY_S,
    MESSAGE_BURST,
    MESSAGES_PER_SECOND,
    WORK_BURST_S,
    MessageRateLimit,
)
from relume_server.session.receive import MessageReceiver
from relume_server.settings import Settings


class Clock:
    """A clock that advances during sleep and work."""

    def __init__(self) -> None:
        self.now_s = self.worked_s = 0.0
        self.sleeps: list[float] = []

    def __call__(self) -> float:
        return self.now_s

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        self.sleeps.append(seconds)


def after(clock: Clock, num: int, work_s: float = 0.0, rest_s: float = 0.0, are_due: Sequence[bool] = (False,)) -> None:
    """Handle `num` messages of equal work, each `rest_s` after the previous one; return the clock."""
    rate_limit = MessageRateLimit(clock, lambda: clock.worked_s, clock.sleep)

    async def take() -> None:
        for k in range(num):
            clock.now_s += rest_s
            rate_limit.start_message()
            clock.now_s += work_s
            clock.worked_s += work_s
            await rate_limit.pause(is_due=are_due[k % len(are_due)])

    with pytest.raises(StopIteration):  # it only waits for the clock
        take().send(None)


def test_burst_is_handled_immediately_and_yields_after_each_message() -> None:
    clock = Clock()
    after(clock, MESSAGE_BURST)
    assert clock.sleeps == [0.0] * MESSAGE_BURST


def test_messages_beyond_the_burst_wait() -> None:
    clock = Clock()
    after(clock, MESSAGE_BURST + 1000)
    assert clock.now_s == pytest.approx(1000 / MESSAGES_PER_SECOND, rel=0.01)


def test_drags_at_frame_rate_never_wait() -> None:
    clock = Clock()
    after(clock, 20_000, rest_s=1 / 199)
    assert set(clock.sleeps) == {0.0}


def test_acknowledgements_are_not_counted_and_allow_an_edit() -> None:
    clock = Clock()
    after(clock, 20_000, are_due=(True, False))
    assert set(clock.sleeps) == {0.0}


def test_slow_messages_get_a_fraction_of_the_loop() -> None:
    clock = Clock()
    after(clock, 1000, work_s=0.01)
    assert clock.now_s == pytest.approx((1000 * 0.01 - WORK_BURST_S) / CPU_FRACTION, rel=0.01)


def test_drags_in_a_large_scene_never_wait() -> None:
    clock = Clock()
    after(clock, 20_000, work_s=0.002, rest_s=1 / 60)
    assert set(clock.sleeps) == {0.0}


def test_persistent_flood_is_disconnected() -> None:
    clock = Clock()
    with pytest.raises(ProtocolError, match="more than 200 a second for 10 s") as ended:
        after(clock, 1_000_000)
    assert ended.value.close_code == 1008
    assert MAX_BUSY_S <= clock.now_s < MAX_BUSY_S + 2


def test_rejected_messages_count(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("MESSAGES_PER_SECOND", 50.0), ("MESSAGE_BURST", 10), ("MAX_BUSY_S", 0.1)):
        monkeypatch.setattr(pacing, name, value)
    with open_session(client, baked.bake) as session:
        for _ in range(200):
            session.edit(1, SIGMA, 99.0)
        with pytest.raises(ConnectionError) as ended:
            session.text("never")
    assert ended.value.args[0] == 1008
    assert "too many messages" in ended.value.args[1]


def test_other_sessions_are_served_before_a_flood(
    settings: Settings, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The messages arrive while the server is busy."""
    taken: list[str] = []
    take, is_held = MessageReceiver._dispatch, False

    def take_late(self: MessageReceiver, message: Any, received_s: float) -> None:
        nonlocal is_held
        taken.append(message.type)
        if not is_held:
            is_held = True
            time.sleep(0.5)  # all messages of the test have arrived
        take(self, message, received_s)

    monkeypatch.setattr(MessageReceiver, "_dispatch", take_late)
    with running_server(settings, control) as running:
        url = running.baked_url()
        with open_socket(url) as flooding, open_socket(url) as other:
            for session in (flooding, other):
                assert json.loads(session.recv())["type"] == "hello"
            for _ in range(390):
                flooding.send('{"type":"encoding","format":"hdr"}')
            other.send('{"type":"focus","view":"front"}')
            while taken.count("encoding") < 390:
                time.sleep(0.01)
    assert "focus" in taken[:200]


# in a separate process: here it would compete with the server for processor time
FLOOD = """
import json, sys
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
with connect(sys.argv[1], subprotocols=["relume.v2"], max_size=None, proxy=None) as session:
    session.send(json.dumps({"type": "open"}))
    try:
        while True:
            session.send('{"type":"ack","frame":1}')
    except ConnectionClosed:
        print("closed")
"""


def test_flood_over_a_real_socket_is_disconnected(
    settings: Settings, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pacing, "MAX_BUSY_S", 0.3)
    with running_server(settings, control) as running:
        command = [sys.executable, "-c", FLOOD, running.baked_url()]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout == "closed\n"


def test_sending_after_a_disconnect_is_not_an_error() -> None:
    gone = SimpleNamespace(application_state=WebSocketState.DISCONNECTED)
    with pytest.raises(WebSocketDisconnect):
        ClientSocket(cast("Any", gone), 1.0).send(PongMessage()).send(None)
