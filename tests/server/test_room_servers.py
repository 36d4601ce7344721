"""Two servers on one ledger: a room is on one server; others redirect to it, and it moves with its members."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control, InThreadSteps
from server_fixtures import open_fake_bakes
from session_client import ROOM_FIELDS, SIGMA, Baked, Session, open_session
from sqlalchemy import select, update
from starlette.testclient import WebSocketDenialResponse

from relume_server.app import create_app
from relume_server.collaboration.join import derive_view_token
from relume_server.persistence.tables import RoomRow
from relume_server.settings import Settings

WATCH = {"view_token": derive_view_token(ROOM_FIELDS["room"])}
RESTART = 1012
LEASE_S = 600.0  # tests run the rounds themselves


@pytest.fixture(autouse=True)
def _no_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.collaboration.room_lease.RENEW_INTERVAL_S", LEASE_S)
    monkeypatch.setattr("relume_server.persistence.leases.ROOM_LEASE_S", LEASE_S)


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.reconnect_seconds, settings.drain_seconds = 0.05, 0.2
    return settings


@pytest.fixture
def other(settings: Settings, client: TestClient) -> Iterator[TestClient]:
    """A second server beside `client`."""
    app = create_app(
        settings, open_library=Control().open_library, open_steps=InThreadSteps, open_bakes=open_fake_bakes
    )
    with TestClient(app) as opened:
        yield opened


def services(server: TestClient) -> Any:
    return server.app.state.services  # type: ignore[attr-defined]


def look_around(server: TestClient) -> None:
    """Run one round of the room leases."""
    assert server.portal is not None
    server.portal.call(services(server).live.room_lease.refresh)


def refusal(server: TestClient, baked: Baked, opening: Mapping[str, str]) -> tuple[int, str]:
    with pytest.raises(WebSocketDenialResponse) as refused, open_session(server, baked.bake, opening=opening):
        pass
    return refused.value.status_code, refused.value.json()["type"].rpartition(":")[2]


def created(session: Session) -> bool:
    return bool(session.text("hello")["room"]["is_new"])


def expire(server: TestClient) -> None:
    """Let the room leases expire in the database."""
    with services(server).bakes.ledger.sessions.begin() as session:
        session.execute(update(RoomRow).values(heartbeat=RoomRow.heartbeat - 2 * LEASE_S))


def rooms(server: TestClient) -> list[str]:
    with services(server).bakes.ledger.sessions() as session:
        return list(session.scalars(select(RoomRow.prefix)))


def emptied(*servers: TestClient) -> None:
    """Wait until no server has a room."""
    until = time.monotonic() + 30
    while rooms(servers[0]) and time.monotonic() < until:
        time.sleep(0.01)
        for server in servers:
            look_around(server)
    assert rooms(servers[0]) == []


def test_room_is_on_one_server_until_it_is_empty(client: TestClient, other: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, opening=ROOM_FIELDS) as ann:
        assert created(ann)
        look_around(client)
        assert refusal(other, baked, ROOM_FIELDS) == refusal(other, baked, WATCH) == (404, "other-server")
        apart = {"room": "apart" * 5}
        with open_session(other, baked.bake, opening=apart) as cleo, open_session(other, baked.bake) as dan:
            assert created(cleo)
            assert dan.text("hello")["room"] is None
        with open_session(client, baked.bake, opening=WATCH) as bob:
            assert not created(bob)
    emptied(client, other)
    with open_session(other, baked.bake, opening=ROOM_FIELDS) as bob:
        assert created(bob)
        assert rooms(client) == [ROOM_FIELDS["room"][:8]]


def test_members_follow_a_room_that_another_server_took(client: TestClient, other: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, opening=ROOM_FIELDS) as ann:
        assert created(ann)
        expire(client)
        with open_session(other, baked.bake, opening=ROOM_FIELDS) as bob:
            assert created(bob)
            bob.edit(1, SIGMA, 0.31)
            bob.exact(1)
            for server in (other, client):
                look_around(server)
            assert ann.text("server_draining")["seconds"] == 0.2
            assert refusal(client, baked, ROOM_FIELDS) == (404, "other-server")
            with open_session(other, baked.bake, opening=ROOM_FIELDS) as again:
                hello = again.text("hello")
                assert not hello["room"]["is_new"]
                assert hello["look"]["materials"]["Paper"]["terms"][1]["params"]["sigma"] == 0.31
            with pytest.raises(ConnectionError) as ended:  # remaining members are disconnected
                ann.text("never")
            assert ended.value.args[0] == RESTART


def test_draining_server_releases_its_rooms_immediately(client: TestClient, other: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, opening=ROOM_FIELDS) as ann:
        ann.text("hello")
        assert client.portal is not None
        client.portal.call(services(client).drain.start)
        ann.text("server_draining")
        assert refusal(client, baked, ROOM_FIELDS) == (503, "draining")
        emptied(other)
        with open_session(other, baked.bake, opening=ROOM_FIELDS) as again:
            assert created(again)


def test_session_opens_at_the_address_of_its_room(client: TestClient, baked: Baked) -> None:
    for query in ("", "?room_prefix=elsewher", "?room_prefix=together-on"):
        path = f"/api/bakes/{baked.bake}/session{query}"
        with client.websocket_connect(path, ["relume.v2"]) as websocket:
            session = Session(websocket, acknowledges=False)
            session.send_message(type="open", **ROOM_FIELDS)
            with pytest.raises(ConnectionError) as ended:
                session.receive()
        assert ended.value.args[0] == 1008
        assert "together, the first characters of the room's id" in ended.value.args[1]


def test_invalid_room_name_is_rejected(client: TestClient, baked: Baked) -> None:
    none = {"room": "!" * 24}
    with open_session(client, baked.bake, opening=none) as session, pytest.raises(ConnectionError) as ended:
        session.receive()
    assert ended.value.args[0] == 1008
