"""Sessions with a free camera: bakes, camera messages, edits, renders and invalid cameras."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
import trimesh
from fastapi.testclient import TestClient
from server_fakes import InThreadSteps
from session_client import Frame, Session, open_session
from test_end_to_end import assert_same, decode_rgb9e5, rendered_by, wait_until_done

from relume_server.app import create_app
from relume_server.client_state.flow_control import FrameWindow
from relume_server.settings import Settings

SIZE = (64, 48)
LEVEL = np.eye(4)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("relume_server.client_state.flow_control.SLOW_S", math.inf)  # a busy machine is not a slow link
        settings = Settings(data=tmp_path_factory.mktemp("moving"), allowed_hosts=["testserver"])
        with TestClient(create_app(settings, open_steps=InThreadSteps)) as client:
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
def test_patches_and_gather_rays_may_be_requested(client: TestClient, scene: dict[str, Any], method: str) -> None:
    size = [4 * side for side in SIZE]  # the disk space of small bakes is an upper bound
    request = {"scene": scene["id"], "method": method, "size": size, "lights": 100, "dry_run": True}
    request |= {"probes": 500} if method == "probes" else {}
    usual, asked = (
        client.post("/api/bakes", json=request | more).json() for more in ({}, {"patches": 9000, "gather_rays": 1000})
    )
    assert (usual["recipe"]["patches"], usual["recipe"]["gather_rays"]) == (None, None)
    assert (asked["recipe"]["patches"], asked["recipe"]["gather_rays"]) == (9000, 1000)
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
def test_probes_are_rejected_for_fixed_cameras(client: TestClient, scene: dict[str, Any], method: str) -> None:
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


def camera_message(view: dict[str, Any], number: int, aside: float, size: tuple[int, int] = SIZE) -> dict[str, Any]:
    """A camera message, moved sideways from the view's first camera."""
    to_world = np.array(view["camera"]["to_world"]).reshape(4, 4)
    to_world[:3, 3] += aside * to_world[:3, 0]
    where = {"to_world": to_world.ravel().tolist(), "yfov": view["camera"]["yfov"]}
    return {"type": "camera", "view": view["name"], "seq": number, **where, "size": size}


def shown(frame: Frame) -> np.ndarray:
    return decode_rgb9e5(frame.payload).reshape(frame.header["height"], frame.header["width"], 3)


def frame_of_camera(session: Session, number: int) -> Frame:
    while (frame := session.frame()).header["camera_seq"] != number:
        pass
    return frame


def moving_frame(session: Session, message: dict[str, Any], revision: int = 0) -> Frame:
    """The frame of a moving camera when light at its probes is complete; no static view changes it."""
    session.send_message(**message, refine="none")
    frame = frame_of_camera(session, message["seq"])
    while frame.header["fidelity"] == "preview" or frame.header["revision"] < revision:
        frame = session.frame()
    assert (frame.header["camera_seq"], frame.header["fidelity"]) == (message["seq"], "approximate")
    return frame


def test_hello_describes_the_free_camera_and_the_scene_bounds(session: Session) -> None:
    first_view = hello(session)
    (view,) = first_view["views"]
    assert (view["camera_mode"], first_view["method"], "camera" in first_view["axes"]) == ("free", "probes", True)
    lowest, highest = np.array(view["bounds"])
    np.testing.assert_allclose([lowest, highest], [[-1] * 3, [1] * 3], atol=0.05)
    error = first_view["free_camera_error"]
    assert 0 < error["rms_standard_error"] < error["rms"] < 0.5
    assert 0 < error["delta_e_standard_error"] < error["delta_e"] < 20


def test_frames_follow_the_camera_and_name_its_sequence_number(session: Session) -> None:
    (view,) = hello(session)["views"]
    first = session.frame()
    assert (first.header["camera_seq"], first.header["exact"]) == (None, False)
    places = ((4, 0.2), (5, 0.4), (6, -0.3), (7, 0.2))
    pictures = [shown(moving_frame(session, camera_message(view, number, aside))) for number, aside in places]
    assert all(picture.max() > 0.01 for picture in pictures)
    for k in range(1, 4):
        assert np.abs(pictures[k] - pictures[k - 1]).max() > 0.01
    np.testing.assert_array_equal(pictures[3], pictures[0])


