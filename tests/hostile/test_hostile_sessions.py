"""Malicious or invalid session messages are rejected clearly, and the session continues."""

import json
import math
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from server_fakes import Control
from server_fixtures import impatient
from session_client import SIGMA, THETA_H, Baked, Session, open_session, session_path
from starlette.testclient import WebSocketDenialResponse
from starlette.websockets import WebSocketDisconnect

from relume_server.schemas.protocol import MAX_MESSAGE_BYTES
from relume_server.session.receive import MAX_BAD_MESSAGES

IDS = "0123456789abcdef"


def is_alive(session: Session, revision: int) -> bool:
    """Return True if the session still takes an edit and shows it."""
    session.edit(revision, SIGMA, 0.25)
    return session.exact(revision).header["revision"] == revision


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no json",
        "[]",
        "null",
        '{"type": "edit"',
        '{"type": "explode"}',
        '{"revision": 1, "patch": []}',
        '{"type": "ack", "frame": -1}',
        '{"type": "ack", "frame": 1e400}',
        '{"type": "ack", "frame": "1x"}',
        '{"type": "ack", "frame": 1, "more": 1}',
        '{"type": "edit", "revision": 1, "patch": []}',
        '{"type": "edit", "revision": 1, "patch": [{"op": "move", "from": "/a", "path": "/b"}]}',
        '{"type": "highlight_curve_range", "curve": "/x", "from": NaN, "to": 3}',
        '{"type": "encoding", "format": "gif"}',
        "[" * 60_000,
        '{"type": "edit", "revision": 1, "patch": ' + "[" * 30_000 + "]" * 30_000 + "}",
    ],
)
def test_malformed_message_is_a_problem_and_the_session_continues(client: TestClient, baked: Baked, text: str) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.websocket.send_text(text)
        problem = session.text("problem")["problem"]
        assert problem["status"] == 400
        assert is_alive(session, 1)


