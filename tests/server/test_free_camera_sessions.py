"""A view whose eye moves: baked, looked at from elsewhere while it is edited, rendered, and eyes that cannot be."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import trimesh
from fastapi.testclient import TestClient
from session_client import Frame, Session, open_session
from test_end_to_end import decode_rgb9e5, rendered_by, wait_until_done

from relume_server.app import create_app
from relume_server.client_state.flow_control import FrameWindow
from relume_server.settings import Settings

SIZE = (64, 48)
LEVEL = np.eye(4)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("relume_server.client_state.flow_control.SLOW_S", math.inf)  # a busy machine is no slow link
        settings = Settings(data=tmp_path_factory.mktemp("moving"), allowed_hosts=["testserver"])
        with TestClient(create_app(settings)) as client:
            yield client


@pytest.fixture(scope="module")
def scene(client: TestClient) -> dict[str, Any]:
    ball = trimesh.creation.icosphere(subdivisions=3)
    file = trimesh.Scene(ball).export(file_type="glb")
    imported: dict[str, Any] = client.post("/api/scenes", files={"scene": ("ball.glb", file)}).json()
    return imported


@pytest.fixture(scope="module")
def bake(client: TestClient, scene: dict[str, Any]) -> str:
    request = {"scene": scene["id"], "method": "probes", "size": SIZE, "lights": 100, "probes": 2000}
    done = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    assert done["state"] == "ready", done["problem"]
    assert done["recipe"]["probes"] == 2000
    return str(done["id"])


@pytest.mark.parametrize("method", ["gather", "probes"])
def test_gather_samples_and_rays_may_be_asked_for(client: TestClient, scene: dict[str, Any], method: str) -> None:
    request = {"scene": scene["id"], "method": method, "size": SIZE, "lights": 100, "dry_run": True}
    request |= {"probes": 500} if method == "probes" else {}
    usual, asked = (
        client.post("/api/bakes", json=request | more).json() for more in ({}, {"patches": 4000, "gather_rays": 1000})
    )
    assert (usual["recipe"]["patches"], usual["recipe"]["gather_rays"]) == (None, None)
    assert (asked["recipe"]["patches"], asked["recipe"]["gather_rays"]) == (4000, 1000)
    for count in ("rays", "store_bytes", "peak_bytes"):
        assert asked["plan"][count] > usual["plan"][count]
    for bad in (
        {"patches": 10**6},
        {"gather_rays": 5000},
        {"gather_rays": 0},
        {"method": "direct", "gather_rays": 9},
    ):
        refused = client.post("/api/bakes", json=request | bad)
        assert refused.status_code == 422, refused.text


@pytest.mark.parametrize("method", ["direct", "gather"])
def test_points_are_refused_where_no_eye_moves(client: TestClient, scene: dict[str, Any], method: str) -> None:
    request = {"scene": scene["id"], "method": method, "size": SIZE, "lights": 100, "dry_run": True}
    recipe = client.post("/api/bakes", json=request).json()["recipe"]
    assert recipe["probes"] is None
    assert client.post("/api/bakes", json=request | {"probes": recipe["probes"]}).json()["recipe"] == recipe
    refused = client.post("/api/bakes", json=request | {"probes": 777})
    assert (refused.status_code, refused.json()["type"]) == (422, "urn:relume:problem:plan")
    assert f"method {method} has no probes; leave out the 777 probes" in refused.json()["detail"]


@pytest.fixture
def session(client: TestClient, bake: str) -> Iterator[Session]:
    with open_session(client, bake) as session:
        yield session


def hello(session: Session) -> dict[str, Any]:
    message = session.receive()
    assert isinstance(message, dict)
    return message


def eye(view: dict[str, Any], number: int, aside: float, size: tuple[int, int] = SIZE) -> dict[str, Any]:
    """An eye that stands aside of where a view begins."""
    to_world = np.array(view["camera"]["to_world"]).reshape(4, 4)
    to_world[:3, 3] += aside * to_world[:3, 0]
    where = {"to_world": to_world.ravel().tolist(), "yfov": view["camera"]["yfov"]}
    return {"type": "camera", "view": view["name"], "seq": number, **where, "size": size}


def shown(frame: Frame) -> np.ndarray:
    return decode_rgb9e5(frame.payload).reshape(frame.header["height"], frame.header["width"], 3)


def of_eye(session: Session, number: int) -> Frame:
    while (frame := session.frame()).header["camera_seq"] != number:
        pass
    return frame


def test_hello_says_that_the_eye_is_free_and_where_there_is_something(session: Session) -> None:
    first_view = hello(session)
    (view,) = first_view["views"]
    assert (view["camera_mode"], first_view["method"], "camera" in first_view["axes"]) == ("free", "probes", True)
    lowest, highest = np.array(view["bounds"])
    np.testing.assert_allclose([lowest, highest], [[-1] * 3, [1] * 3], atol=0.05)
    assert 0 < first_view["free_camera_error"]["standard_error"] < first_view["free_camera_error"]["value"] < 0.5


def test_frames_follow_the_eye_twice_and_say_which_they_show(session: Session) -> None:
    (view,) = hello(session)["views"]
    first = session.frame()
    assert (first.header["camera_seq"], first.header["exact"]) == (None, False)
    while first.header["fidelity"] == "preview":  # light on the points is made beside the frames
        first = session.frame()
    assert first.header["fidelity"] == "approximate"
    pictures = [shown(first)]
    for number, aside in ((5, 0.4), (6, -0.3)):
        session.send_message(**eye(view, number, aside))
        pictures.append(shown(of_eye(session, number)))
    assert all(picture.max() > 0.01 for picture in pictures)
    for k in range(3):
        assert np.abs(pictures[k] - pictures[k - 1]).max() > 0.01
    session.send_message(**eye(view, 7, 0.0))
    np.testing.assert_array_equal(shown(of_eye(session, 7)), pictures[0])


def exact_of(session: Session, number: int, revision: int) -> Frame:
    while (frame := session.exact(revision)).header["camera_seq"] != number:
        pass
    return frame


def test_where_the_eye_rests_the_exact_picture_follows_and_edits_go_on_in_it_twice(
    session: Session, client: TestClient, scene: dict[str, Any], tmp_path: Any
) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    for number, aside in ((5, 0.4), (6, -0.3)):
        placed = eye(view, number, aside)
        session.send_message(**placed)
        moving = of_eye(session, number)
        assert not moving.header["exact"]
        exact_of(session, number, number - 5)
        terms = [{"model": "lambert", "color": [0.1, 0.5, 0.1 * number]}]
        session.edit(number - 4, f"/materials/{material}/terms", terms)
        edited = exact_of(session, number, number - 4)
        camera = {"name": "placed", "to_world": placed["to_world"], "yfov": math.degrees(placed["yfov"])}
        request = {"scene": scene["id"], "views": [camera], "size": SIZE, "lights": 100}
        fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
        look = {"materials": {material: {"terms": terms}}}
        rendered = rendered_by(client, {"bake": fixed["id"], "view": "placed", "looks": [look]}, tmp_path)
        # nothing lights a ball but the sky: no gather cells that may differ
        assert np.abs(shown(edited) - rendered).max() <= rendered.max() / 256 + 1e-4


def test_an_older_eye_says_nothing_and_the_size_is_the_eyes(session: Session) -> None:
    (view,) = hello(session)["views"]
    session.send_message(**eye(view, 9, 0.2, (40, 30)))
    frame = of_eye(session, 9)
    assert (frame.header["width"], frame.header["height"], frame.header["tiles"]) == (40, 30, [[0, 0, 40, 30]])
    session.send_message(**eye(view, 8, 0.5))
    session.send_message(**eye(view, 10, 0.2, (40, 30)))
    np.testing.assert_array_equal(shown(of_eye(session, 10)), shown(frame))


def test_an_edit_a_light_and_an_eye_in_one_burst_are_all_shown(session: Session, client: TestClient, bake: str) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    session.frame()
    terms = [{"model": "lambert", "color": [0.1, 0.5, 0.2]}]
    session.edit(1, f"/materials/{material}/terms", terms)
    session.edit(2, "/environment/intensity", 2.0)
    session.send_message(**eye(view, 3, 0.3))
    frame = of_eye(session, 3)
    while frame.header["revision"] < 2:
        frame = session.frame()
    burst = shown(frame)
    with open_session(client, bake) as other:
        hello(other)
        other.send_message(**eye(view, 1, 0.3))
        other.edit(1, f"/materials/{material}/terms", terms)
        other.edit(2, "/environment/intensity", 2.0)
        frame = other.frame()
        while (frame.header["revision"], frame.header["camera_seq"]) != (2, 1):
            frame = other.frame()
        np.testing.assert_array_equal(shown(frame), burst)


def test_a_render_is_what_the_eye_sees_where_it_begins(
    client: TestClient, bake: str, session: Session, tmp_path: Any
) -> None:
    (view,) = hello(session)["views"]
    picture = shown(session.exact(0))
    rendered = rendered_by(client, {"bake": bake, "view": view["name"], "looks": [{}]}, tmp_path)
    assert np.abs(picture - rendered).max() <= rendered.max() / 256 + 1e-4


@pytest.mark.parametrize(
    "bad",
    [
        {"view": "nowhere"},
        {"size": [0, 48]},
        {"size": [60000, 60000]},
        {"yfov": 0.0},
        {"yfov": math.pi},
        {"to_world": [1e30] * 16},
        {"to_world": [0.0] * 16},
        {"to_world": [-1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
        {"to_world": [1.0, 0, 0, 0] * 3},
        {"seq": -1},
        {"refine": "go"},
        {"active_control": "nonsense"},
    ],
    ids=str,
)
def test_bad_eyes_are_refused_in_words_and_nothing_is_lost(session: Session, bad: dict[str, Any]) -> None:
    (view,) = hello(session)["views"]
    before = shown(session.exact(0))
    session.send_message(**(eye(view, 1, 0.2) | bad))
    problem = session.text("problem")
    assert len(problem["problem"]["detail"]) > 10
    session.send_message(**eye(view, 2, 0.0))
    np.testing.assert_array_equal(shown(exact_of(session, 2, 0)), before)


def test_an_eye_inside_a_solid_and_one_that_sees_nothing_are_seen_through(session: Session) -> None:
    (view,) = hello(session)["views"]
    session.frame()
    for number, position in ((1, [0, 0, 0]), (2, [0, 0, 1e5])):
        to_world = LEVEL.copy()
        to_world[:3, 3] = position
        session.send_message(**(eye(view, number, 0.0) | {"to_world": to_world.ravel().tolist()}))
        assert np.isfinite(shown(of_eye(session, number))).all()


def test_fixed_views_have_no_eye_that_moves_and_moving_ones_no_mask(
    client: TestClient, scene: dict[str, Any], bake: str
) -> None:
    request = {"scene": scene["id"], "size": SIZE, "lights": 50}
    fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    with open_session(client, fixed["id"]) as session:
        (view,) = hello(session)["views"]
        assert (view["camera_mode"], view["bounds"]) == ("fixed", None)
        session.send_message(**eye(view, 1, 0.2))
        assert "probes" in session.text("problem")["problem"]["detail"]
    answer = client.get(f"/api/bakes/{bake}/views/{view['name']}/materials.png")
    assert answer.status_code == 404
    assert "read its pixels in a session" in answer.json()["detail"]


def test_a_scene_deleted_under_a_moving_view_leaves_what_moves(client: TestClient) -> None:
    file = trimesh.Scene(trimesh.creation.icosphere(subdivisions=2)).export(file_type="glb")
    scene = client.post("/api/scenes", files={"scene": ("gone.glb", file)}).json()["id"]
    request = {"scene": scene, "method": "probes", "size": SIZE, "lights": 50, "probes": 500}
    made = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    with open_session(client, made["id"]) as session:
        (view,) = hello(session)["views"]
        before = shown(session.exact(0))
        assert client.delete(f"/api/scenes/{scene}").status_code == 204
        for number, aside in ((1, 0.3), (2, 0.5)):
            session.send_message(**eye(view, number, aside))
            picture = shown(of_eye(session, number))
            assert np.abs(picture - before).max() > 0.01
            session.wait_until_ready("the exact image of this camera")  # given up: what it needs is gone
            problem = session.text("problem")["problem"]
            assert problem["type"].endswith("generation-failed")
            assert "is not available" in problem["detail"]
        session.send_message(type="inspect", view=view["name"], x=SIZE[0] // 2, y=SIZE[1] // 2)
        assert session.text("inspect")["material"] is not None


def test_a_probe_says_what_the_eye_sees(session: Session) -> None:
    first_view = hello(session)
    (view,) = first_view["views"]
    session.send_message(**eye(view, 4, 0.0))
    of_eye(session, 4)
    session.send_message(type="inspect", view=view["name"], x=SIZE[0] // 2, y=SIZE[1] // 2)
    answer = session.text("inspect")
    assert answer["material"] == first_view["materials"][0]
    assert np.linalg.norm(answer["position"]) == pytest.approx(1.0, abs=0.02)
    session.send_message(
        type="highlight_curve_range",
        curve=f"/materials/{answer['material']}/terms/0/curves/theta_h",
        **{"from": 0, "to": 9},
    )
    assert session.text("problem")["problem"]["detail"]


def arrays_in(frame: Frame) -> dict[str, np.ndarray]:
    """The arrays of a frame of kind "scene_update"."""
    arrays, offset = {}, 0
    for info in frame.header["scene_update"]["arrays"]:
        dtype, size = np.dtype(info["dtype"]), math.prod(info["shape"])
        arrays[info["name"]] = np.frombuffer(frame.payload, dtype, size, offset).reshape(info["shape"])
        offset += size * dtype.itemsize
    assert offset == len(frame.payload)
    return arrays


def tables_of(session: Session) -> Frame:
    while (frame := session.frame()).header["kind"] != "scene_update":
        pass
    return frame


def until_fine(session: Session, revision: int) -> None:
    """Take frames up to the tables with all light of a look."""
    while (frame := tables_of(session)).header["fidelity"] == "preview" or frame.header["revision"] != revision:
        pass


def test_a_browser_that_draws_itself_gets_what_has_changed_and_no_frame_for_an_eye(session: Session) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    session.frame()
    session.send_message(**eye(view, 1, 0.2), refine="none")
    of_eye(session, 1)
    session.send_message(type="renderer", renderer="client")
    tables = tables_of(session)
    first = arrays_in(tables)
    if tables.header["fidelity"] == "preview":
        until_fine(session, 0)
    assert {"isotropic", "materials", "vectors/0", "environment"} <= set(first)
    session.send_message(**eye(view, 2, 0.4), refine="none")
    assert arrays_in(tables_of(session)) == {}
    session.edit(1, f"/materials/{material}/terms/0/color", [0.1, 0.2, 0.9])
    recoloured = tables_of(session)
    assert recoloured.header["revision"] == 1
    assert not np.array_equal(arrays_in(recoloured)["isotropic"], first["isotropic"])


def test_what_a_shader_keeps_is_there_once_for_all(client: TestClient, bake: str) -> None:
    answer = client.get(f"/api/bakes/{bake}/probes")
    assert "immutable" in answer.headers["cache-control"]
    description = answer.json()
    assert description["num_basis"] == len(description["recurrence"]["order"]) + sum(
        m > 0 for m in description["recurrence"]["order"]
    )
    arrays = {name: client.get(f"/api/bakes/{bake}/probes/{name}") for name in description["arrays"]}
    assert all("immutable" in each.headers["cache-control"] for each in arrays.values())
    num_points = len(arrays["probe_positions"].content) // 16
    assert len(arrays["visible_lights"].content) == num_points * 16  # bits of at most 128 lights
    corners = np.frombuffer(arrays["corners"].content, np.uint32).reshape(-1, 4)
    assert corners[:, :3].max() < len(arrays["positions"].content) // 16
    sides = np.frombuffer(arrays["sides"].content, np.uint32).reshape(-1, 4)
    assert (len(sides), sides[:, :3].max() < len(arrays["normals"].content) // 8) == (2 * len(corners), True)
    first = description["first_probes"]
    assert (first[0], first[-1], first == sorted(first)) == (0, num_points, True)


def test_there_are_no_other_arrays_and_none_of_fixed_views(
    client: TestClient, bake: str, scene: dict[str, Any]
) -> None:
    missing = client.get(f"/api/bakes/{bake}/probes/lights")
    assert (missing.status_code, "choose from corners" in missing.json()["detail"]) == (404, True)
    request = {"scene": scene["id"], "size": SIZE, "lights": 100}
    fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    for path in ("probes", "probes/corners"):
        refused = client.get(f"/api/bakes/{fixed['id']}/{path}")
        assert (refused.status_code, "fixed cameras" in refused.json()["detail"]) == (404, True)


def test_a_browser_may_leave_the_drawing_to_the_server_again_twice(session: Session) -> None:
    (view,) = hello(session)["views"]
    session.send_message(**eye(view, 1, 0.2), refine="none")
    while (first := of_eye(session, 1)).header["fidelity"] == "preview":
        pass
    for _ in range(2):
        session.send_message(type="renderer", renderer="client")
        assert "vectors/0" in arrays_in(tables_of(session))
        session.send_message(type="renderer", renderer="server")
        while (frame := session.frame()).header["kind"] != "picture":
            pass
        np.testing.assert_array_equal(shown(frame), shown(first))
    session.send_message(type="renderer", renderer="nobody")
    assert "/renderer is 'nobody'" in str(session.text("problem"))


def test_where_the_link_is_too_slow_for_tables_a_hand_gets_pictures_twice(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And tables when it rests; what is small comes as tables all the while, and an eye costs nothing."""
    monkeypatch.setattr(FrameWindow, "is_slow_for", lambda self, num_bytes, *, was_slow: num_bytes > 100_000)
    first_view = hello(session)
    (view,), color = first_view["views"], f"/materials/{first_view['materials'][0]}/terms/0/color"
    session.send_message(**eye(view, 1, 0.05), refine="none")
    of_eye(session, 1)
    session.edit(1, "/transport/show", "direct")  # colours would bring other light to all points
    session.send_message(type="renderer", renderer="client")
    until_fine(session, 1)
    turn, kinds = "/environment/rotation", []
    edits = [(color, [0.1, 0.2, 0.9]), (turn, 20.0), (turn, 50.0), (color, [0.9, 0.8, 0.1])]
    for revision, (path, value) in enumerate(edits, start=2):
        session.edit(revision, path, value, control=path)
        while (first := session.frame()).header["revision"] != revision:
            pass
        kinds.append(first.header["kind"])
        if kinds[-1] == "picture" or first.header["fidelity"] == "preview":
            until_fine(session, revision)
        session.send_message(**eye(view, revision, 0.1 * revision), refine="none")
        assert arrays_in(tables_of(session)) == {}
    assert kinds == ["picture", "picture", "picture", "scene_update"]  # how small those of colours are it learns once


def test_tables_follow_a_picture_that_nothing_refines(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FrameWindow, "is_slow_for", lambda self, num_bytes, *, was_slow: num_bytes > 100_000)
    session.edit(1, "/transport/show", "direct")
    session.send_message(type="renderer", renderer="client")
    until_fine(session, 1)
    for revision in (2, 3):
        session.edit(revision, "/environment/intensity", 0.5 / revision)
        while (first := session.frame()).header["revision"] != revision:
            pass
        assert first.header["kind"] == "picture"
        assert arrays_in(tables_of(session)) == {}  # what multiplies all light is one number