def exact_of(session: Session, number: int, revision: int) -> Frame:
    while (frame := session.exact(revision)).header["camera_seq"] != number:
        pass
    return frame


def test_static_view_follows_when_the_camera_stops_and_edits_continue_in_it(
    session: Session, client: TestClient, scene: dict[str, Any], tmp_path: Any
) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    for number, aside in ((5, 0.4), (6, -0.3)):
        placed = camera_message(view, number, aside)
        session.send_message(**placed)
        moving = frame_of_camera(session, number)
        assert not moving.header["exact"]
        exact_of(session, number, number - 5)
        terms = [{"model": "lambert", "color": [0.1, 0.5, 0.1 * number]}]
        session.edit(number - 4, f"/materials/{material}/terms", terms)
        edited = exact_of(session, number, number - 4)
        camera = {"name": "placed", "to_world": placed["to_world"], "yfov": math.degrees(placed["yfov"])}
        request = {"scene": scene["id"], "method": "direct", "views": [camera], "size": SIZE, "lights": 100}
        fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
        look = {"materials": {material: {"terms": terms}}}
        rendered = rendered_by(client, {"bake": fixed["id"], "view": "placed", "looks": [look]}, tmp_path)
        # only the environment lights the ball: no patches that may differ
        assert np.abs(shown(edited) - rendered).max() <= rendered.max() / 256 + 1e-4


def test_outdated_camera_is_ignored_and_frames_have_the_camera_size(session: Session) -> None:
    (view,) = hello(session)["views"]
    frame = moving_frame(session, camera_message(view, 9, 0.2, (40, 30)))
    assert (frame.header["width"], frame.header["height"], frame.header["tiles"]) == (40, 30, [[0, 0, 40, 30]])
    session.send_message(**camera_message(view, 8, 0.5))
    after = moving_frame(session, camera_message(view, 10, 0.2, (40, 30)))
    np.testing.assert_array_equal(shown(after), shown(frame))


def test_burst_of_edit_light_and_camera_is_shown_completely(session: Session, client: TestClient, bake: str) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    session.frame()
    terms = [{"model": "lambert", "color": [0.1, 0.5, 0.2]}]
    session.edit(1, f"/materials/{material}/terms", terms)
    session.edit(2, "/environment/intensity", 2.0)
    burst = shown(moving_frame(session, camera_message(view, 3, 0.3), revision=2))
    with open_session(client, bake) as other:
        hello(other)
        other.send_message(**camera_message(view, 1, 0.3), refine="none")
        other.edit(1, f"/materials/{material}/terms", terms)
        other.edit(2, "/environment/intensity", 2.0)
        after = moving_frame(other, camera_message(view, 2, 0.3), revision=2)
        np.testing.assert_array_equal(shown(after), burst)


def test_render_equals_the_first_frame(client: TestClient, bake: str, session: Session, tmp_path: Any) -> None:
    (view,) = hello(session)["views"]
    picture = shown(session.exact(0))
    rendered = rendered_by(client, {"bake": bake, "view": view["name"], "looks": [{}]}, tmp_path)
    assert np.abs(picture - rendered).max() <= rendered.max() / 256 + 1e-4


def test_sets_are_rendered_each_with_its_pose_of_the_free_camera(
    client: TestClient, bake: str, session: Session, tmp_path: Path
) -> None:
    (view,) = hello(session)["views"]
    poses = {"Near": camera_message(view, 0, 0.3), "Aside": camera_message(view, 0, 1.2)}
    for name, message in poses.items():
        etag = client.put(f"/api/looks/{name}", json={}, headers={"If-None-Match": "*"}).json()["etag"]
        camera = {"to_world": message["to_world"], "yfov": math.degrees(message["yfov"])}
        request = {"view": view["name"], "camera": camera}
        answer = client.put(f"/api/looks/{name}/view", json=request, headers={"If-Match": etag})
        assert answer.status_code == 204, answer.text
    request = {"bake": bake, "view": view["name"], "looks": [], "saved_looks": [*poses], "saved_views": True}
    url = client.post("/api/renders", json={**request, "format": "exr"}).headers["location"]
    assert wait_until_done(client, url)["state"] == "ready"
    for index, message in enumerate(poses.values()):
        file = tmp_path / f"{index}.exr"
        file.write_bytes(client.get(f"{url}/frames/{index}").content)
        session.send_message(**{**message, "seq": index + 1})
        picture = shown(exact_of(session, index + 1, 0))
        assert_same(picture, OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.FLOAT))


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
def test_invalid_cameras_are_rejected_and_the_session_continues(session: Session, bad: dict[str, Any]) -> None:
    (view,) = hello(session)["views"]
    before = shown(session.exact(0))
    session.send_message(**(camera_message(view, 1, 0.2) | bad))
    problem = session.text("problem")
    assert len(problem["problem"]["detail"]) > 10
    session.send_message(**camera_message(view, 2, 0.0))
    np.testing.assert_array_equal(shown(exact_of(session, 2, 0)), before)


