"""What clients send that mean harm or know no better: a clear refusal each time, and nothing lost."""

import json
import math
from typing import Any

import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import SIGMA, THETA_H, Baked, Session, open_session
from starlette.testclient import WebSocketDenialResponse
from starlette.websockets import WebSocketDisconnect

from server.live.reception import MAX_BAD_MESSAGES
from server.protocol import MAX_MESSAGE_BYTES

IDS = "0123456789abcdef"


def is_alive(session: Session, revision: int) -> bool:
    """Whether the session still takes an edit and shows it."""
    session.edit(revision, SIGMA, 0.25)
    return session.exact(revision).header["revision"] == revision


def problem_of(response: Any) -> dict[str, Any]:
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["status"] == response.status_code
    assert problem["detail"]
    assert "Traceback" not in response.text
    return problem


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
        '{"type": "brush", "curve": "/x", "from": NaN, "to": 3}',
        '{"type": "stream", "format": "gif"}',
        "[" * 60_000,
        '{"type": "edit", "revision": 1, "patch": ' + "[" * 30_000 + "]" * 30_000 + "}",
    ],
)
def test_malformed_message_is_a_problem_and_the_session_goes_on(client: TestClient, baked: Baked, text: str) -> None:
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
        assert "old revision" in problem["problem"]["detail"]
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
        ("/environment/scale", -1),
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


def test_curve_of_a_million_points_is_too_big_a_message(client: TestClient, baked: Baked) -> None:
    points = [[90 * k / 1e6, 1.0] for k in range(1_000_000)]
    with open_session(client, baked.bake) as session:
        session.edit(1, "/materials/Paper/terms/1/curves", {"theta_h": {"points": points}})
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 1009


@pytest.mark.parametrize(
    "message",
    [
        {"type": "view", "name": "../../etc"},
        {"type": "probe", "x": 160, "y": 0},
        {"type": "probe", "view": "left", "x": 0, "y": 0},
        {"type": "touch", "curve": "/materials/Paper/terms/1/curves/theta_x"},
        {"type": "touch", "curve": "/materials/../terms/1/curves/theta_h"},
        {"type": "touch", "curve": "/materials/Paper/terms/999/curves/theta_h"},
        {"type": "brush", "curve": "/materials/Paper/terms/0/curves/theta_h", "from": 0, "to": 9},
        {"type": "ack", "frame": 999},
    ],
)
def test_impossible_wish_is_a_problem(client: TestClient, baked: Baked, message: dict[str, Any]) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send(**message)
        assert session.text("problem")["problem"]["status"] in (400, 422)
        assert is_alive(session, 1)


def test_flood_of_edits_and_brushes_keeps_one_of_each(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        session.frame()
        for revision in range(1, 500):
            session.edit(revision, SIGMA, 0.2 + revision / 1000)
            session.send(type="brush", curve=THETA_H, **{"from": 0.0, "to": 9.0})
        with pytest.raises(ConnectionError) as closed:
            session.text("never")
    assert closed.value.args[0] == 4408
    assert control.num_looks < 10


@pytest.mark.parametrize("subprotocols", [[], ["relume.v2"], ["RELUME.V1"]])
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
    assert problem_of(client.delete(f"/api/scenes/{baked.scene}", headers=headers))["status"] == 403
    assert client.get(f"/api/scenes/{baked.scene}").status_code == 200


def test_own_page_gets_a_session(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, headers={"origin": "http://testserver"}) as session:
        assert session.text("hello")["bake"] == baked.bake


@pytest.mark.parametrize("bake", [IDS, "x", "0" * 5000])
def test_session_on_no_bake_closes_4404(client: TestClient, bake: str) -> None:
    with open_session(client, bake) as session, pytest.raises(ConnectionError) as closed:
        session.receive()
    assert closed.value.args[0] == 4404


def test_session_on_a_path_that_is_none_is_refused(client: TestClient) -> None:
    with pytest.raises((WebSocketDenialResponse, WebSocketDisconnect)), open_session(client, "..%2f..%2fetc"):
        pass


def test_session_on_damaged_store_says_so(client: TestClient, baked: Baked) -> None:
    store = client.app.state.services.bakes.store_path(baked.bake)  # type: ignore[attr-defined]
    (store / "zarr.json").write_bytes(b"{")
    with open_session(client, baked.bake) as session, pytest.raises(ConnectionError) as closed:
        session.receive()
    assert closed.value.args[0] == 4410


@pytest.mark.parametrize("token", ["", "x", "../..", "%00", "a" * 3000])
def test_unknown_resume_token_is_a_new_session(client: TestClient, baked: Baked, token: str) -> None:
    with open_session(client, baked.bake, query=f"?resume={token}") as session:
        assert not session.text("hello")["resumed"]


@pytest.mark.parametrize(
    "data",
    [b"", b"glTF", b"glTF\x02\x00\x00\x00\xff\xff\xff\x7f", b"\x00" * 1000, b"glTF\x02\x00\x00\x00\x0c\x00\x00\x00"],
)
def test_file_that_is_no_scene_is_refused(client: TestClient, data: bytes) -> None:
    response = client.post("/api/scenes", files={"scene": ("../../x.glb", data)})
    assert problem_of(response)["type"] == "urn:relume:problem:scene"
    assert client.get("/api/scenes").json() == []


def test_import_that_takes_too_much_is_stopped(client: TestClient, settings: Any) -> None:
    settings.import_bytes = 64 * 1024**2  # less than an interpreter with NumPy needs
    response = client.post("/api/scenes", files={"scene": ("x.glb", b"glTF")})
    assert problem_of(response)["status"] == 422
    assert list(settings.data.glob("upload-*")) == []


def test_upload_beyond_the_limit_is_413(client: TestClient) -> None:
    response = client.post("/api/scenes", files={"scene": ("x.glb", b"\x00" * (4 * 1024**2 + 1))})
    assert problem_of(response)["status"] == 413


def test_upload_of_unknown_length_is_cut_at_the_limit(client: TestClient) -> None:
    num_chunks = 0

    def chunks() -> Any:
        nonlocal num_chunks
        yield b'--b\r\nContent-Disposition: form-data; name="scene"; filename="x.glb"\r\n\r\n'
        for num_chunks in range(8):  # noqa: B007
            yield b"\x00" * 1024**2

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    response = client.post("/api/scenes", content=chunks(), headers=headers)
    assert problem_of(response)["status"] == 413


def test_body_of_another_call_beyond_the_limit_is_413(client: TestClient) -> None:
    assert problem_of(client.post("/api/bakes", content=b" " * (2 * 1024**2 + 1)))["status"] == 413
    headers = {"Content-Length": "9" * 5000}
    assert problem_of(client.post("/api/bakes", content=b"{}", headers=headers))["status"] == 413


@pytest.mark.parametrize(
    "name", ["%00", "a%0Ab", "%20a", "..", "%2e%2e%2fetc%2fpasswd", "..%5c..", "x" * 81, "%E2%80%AE", "%7F"]
)
def test_look_name_that_is_none_is_refused(client: TestClient, name: str) -> None:
    response = client.put(f"/api/looks/{name}", json={})
    assert problem_of(response)["status"] in (404, 405, 422)
    assert client.get("/api/looks").json() == []


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"[]",
        b"7",
        b'{"materials": NaN}',
        b'{"materials": []}',
        b'{"surprise": {}}',
        b'{"display": {"exposure": 1e999}}',
        b"\xff\xfe",
        b'{"materials":' + b"[" * 100_000,
    ],
)
def test_look_that_is_none_is_refused(client: TestClient, body: bytes) -> None:
    assert problem_of(client.put("/api/looks/a", content=body))["status"] == 422


