"""Limits on the data and time of a connection before authentication."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running_server import Running, running_server
from server_fakes import Control

from relume_server.lifecycle import connection
from relume_server.request_limits import MAX_JSON_BYTES, MAX_LOGIN_BYTES
from relume_server.settings import Settings

HEAD = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n"
BODY = (
    b"PUT /api/looks/Red HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n{"
)


@pytest.fixture
def running(settings: Settings, control: Control) -> Iterator[Running]:
    with running_server(settings, control) as running:
        yield running


def answer_to(running: Running, *sent: bytes, ends: bool = True) -> bytes:
    """All bytes until the server closes."""
    with socket.create_connection(("127.0.0.1", running.port), timeout=60) as asking:
        answer = b""
        try:
            for each in sent:
                asking.sendall(each)
            while chunk := asking.recv(1 << 16):
                answer += chunk
                if not ends and b"\r\n\r\n" in answer:
                    break
        except (ConnectionResetError, BrokenPipeError):  # closed while sending
            pass
        return answer


@pytest.mark.parametrize(
    "sent",
    [
        [HEAD, b"X: ", *[b"a" * 100_000] * 200],
        [HEAD, *[b"X: " + b"a" * 100 + b"\r\n"] * 200_000],
        [b"GET /", *[b"a" * 100_000] * 200],
    ],
)
def test_endless_header_is_cut_off(running: Running, sent: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    num_bytes = 0
    received = connection.Connection.data_received

    def counted(self: connection.Connection, data: bytes) -> None:
        nonlocal num_bytes
        num_bytes += len(data)
        received(self, data)

    monkeypatch.setattr(connection.Connection, "data_received", counted)
    answer = answer_to(running, *sent)
    assert answer[:12] in (b"", b"HTTP/1.1 431", b"HTTP/1.1 400")
    assert num_bytes <= 2 * connection.MAX_HEAD_BYTES + (1 << 18)  # plus one read


def test_header_with_too_many_lines_is_rejected(running: Running) -> None:
    lines = b"".join(b"X-%d: a\r\n" % number for number in range(connection.MAX_HEADERS))
    assert answer_to(running, HEAD + lines + b"\r\n").startswith(b"HTTP/1.1 400")
    fewer = b"".join(b"X-%d: a\r\n" % number for number in range(connection.MAX_HEADERS - 2))
    assert answer_to(running, HEAD + fewer + b"Connection: close\r\n\r\n").startswith(b"HTTP/1.1 200")


class TestTime:
    @pytest.fixture(autouse=True)
    def _impatient(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(connection, "HEAD_SECONDS", 0.2)
        monkeypatch.setattr(connection, "BODY_SECONDS", 0.2)

    @pytest.mark.parametrize("sent", [b"", b"G", HEAD, BODY])
    def test_incomplete_request_times_out(self, running: Running, sent: bytes) -> None:
        assert answer_to(running, sent).startswith(b"HTTP/1.1 408")

    def test_incomplete_second_request_times_out(self, running: Running) -> None:
        answer = answer_to(running, HEAD + b"\r\n" + HEAD)
        assert answer.startswith(b"HTTP/1.1 200")
        assert b"HTTP/1.1 408" in answer

    @pytest.fixture
    def late(self, monkeypatch: pytest.MonkeyPatch) -> threading.Event:
        """Set when a deadline passes."""
        late, looked = threading.Event(), connection.Connection._late

        def noted(self: connection.Connection) -> None:
            looked(self)
            late.set()

        monkeypatch.setattr(connection.Connection, "_late", noted)
        return late

    def test_slow_but_steady_body_is_accepted(
        self, running: Running, late: threading.Event, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(connection, "MIN_BODY_BYTES_PER_SECOND", 1)
        with socket.create_connection(("127.0.0.1", running.port), timeout=60) as asking:
            asking.sendall(BODY + b" " * 60)
            assert late.wait(60)
            asking.sendall(b" " * 38 + b"}")
            assert asking.recv(100).startswith(b"HTTP/1.1 201")

    def test_client_that_waits_for_a_response_is_not_cut_off(
        self, running: Running, late: threading.Event, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        library = running.app.state.services.looks
        monkeypatch.setattr(library, "list", lambda *_: (late.wait(60), [])[1])
        request = HEAD.replace(b"/livez", b"/api/looks") + b"\r\n"
        assert answer_to(running, request + b"G", ends=False).startswith(b"HTTP/1.1 200")


class TestUnreadResponses:
    NUM = 200

    @pytest.fixture(autouse=True)
    def _impatient(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(connection, "WRITE_SECONDS", 0.3)

    def requests(self) -> bytes:
        return (HEAD.replace(b"/livez", b"/api/openapi.json") + b"\r\n") * self.NUM

    def test_connection_whose_client_does_not_read_ends(
        self, running: Running, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        has_ended, lost = threading.Event(), connection.Connection.connection_lost

        def note(self: connection.Connection, exc: Exception | None) -> None:
            lost(self, exc)
            has_ended.set()

        monkeypatch.setattr(connection.Connection, "connection_lost", note)
        with socket.create_connection(("127.0.0.1", running.port), timeout=60) as asking:
            asking.sendall(self.requests())
            assert has_ended.wait(60)

    def test_slow_reader_gets_all_responses(self, running: Running) -> None:
        with socket.create_connection(("127.0.0.1", running.port), timeout=60) as asking:
            asking.sendall(self.requests()[:-2] + b"Connection: close\r\n\r\n")
            num_responses, end = 0, b""
            while chunk := asking.recv(1 << 18):
                num_responses += (end + chunk).count(b"HTTP/1.1 200 OK")
                end = chunk[-14:]
                time.sleep(0.001)
        assert num_responses == self.NUM

    @pytest.mark.parametrize(("num_sent", "is_aborted"), [(0, True), (100, True), (1 << 16, False)])
    def test_large_response_may_take_many_periods(self, num_sent: int, is_aborted: bool) -> None:
        aborted, limited = [], []
        transport = SimpleNamespace(get_write_buffer_size=lambda: (1 << 20) - num_sent, abort=lambda: aborted.append(1))
        writing: Any = SimpleNamespace(transport=transport, _limit_write=lambda: limited.append(1))
        connection.Connection._check_write(writing, 1 << 20)
        assert (bool(aborted), bool(limited)) == (is_aborted, not is_aborted)


def test_excess_connection_is_rejected_with_a_reason(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "MAX_CONNECTIONS", 1)
    with socket.create_connection(("127.0.0.1", running.port), timeout=60) as first:
        first.sendall(HEAD)
        with ThreadPoolExecutor(1) as others:
            assert others.submit(answer_to, running).result().startswith(b"HTTP/1.1 503")
        first.sendall(b"\r\n")
        assert first.recv(100).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize(
    ("path", "max_bytes"),
    [("/api/login", MAX_LOGIN_BYTES), ("/api/logout", MAX_LOGIN_BYTES), ("/api/bakes", MAX_JSON_BYTES)],
)
def test_body_limits_fit_their_routes(client: TestClient, path: str, max_bytes: int) -> None:
    text = {"content-type": "application/json"}
    beyond = b'{"token": "a", "x": "' + b"1" * max_bytes + b'"}'
    assert client.post(path, content=beyond, headers=text).status_code == 413
    if path != "/api/logout":  # it reads no body
        assert client.post(path, content=iter([beyond]), headers=text).status_code == 413
    within = b'{"token": "a", "x": "' + b"1" * (max_bytes - 100) + b'"}'
    assert client.post(path, content=within, headers=text).status_code != 413
