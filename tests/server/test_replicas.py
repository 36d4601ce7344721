"""docker/replicas/nginx.conf in use: all members of a room, and all sessions of a bake, reach one server."""

from __future__ import annotations

import secrets
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from urllib.error import HTTPError

import pytest
from replicas_proxy import proxy_to_ports, proxy_to_shared_name
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection, serve

from relume_server.collaboration.join import derive_view_token
from relume_server.schemas.rooms import MIN_ROOM, ROOM_PREFIX

NUM_SERVERS = 3


@pytest.fixture(scope="module")
def proxy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Port of nginx in front of servers that answer with their number and the request headers."""
    folder = tmp_path_factory.mktemp("nginx")
    with ExitStack() as stack:
        ports = [stack.enter_context(_server(number)) for number in range(NUM_SERVERS)]
        yield stack.enter_context(proxy_to_ports(folder, ports))


class _server:  # noqa: N801  (a context)
    """A fake server: answers with its number over HTTP and WebSocket, or rejects with a status."""

    def __init__(self, number: int, address: str = "127.0.0.1", port: int = 0, refusal: int | None = None) -> None:
        self._number, self._at, self._refusal = str(number), (address, port), refusal

    def __enter__(self) -> int:
        def answer(connection: ServerConnection, request: object) -> object:
            headers = request.headers  # type: ignore[attr-defined]
            if self._refusal is not None:
                return connection.respond(self._refusal, self._number)
            if "Upgrade" in headers:
                return None
            answer_text = " ".join((self._number, headers["Host"], headers["X-Request-ID"], headers["X-Forwarded-For"]))
            return connection.respond(200, answer_text)

        self._server = serve(lambda each: each.send(self._number), *self._at, process_request=answer)  # type: ignore[arg-type]
        Thread(target=self._server.serve_forever, daemon=True).start()
        return int(self._server.socket.getsockname()[1])

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()


def session(port: int, bake: str, query: str) -> str:
    with connect(f"ws://127.0.0.1:{port}/api/bakes/{bake}/session{query}", proxy=None) as opened:
        return str(opened.recv())


def test_members_of_a_room_reach_one_server_for_any_bake(proxy: int) -> None:
    rooms = [secrets.token_hex(16) for _ in range(12)]
    servers = {}
    for k, room in enumerate(rooms):
        queries = [f"?room_prefix={name[:ROOM_PREFIX]}" for name in (room, derive_view_token(room))]
        answering = {session(proxy, f"{k:015d}{j}", query) for j, query in enumerate(queries)}
        assert len(answering) == 1, room
        servers[room] = answering.pop()
    assert len(set(servers.values())) > 1


def test_members_of_a_room_reach_one_server_behind_a_shared_name(tmp_path: Path) -> None:
    addresses = [f"127.0.0.{2 + number}" for number in range(NUM_SERVERS)]
    with ExitStack() as stack:
        port = stack.enter_context(_server(0, addresses[0]))
        for number, address in enumerate(addresses[1:], start=1):
            stack.enter_context(_server(number, address, port))
        named = stack.enter_context(proxy_to_shared_name(tmp_path, addresses, port))
        rooms = [secrets.token_hex(16) for _ in range(12)]
        queries = [f"?room_prefix={room[:ROOM_PREFIX]}" for room in rooms]
        answering = [{session(named, f"{k:016x}", query) for _ in range(3)} for k, query in enumerate(queries)]
    assert all(len(servers) == 1 for servers in answering)
    assert len(set.union(*answering)) > 1


def test_sessions_of_a_bake_reach_one_server(proxy: int) -> None:
    bakes = [f"{k:016x}" for k in range(12)]
    server_of_bake = {}
    for bake in bakes:
        first, again = (session(proxy, bake, query) for query in ("", "?other=abc"))
        answer = _get(f"http://127.0.0.1:{proxy}/api/bakes/{bake}/probes/points")
        assert first == again == answer.split()[0]
        server_of_bake[bake] = first
    assert len(set(server_of_bake.values())) > 1


def test_sessions_rejected_by_a_draining_server_reach_another_immediately(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ports = [stack.enter_context(_server(number, refusal=503 if number else None)) for number in range(NUM_SERVERS)]
        port = stack.enter_context(proxy_to_ports(tmp_path, ports))
        assert {session(port, "b", f"?room_prefix={secrets.token_hex(4)}") for _ in range(12)} == {"0"}


def test_room_is_found_on_its_server_and_others_stay_available(tmp_path: Path) -> None:
    """The other servers answer 404 to everything; calls without a session still reach them."""
    with ExitStack() as stack:
        ports = [stack.enter_context(_server(number, refusal=404 if number else None)) for number in range(NUM_SERVERS)]
        port = stack.enter_context(proxy_to_ports(tmp_path, ports))
        assert {session(port, "b", f"?room_prefix={secrets.token_hex(4)}") for _ in range(12)} == {"0"}
        assert _answers(port) == {"0", "404"}


def test_rejected_calls_are_not_repeated_elsewhere(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ports = [stack.enter_context(_server(number, refusal=503 if number else None)) for number in range(NUM_SERVERS)]
        port = stack.enter_context(proxy_to_ports(tmp_path, ports))
        assert _answers(port) == {"0", "503"}


def test_other_calls_reach_any_server_with_the_client_address(proxy: int) -> None:
    answers = [_get(f"http://127.0.0.1:{proxy}/api/scenes").split() for _ in range(12)]
    assert len({number for number, *_ in answers}) > 1
    assert len({request for _, _, request, _ in answers}) == 12
    assert {(host, address) for _, host, _, address in answers} == {(f"127.0.0.1:{proxy}", "127.0.0.1")}


def _answers(port: int) -> set[str]:
    """The server numbers or rejection statuses of many calls that go to any server."""
    answers = set()
    for _ in range(40):
        try:
            answers.add(_get(f"http://127.0.0.1:{port}/api/scenes").split()[0])
        except HTTPError as refused:
            answers.add(str(refused.code))
    return answers


def _get(url: str) -> str:
    with urllib.request.urlopen(url, timeout=10) as answer:
        return str(answer.read().decode())


def test_viewer_link_reveals_only_the_server_of_its_room() -> None:
    room = "a" * MIN_ROOM
    assert derive_view_token(room)[:ROOM_PREFIX] == room[:ROOM_PREFIX]
    assert derive_view_token(room)[ROOM_PREFIX] != "a"
    assert len(derive_view_token(room)) == 32
    assert derive_view_token(room)[ROOM_PREFIX:] not in derive_view_token(room + "a")