def test_cameras_inside_a_solid_or_far_away_are_accepted(session: Session) -> None:
    (view,) = hello(session)["views"]
    session.frame()
    for number, position in ((1, [0, 0, 0]), (2, [0, 0, 1e5])):
        to_world = LEVEL.copy()
        to_world[:3, 3] = position
        session.send_message(**(camera_message(view, number, 0.0) | {"to_world": to_world.ravel().tolist()}))
        assert np.isfinite(shown(frame_of_camera(session, number))).all()


def test_fixed_views_reject_cameras_and_free_cameras_have_no_mask(
    client: TestClient, scene: dict[str, Any], bake: str
) -> None:
    request = {"scene": scene["id"], "method": "direct", "size": SIZE, "lights": 50}
    fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    with open_session(client, fixed["id"]) as session:
        (view,) = hello(session)["views"]
        assert (view["camera_mode"], view["bounds"]) == ("fixed", None)
        session.send_message(**camera_message(view, 1, 0.2))
        assert "probes" in session.text("problem")["problem"]["detail"]
    answer = client.get(f"/api/bakes/{bake}/views/{view['name']}/materials.png")
    assert answer.status_code == 404
    assert "read its pixels in a session" in answer.json()["detail"]


def test_deleted_scene_leaves_the_free_camera_picture(client: TestClient) -> None:
    file = trimesh.Scene(trimesh.creation.icosphere(subdivisions=2)).export(file_type="glb")
    scene = client.post("/api/scenes", files={"scene": ("gone.glb", file)}).json()["id"]
    request = {"scene": scene, "method": "probes", "size": SIZE, "lights": 50, "probes": 500}
    made = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    with open_session(client, made["id"]) as session:
        (view,) = hello(session)["views"]
        before = shown(session.exact(0))
        assert client.delete(f"/api/scenes/{scene}").status_code == 204
        for number, aside in ((1, 0.3), (2, 0.5)):
            session.send_message(**camera_message(view, number, aside))
            picture = shown(frame_of_camera(session, number))
            assert np.abs(picture - before).max() > 0.01
            session.wait_until_ready("the exact image of this camera")  # abandoned: its scene is missing
            problem = session.text("problem")["problem"]
            assert problem["type"].endswith("generation-failed")
            assert "is not available" in problem["detail"]
        session.send_message(type="inspect", view=view["name"], x=SIZE[0] // 2, y=SIZE[1] // 2)
        assert session.text("inspect")["material"] is not None


def test_pixel_probe_uses_the_current_camera(session: Session) -> None:
    first_view = hello(session)
    (view,) = first_view["views"]
    session.send_message(**camera_message(view, 4, 0.0))
    frame_of_camera(session, 4)
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
    """Arrays of a "scene_update" frame."""
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
    """Read frames up to the tables with complete light of a look."""
    while (frame := tables_of(session)).header["fidelity"] == "preview" or frame.header["revision"] != revision:
        pass


def test_client_renderer_gets_changed_arrays_and_no_frames_for_cameras(session: Session) -> None:
    first_view = hello(session)
    (view,), material = first_view["views"], first_view["materials"][0]
    session.frame()
    session.send_message(**camera_message(view, 1, 0.2), refine="none")
    frame_of_camera(session, 1)
    session.send_message(type="renderer", renderer="client")
    tables = tables_of(session)
    first = arrays_in(tables)
    if tables.header["fidelity"] == "preview":
        until_fine(session, 0)
    assert {"isotropic", "materials", "vectors/0", "environment"} <= set(first)
    session.send_message(**camera_message(view, 2, 0.4), refine="none")
    assert arrays_in(tables_of(session)) == {}
    session.edit(1, f"/materials/{material}/terms/0/color", [0.1, 0.2, 0.9])
    recoloured = tables_of(session)
    assert recoloured.header["revision"] == 1
    assert not np.array_equal(arrays_in(recoloured)["isotropic"], first["isotropic"])


def test_static_shader_arrays_are_downloaded_once(client: TestClient, bake: str) -> None:
    answer = client.get(f"/api/bakes/{bake}/probes")
    assert "immutable" in answer.headers["cache-control"]
    description = answer.json()
    assert description["num_basis"] == len(description["recurrence"]["order"]) + sum(
        m > 0 for m in description["recurrence"]["order"]
    )
    arrays = {name: client.get(f"/api/bakes/{bake}/probes/{name}") for name in description["arrays"]}
    assert all("immutable" in each.headers["cache-control"] for each in arrays.values())
    num_points = len(arrays["probe_positions"].content) // 16
    assert len(arrays["visible_lights"].content) == num_points * 16  # bit masks of at most 128 lights
    corners = np.frombuffer(arrays["corners"].content, np.uint32).reshape(-1, 4)
    assert corners[:, :3].max() < len(arrays["positions"].content) // 16
    sides = np.frombuffer(arrays["sides"].content, np.uint32).reshape(-1, 4)
    assert (len(sides), sides[:, :3].max() < len(arrays["normals"].content) // 8) == (2 * len(corners), True)
    first = description["first_probes"]
    assert (first[0], first[-1], first == sorted(first)) == (0, num_points, True)


def test_unknown_arrays_and_arrays_of_fixed_views_are_not_found(
    client: TestClient, bake: str, scene: dict[str, Any]
) -> None:
    missing = client.get(f"/api/bakes/{bake}/probes/lights")
    assert (missing.status_code, "choose from corners" in missing.json()["detail"]) == (404, True)
    request = {"scene": scene["id"], "method": "direct", "size": SIZE, "lights": 100}
    fixed = wait_until_done(client, client.post("/api/bakes", json=request).headers["location"])
    for path in ("probes", "probes/corners"):
        refused = client.get(f"/api/bakes/{fixed['id']}/{path}")
        assert (refused.status_code, "fixed cameras" in refused.json()["detail"]) == (404, True)


def test_client_may_return_to_server_rendering(session: Session) -> None:
    (view,) = hello(session)["views"]
    session.send_message(**camera_message(view, 1, 0.2), refine="none")
    while (first := frame_of_camera(session, 1)).header["fidelity"] == "preview":
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


def test_slow_links_get_pictures_instead_of_tables_during_drags(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tables follow after the drag; small changes always arrive as tables, and cameras need no message."""
    monkeypatch.setattr(FrameWindow, "is_slow_for", lambda self, num_bytes, *, was_slow: num_bytes > 100_000)
    first_view = hello(session)
    (view,), color = first_view["views"], f"/materials/{first_view['materials'][0]}/terms/0/color"
    session.send_message(**camera_message(view, 1, 0.05), refine="none")
    frame_of_camera(session, 1)
    session.edit(1, "/transport/show", "direct")  # colors would change the light of all probes
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
        session.send_message(**camera_message(view, revision, 0.1 * revision), refine="none")
        assert arrays_in(tables_of(session)) == {}
    assert kinds == ["picture", "picture", "picture", "scene_update"]  # it measures once how small color tables are


def test_tables_follow_a_picture_without_refinement(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FrameWindow, "is_slow_for", lambda self, num_bytes, *, was_slow: num_bytes > 100_000)
    session.edit(1, "/transport/show", "direct")
    session.send_message(type="renderer", renderer="client")
    until_fine(session, 1)
    for revision in (2, 3):
        session.edit(revision, "/environment/intensity", 0.5 / revision)
        while (first := session.frame()).header["revision"] != revision:
            pass
        assert first.header["kind"] == "picture"
        assert arrays_in(tables_of(session)) == {}  # a factor on all light is one number