def test_binary_message_is_a_problem(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.websocket.send_bytes(b"\x00\x01")
        assert session.text("problem")["problem"]["type"] == "urn:relume:problem:protocol"
        assert is_alive(session, 1)


def test_too_many_malformed_messages_end_the_session(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        for _ in range(MAX_BAD_MESSAGES + 1):
            session.websocket.send_text("no json")
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 1008


@pytest.mark.parametrize("text", ["x" * (MAX_MESSAGE_BYTES + 1), "é" * (MAX_MESSAGE_BYTES // 2 + 1)])
def test_message_beyond_the_limit_closes_1009(client: TestClient, baked: Baked, text: str) -> None:
    with open_session(client, baked.bake) as session:
        session.websocket.send_text(text)
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 1009


def test_message_at_the_limit_is_read(client: TestClient, baked: Baked) -> None:
    message = json.dumps({"type": "edit", "revision": 1, "patch": [{"op": "replace", "path": SIGMA, "value": 0.5}]})
    with open_session(client, baked.bake) as session:
        session.websocket.send_text(message + " " * (MAX_MESSAGE_BYTES - len(message)))
        session.exact(1)


@pytest.mark.parametrize("revision", [0, 4, 5])
def test_old_revision_is_refused(client: TestClient, baked: Baked, revision: int) -> None:
    with open_session(client, baked.bake) as session:
        session.edit(5, SIGMA, 0.4)
        session.exact(5)
        session.edit(revision, SIGMA, 0.1)
        problem = session.text("problem")
        assert problem["revision"] == revision
        assert "is not newer than" in problem["problem"]["detail"]
        assert is_alive(session, 6)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("/materials/Nothing/terms/0/color", [1, 1, 1]),
        ("/materials/Paper/terms/1/model", "unobtainium"),
        ("/materials/Paper/terms/1/params/shininess", 1.0),
        (SIGMA, 1e9),
        (SIGMA, "0.3"),
        (SIGMA, None),
        (SIGMA, math.nan),
        ("/materials/Paper/terms/0/color", [1, 1, math.inf]),
        ("/materials/Paper/terms/1/curves", {"theta_h": {"points": [[0, math.nan], [90, 0]]}}),
        ("/materials/Paper/terms/1/curves", {"theta_h": {"points": [[9, 1], [3, 0]]}}),
        ("/materials/Paper/terms/1/curves", {"theta_x": {"points": [[0, 1], [90, 0]]}}),
        ("/materials/Paper/terms/1/curves", {"theta_h": {"points": [[k / 100, 1] for k in range(4097)]}}),
        ("/materials/Paper/terms/99/color", [1, 1, 1]),
        ("/environment/intensity", -1),
        ("/environment/color", [1, 1]),
        ("/__class__/__init__", 1),
        ("no pointer", 1),
        ("", {"materials": {"Nothing": {}}}),
    ],
)
def test_invalid_edit_is_a_problem_and_the_look_stays(client: TestClient, baked: Baked, path: str, value: Any) -> None:
    with open_session(client, baked.bake) as session:
        session.edit(1, SIGMA, 0.4)
        session.exact(1)
        session.edit(2, path, value)
        problem = session.text("problem")
        assert problem["revision"] == 2
        assert problem["problem"]["status"] in (400, 422)
        assert len(json.dumps(problem)) < 4000
        session.edit(3, SIGMA, 0.4, op="test")
        session.exact(3)


def test_curve_of_a_hundred_thousand_points_is_too_big_a_message(client: TestClient, baked: Baked) -> None:
    points = [[90 * k / 1e5, 1.0] for k in range(100_000)]  # 3 MB; messages have at most 64 kB
    with open_session(client, baked.bake) as session:
        session.edit(1, "/materials/Paper/terms/1/curves", {"theta_h": {"points": points}})
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 1009


@pytest.mark.parametrize(
    "message",
    [
        {"type": "view", "name": "../../etc"},
        {"type": "inspect", "x": 160, "y": 0},
        {"type": "inspect", "view": "left", "x": 0, "y": 0},
        {"type": "prepare", "curve": "/materials/Paper/terms/1/curves/theta_x"},
        {"type": "prepare", "curve": "/materials/../terms/1/curves/theta_h"},
        {"type": "prepare", "curve": "/materials/Paper/terms/999/curves/theta_h"},
        {"type": "highlight_curve_range", "curve": "/materials/Paper/terms/0/curves/theta_h", "from": 0, "to": 9},
        {"type": "ack", "frame": 999},
    ],
)
def test_impossible_request_is_a_problem(client: TestClient, baked: Baked, message: dict[str, Any]) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(**message)
        assert session.text("problem")["problem"]["status"] in (400, 422)
        assert is_alive(session, 1)


@impatient
def test_flood_of_edits_and_brushes_keeps_one_of_each(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        session.frame()
        for revision in range(1, 500):
            session.edit(revision, SIGMA, 0.2 + revision / 1000)
            session.send_message(type="highlight_curve_range", curve=THETA_H, **{"from": 0.0, "to": 9.0})
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 4408
    assert control.num_looks < 10


@pytest.mark.parametrize("subprotocols", [[], ["relume.v1"], ["RELUME.V2"]])
def test_other_subprotocol_closes_1002(client: TestClient, baked: Baked, subprotocols: list[str]) -> None:
    with open_session(client, baked.bake, subprotocols=subprotocols) as session:
        with pytest.raises(ConnectionError) as closed:
            session.receive()
        assert closed.value.args[0] == 1002


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": "http://testserver.evil.example"},
        {"origin": "http://testserver:9999"},
        {"origin": "http://[broken"},
        {"host": "evil.example", "origin": "http://evil.example"},
    ],
)
def test_page_of_another_site_gets_no_session_and_changes_nothing(
    client: TestClient, baked: Baked, headers: dict[str, str]
) -> None:
    with (
        pytest.raises((WebSocketDenialResponse, WebSocketDisconnect)),
        open_session(client, baked.bake, headers=headers),
    ):
        pass
    assert parse_problem(client.delete(f"/api/scenes/{baked.scene}", headers=headers))["status"] == 403
    assert client.get(f"/api/scenes/{baked.scene}").status_code == 200


def test_own_page_gets_a_session(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, headers={"origin": "http://testserver"}) as session:
        assert session.text("hello")["bake"] == baked.bake


@pytest.mark.parametrize("bake", [IDS, "x", "0" * 5000])
def test_session_on_no_bake_closes_4404(client: TestClient, bake: str) -> None:
    with open_session(client, bake) as session, pytest.raises(ConnectionError) as closed:
        session.receive()
    assert closed.value.args[0] == 4404


def test_session_on_an_unknown_path_is_refused(client: TestClient) -> None:
    with pytest.raises((WebSocketDenialResponse, WebSocketDisconnect)), open_session(client, "..%2f..%2fetc"):
        pass


def test_session_on_a_damaged_store_reports_it(client: TestClient, baked: Baked) -> None:
    store = client.app.state.services.bakes.store_path(baked.bake)  # type: ignore[attr-defined]
    (store / "zarr.json").write_bytes(b"{")
    with open_session(client, baked.bake) as session, pytest.raises(ConnectionError) as closed:
        session.receive()
    assert closed.value.args[0] == 4410


@pytest.mark.parametrize(
    "text",
    [
        "no json",
        '{"type": "open", "room": 1}',
        '{"type": "open", "resume": ""}',
        '{"type": "open", "participant_token": "' + "a" * 65 + '"}',
        '{"type": "open", "token": "x"}',
        '{"type": "ack", "frame": 1}',
    ],
)
def test_a_session_that_does_not_begin_with_open_is_closed(client: TestClient, baked: Baked, text: str) -> None:
    with client.websocket_connect(session_path(baked.bake, {}), ["relume.v2"]) as websocket:
        websocket.send_text(text)
        with pytest.raises(ConnectionError) as closed:
            Session(websocket, acknowledges=False).receive()
    assert closed.value.args[0] == 1008


def test_a_silent_client_is_closed(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.session.reader.OPEN_SECONDS", 0.05)
    opened = client.websocket_connect(session_path(baked.bake, {}), ["relume.v2"])
    with opened as websocket, pytest.raises(ConnectionError) as closed:
        Session(websocket, acknowledges=False).receive()
    assert closed.value.args == (1008, "no message arrived within 0.05 s; send open first")


def test_a_session_is_opened_once(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.send_message(type="open")
        assert "send open once" in session.text("problem")["problem"]["detail"]
        assert is_alive(session, 1)


@pytest.mark.parametrize("token", ["x", "../..", "a" * 64])
def test_unknown_resume_token_is_a_new_session(client: TestClient, baked: Baked, token: str) -> None:
    with open_session(client, baked.bake, opening={"resume": token}) as session:
        assert not session.text("hello")["resumed"]


def test_a_null_character_in_the_address_of_a_session_is_refused(client: TestClient, baked: Baked) -> None:
    path = f"/api/bakes/{baked.bake}/session?room_prefix=%00"
    with pytest.raises(WebSocketDenialResponse) as rejected, client.websocket_connect(path, ["relume.v2"]):
        pass
    assert rejected.value.status_code == 422
    assert "null character" in rejected.value.json()["detail"]