def test_look_beyond_its_size_is_413(client: TestClient) -> None:
    body = json.dumps({"materials": {"a": {"x": "y" * 262_144}}})
    assert problem_of(client.put("/api/looks/a", content=body))["status"] == 413


@pytest.mark.parametrize(
    "change",
    [
        {"bake": IDS},
        {"view": "nowhere"},
        {"looks": []},
        {"looks": [{}] * 1001},
        {"looks": [{"materials": {"Nothing": {}}}]},
        {"looks": [{"environment": {"scale": -1}}]},
        {"format": "exe"},
        {"size": [0, 1]},
        {"size": [161, 96]},
        {"size": [16384, 16384]},
        {"size": [10**12, 1]},
        {"surprise": 1},
    ],
)
def test_render_that_cannot_be_is_refused(client: TestClient, baked: Baked, change: dict[str, Any]) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"} | change
    assert problem_of(client.post("/api/renders", json=request))["status"] in (404, 422)


@pytest.mark.parametrize(
    "change",
    [
        {"scene": IDS},
        {"scene": "../../etc/passwd"},
        {"method": "magic"},
        {"views": ["nowhere"]},
        {"views": []},
        {"size": [-1, 5]},
        {"size": [99999, 99999]},
        {"lights": 0},
        {"lights": 10**9},
        {"preset": "ultra"},
    ],
)
def test_bake_that_cannot_be_is_refused(client: TestClient, baked: Baked, change: dict[str, Any]) -> None:
    response = client.post("/api/bakes", json={"scene": baked.scene, "size": [8, 8], "lights": 9} | change)
    assert problem_of(response)["status"] in (404, 422)


@pytest.mark.parametrize(
    "path",
    [
        "/../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fsecret.txt",
        "/..%2fsecret.txt",
        "/%00.js",
        "//etc/passwd.txt",
        "/a\\..\\..\\secret.txt",
    ],
)
def test_no_path_leaves_the_editors_folder(client: TestClient, settings: Any, path: str) -> None:
    settings.client.mkdir()
    (settings.client / "index.html").write_text("page")
    (settings.client.parent / "secret.txt").write_text("secret")
    response = client.get(path)
    assert response.status_code in (200, 404)
    assert "secret" not in response.text
    assert "root:" not in response.text


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/nothing", 404),
        ("POST", "/api/nothing", 404),
        ("PATCH", "/api/bakes", 405),
        ("POST", "/", 405),
        ("GET", f"/api/bakes/{IDS}", 404),
        ("GET", "/api/bakes/short", 422),
        ("GET", f"/api/renders/{IDS}/frames/-1", 422),
        ("GET", f"/api/renders/{IDS}/frames/99999999999999999999", 422),
        ("GET", f"/api/scenes/{IDS}/thumbnail.webp", 404),
    ],
)
def test_every_refusal_is_a_problem(client: TestClient, method: str, path: str, status: int) -> None:
    assert problem_of(client.request(method, path))["status"] == status


def test_missing_data_directory_is_a_problem_not_a_trace(client: TestClient, settings: Any) -> None:
    settings.data = settings.data / "gone"
    problem = problem_of(client.get("/readyz"))
    assert problem["status"] == 507
    assert str(settings.data) not in json.dumps(problem)
