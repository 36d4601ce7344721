"""REST calls end to end with a fake bake method."""

import io
import json
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from fastapi.testclient import TestClient
from glb_builder import Glb
from PIL import Image
from server_fakes import SIZE, Control, InThreadSteps
from session_client import Baked

from relume.look import Look
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.database.models import JobRow
from relume_worker.paths import bake_path

WIDTH, HEIGHT = SIZE


@pytest.fixture(scope="module")
def glb() -> bytes:
    """A real file with one box."""
    data: bytes = trimesh.Scene(trimesh.creation.box()).export(file_type="glb")
    return data


def wait_until_done(client: TestClient, url: str) -> dict[str, Any]:
    for _ in range(500):
        body: dict[str, Any] = client.get(url).json()
        if body["state"] in ("ready", "failed"):
            return body
        time.sleep(0.02)
    raise TimeoutError(url)


def test_scene_formats_are_detected_by_content_and_may_have_more_files(client: TestClient) -> None:
    obj = b"mtllib gone.mtl\nmtllib looks/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Red\nf 1 2 3\n"
    beside = ("leaf/looks/m.mtl", b"newmtl Red\nKd 1 0 0\n")
    created = client.post("/api/scenes", files=[("scene", ("leaf/Leaf.obj", obj)), ("companions", beside)])
    assert created.status_code == 201, created.text
    body = created.json()
    assert (body["name"], body["variants"]) == ("Leaf", [])
    assert body["materials"][0]["terms"][0]["color"] == [1, 0, 0]
    assert ["gone.mtl" in warning["text"] for warning in body["warnings"]] == [True]
    assert body["warnings"] == [{"text": body["warnings"][0]["text"], "severity": "unsupported", "where": "“gone.mtl”"}]
    evil = {"scene": ("evil.obj", obj.replace(b"gone.mtl", b"../environment.hdr"))}
    warnings = client.post("/api/scenes", files=evil).json()["warnings"]
    assert any("outside the scene" in warning["text"] for warning in warnings)


def test_import_options_are_applied_and_returned(client: TestClient) -> None:
    obj = b"v 0 0 0\nv 100 0 0\nv 0 0 200\nf 1 2 3\n"
    plain = client.post("/api/scenes", files={"scene": ("flat.obj", obj)}).json()
    assert plain["import_options"] == {
        "up": "file",
        "unit": "file",
        "recenter": "auto",
        "light_unit": "file",
        "scene_name": "",
        "time": None,
    }
    options = {"up": "z", "unit": "cm", "recenter": "always", "light_unit": "W/sr", "scene_name": "B"}
    options["time"] = 1.25
    created = client.post("/api/scenes", files={"scene": ("flat.obj", obj)}, data=options)
    assert created.status_code == 201, created.text
    scene = client.get(f"/api/scenes/{created.json()['id']}").json()
    assert scene["import_options"] == options
    assert scene["id"] != plain["id"]
    for refused in ({"up": "x"}, {"time": "nan"}, {"time": "soon"}):
        assert client.post("/api/scenes", files={"scene": ("flat.obj", obj)}, data=refused).status_code == 422


def test_built_in_scenes_are_listed_and_imported_by_name(client: TestClient) -> None:
    listed = client.get("/api/example-scenes").json()
    assert [each["name"] for each in listed][:2] == ["still_life", "cornell_box"]
    assert all(each["description"] and each["method"] == "gather" for each in listed)
    created = client.post("/api/example-scenes/cornell_box")
    assert created.status_code == 201, created.text
    scene = created.json()
    assert (scene["name"], scene["warnings"]) == ("Cornell box", [])
    assert created.headers["location"] == f"/api/scenes/{scene['id']}"
    assert client.post("/api/example-scenes/cornell_box").json()["id"] == scene["id"]
    assert client.post("/api/example-scenes/palace").status_code == 404
    client.delete(f"/api/scenes/{scene['id']}")


def test_scene_is_imported_listed_baked_and_deleted(client: TestClient, glb: bytes) -> None:
    created = client.post("/api/scenes", files={"scene": ("Box on table.glb", glb)})
    assert created.status_code == 201, created.text
    scene = created.json()
    assert created.headers["location"] == f"/api/scenes/{scene['id']}"
    assert scene["name"] == "Box on table"
    assert scene["triangles"] == 12
    assert [view["name"] for view in scene["views"]] == ["front"]
    assert client.get("/api/scenes").json() == [scene]
    request = {"scene": scene["id"], "preset": "preview"}
    plan = client.post("/api/bakes", json=request | {"dry_run": True})
    assert plan.status_code == 200
    assert plan.json()["recipe"] == {
        "method": "gather", "views": ["front"], "size": [320, 240], "lights": 300, "probes": None,
        "patches": None, "gather_rays": None, "relightable": False, "cameras": [],
    }  # fmt: skip
    assert client.get("/api/bakes").json() == []
    queued = client.post("/api/bakes", json=request)
    assert queued.status_code == 202
    assert queued.json()["id"] == plan.json()["id"]
    bake = wait_until_done(client, queued.headers["location"])
    assert bake["state"] == "ready"
    assert client.get("/api/bakes", params={"scene": scene["id"]}).json()[0]["id"] == bake["id"]
    shown = client.get(f"/api/scenes/{scene['id']}").json()
    assert shown["bakes"] == [bake["id"]]
    picture = Image.open(io.BytesIO(client.get(shown["thumbnail"]).content))
    assert (picture.format, picture.size) == ("WEBP", (320, 240))
    assert client.delete(f"/api/scenes/{scene['id']}").status_code == 204
    assert client.get(f"/api/scenes/{scene['id']}").status_code == 404
    assert client.get("/api/bakes").json() == []


def test_thumbnail_uses_the_coarsest_sufficient_bake(client: TestClient, baked: Baked) -> None:
    for size, is_shown in (([640, 480], True), ([400, 300], True), ([64, 48], False), ([500, 400], False)):
        queued = client.post("/api/bakes", json={"scene": baked.scene, "method": "direct", "size": size, "lights": 100})
        assert wait_until_done(client, queued.headers["location"])["state"] == "ready"
        shown = client.get(f"/api/scenes/{baked.scene}").json()
        assert shown["thumbnail"].endswith(f"bake={queued.json()['id']}") == is_shown


def test_views_have_the_aspect_of_their_camera_and_presets_accept_any(client: TestClient) -> None:
    glb = Glb().quad()
    glb.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.6, "aspectRatio": 16 / 9}}]
    glb.document["nodes"] += [{"camera": 0, "translation": [0, 1, 4]}]
    glb.document["scenes"] = [{"nodes": [0, 1]}]
    scene = client.post("/api/scenes", files={"scene": ("wide.glb", glb.bytes())}).json()
    (view,) = scene["views"]
    assert view["aspect"] == pytest.approx(16 / 9)
    asked = {"scene": scene["id"], "method": "direct", "preset": "good", "dry_run": True}
    for aspect, size in ((None, [640, 480]), (4 / 3, [640, 480]), (view["aspect"], [736, 414]), (0.8, [496, 620])):
        planned = client.post("/api/bakes", json={**asked, "aspect": aspect})
        assert planned.json()["recipe"]["size"] == size, planned.text
    assert client.post("/api/bakes", json={**asked, "aspect": 2, "size": [64, 64]}).json()["recipe"]["size"] == [64, 64]
    assert client.post("/api/bakes", json={**asked, "aspect": 20}).status_code == 422
    client.delete(f"/api/scenes/{scene['id']}")


def test_repeated_recipe_is_the_same_bake(client: TestClient, baked: Baked) -> None:
    request = {"scene": baked.scene, "method": "direct", "size": [64, 48], "lights": 20}
    first, second = (client.post("/api/bakes", json=request).json() for _ in range(2))
    assert first["id"] == second["id"]


def test_bake_events_end_with_the_bake(client: TestClient, baked: Baked) -> None:
    with client.stream("GET", f"/api/bakes/{baked.bake}/events") as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        lines = [line for line in response.iter_lines() if line]
    assert lines[0] == "event: bake"
    assert json.loads(lines[1].removeprefix("data: "))["state"] == "ready"
    assert len(lines) == 2


def test_finished_bake_cannot_be_canceled_and_is_deleted_on_request(
    client: TestClient, settings: Settings, baked: Baked
) -> None:
    refused = client.delete(f"/api/bakes/{baked.bake}")
    assert (refused.status_code, "?delete_files=true" in refused.json()["detail"]) == (409, True)
    assert client.get(f"/api/bakes/{baked.bake}").json()["state"] == "ready"
    store = bake_path(settings.data, baked.bake)
    assert store.exists()
    assert client.delete(f"/api/bakes/{baked.bake}?delete_files=true").status_code == 204
    assert client.get(f"/api/bakes/{baked.bake}").status_code == 404
    assert client.delete(f"/api/bakes/{baked.bake}?delete_files=true").status_code == 404
    assert client.get("/api/bakes").json() == []
    assert not store.exists()
    assert len(client.get("/api/scenes").json()) == 1


def test_nearly_full_disk_rejects_new_work_and_allows_deletion(
    client: TestClient, settings: Settings, baked: Baked
) -> None:
    settings.min_free_bytes = 1 << 60
    bake = {"scene": baked.scene, "method": "direct", "size": [24, 16], "lights": 11}
    image = {"files": {"image": ("a.png", b"")}}
    for refused in (
        client.post("/api/example-scenes/cornell_box"),
        client.post("/api/scenes", files={"scene": ("a.glb", b"")}),
        client.post("/api/images", **image),
        client.post("/api/bakes", json=bake),
        client.post("/api/comparisons", json={"bake": baked.bake, "view": "front", "look": {}}),
        client.get("/readyz"),
    ):
        assert (refused.status_code, refused.json()["type"]) == (507, "urn:relume:problem:disk")
    assert client.delete(f"/api/scenes/{baked.scene}").status_code == 204


def test_material_ids_are_16_bit_png(client: TestClient, baked: Baked) -> None:
    response = client.get(f"/api/bakes/{baked.bake}/views/front/materials.png")
    ids = np.asarray(Image.open(io.BytesIO(response.content)))
    assert ids.shape == (HEIGHT, WIDTH)
    assert ids[0, 0] == 65535
    assert ids[1, 1] == 0
    assert client.get(f"/api/bakes/{baked.bake}/views/none/materials.png").status_code == 404


def test_free_camera_warnings_of_terms_are_reported(client: TestClient) -> None:
    terms = [{"model": "lambert"}, {"model": "phong", "params": {"exponent": 400.0}}]
    diffuse, sharp = client.post("/api/models/zernike-fit", json={"terms": terms}).json()
    assert (diffuse["functions"], diffuse["required_functions"], diffuse["drawn_by"]) == (1, 1, "functions")
    assert (sharp["functions"], sharp["required_functions"]) == (36, None)
    assert sharp["drawn_by"] in ("lights", "rays")
    chosen = client.post("/api/models/zernike-fit", json={"terms": terms, "basis_functions": 6}).json()
    assert [(fit["functions"], fit["drawn_by"]) for fit in chosen] == [(6, "functions")] * 2
    assert chosen[1]["residual"] > sharp["residual"]
    refused = client.post("/api/models/zernike-fit", json={"terms": terms, "basis_functions": 12})
    assert refused.status_code == 422
    assert 0 <= diffuse["residual"] < 0.01 < sharp["residual"] <= 1
    worded = [{"model": "phong", "params": {"exponent": "x"}}]
    for bad in ([], [{"model": "nothing"}], worded, [{"model": "lambert"}] * 99):
        answer = client.post("/api/models/zernike-fit", json={"terms": bad})
        assert answer.status_code == 422, bad
        assert len(answer.json()["detail"]) > 10


def test_albedo_of_a_material_is_reported(client: TestClient) -> None:
    grey = {"model": "lambert", "color": [0.2, 0.5, 0.3]}
    albedo = client.post("/api/models/albedo", json={"terms": [grey]}).json()
    assert albedo["mean"] == pytest.approx(grey["color"], rel=1e-3)
    assert albedo["max"] == pytest.approx(0.5, rel=0.01)
    bright = {"model": "blinn_phong", "color": [0.5, 0.5, 0.5], "params": {"exponent": 20.0}}
    albedo = client.post("/api/models/albedo", json={"terms": [grey, bright]}).json()
    assert albedo["max"] > 1
    assert 0 <= albedo["max_angle_degrees"] < 90
    for bad in ([], [{"model": "nothing"}], [grey] * 99):
        assert client.post("/api/models/albedo", json={"terms": bad}).status_code == 422


def test_server_without_a_color_config_has_no_display_views(client: TestClient, baked: Baked) -> None:
    color_settings = client.get("/api/color").json()
    assert not any(color_settings.values())
    assert client.get(f"/api/color/{'0' * 16}/lut", params={"display": "a", "view": "b"}).status_code == 404
    look = {"display": {"tone_map": {"display": "a", "view": "b"}}}
    refused = client.post("/api/renders", json={"bake": baked.bake, "view": "front", "looks": [look], "format": "png"})
    assert (refused.status_code, refused.json()["parameter"]) == (422, "/looks/0/display/tone_map")
    assert "no OpenColorIO config" in refused.json()["detail"]


def test_models_are_listed(client: TestClient) -> None:
    models = {model["model"]: model for model in client.get("/api/models").json()}
    assert "theta_h" in [curve["name"] for curve in models["cook_torrance"]["curves"]]
    assert (models["ggx"]["specular_below"], models["lambert"]["specular_below"]) == (0.06, None)


def test_library_materials_are_listed_and_usable_in_looks(client: TestClient, baked: Baked) -> None:
    listed = {entry["id"]: entry for entry in client.get("/api/materials").json()}
    nickel = listed["low_cooktorrance_E2/nickel"]
    assert (nickel["name"], nickel["group"], nickel["model"]) == ("Nickel", "metal", "cook_torrance")
    look = {"materials": {"Paper": {"terms": nickel["terms"]}}}
    request = {"bake": baked.bake, "view": "front", "looks": [look], "format": "png", "size": [32, 16]}
    queued = client.post("/api/renders", json=request)
    assert queued.status_code == 202, queued.text
    assert wait_until_done(client, queued.headers["location"])["state"] == "ready"


def test_material_map_has_points_of_the_library(client: TestClient) -> None:
    listed = {entry["id"]: entry for entry in client.get("/api/materials").json()}
    assert client.get("/api/materials/map").json() == client.get("/api/materials/map?table=ngan").json()
    assert client.get("/api/materials/map?table=bagher").status_code == 422
    for table in ("ngan", "low"):
        plane = client.get(f"/api/materials/map?table={table}").json()
        for point in plane["points"]:
            assert point["id"].startswith(table)
            params = listed[point["id"]]["terms"][1]["params"]
            assert point["sigma"] == params["sigma"]
            index = params["ior"] + 1j * params["extinction"]
            assert point["f0"] == pytest.approx(abs((index - 1) / (index + 1)) ** 2)
        assert {k for triangle in plane["triangles"] for k in triangle} == set(range(len(plane["points"])))


def test_render_batch_produces_frames_and_archive(client: TestClient, baked: Baked) -> None:
    looks = [{}, {"materials": {"Paper": {"terms": [{"model": "lambert", "color": [0.25, 0, 0]}] * 2}}}]
    looks[1]["materials"]["Paper"]["terms"][1] = {"model": "cook_torrance", "params": {"sigma": 0.5}}
    request = {"bake": baked.bake, "view": "front", "looks": looks, "format": "png", "size": [32, 16]}
    queued = client.post("/api/renders", json=request)
    assert queued.status_code == 202, queued.text
    url = queued.headers["location"]
    done = wait_until_done(client, url)
    assert (done["state"], done["completed"], done["total"], done["progress"]) == ("ready", 2, 2, 1.0)
    frame = client.get(f"{url}/frames/1")
    assert frame.headers["content-type"] == "image/png"
    assert Image.open(io.BytesIO(frame.content)).size == (32, 16)
    assert client.get(f"{url}/frames/2").status_code == 404
    packed = client.get(f"{url}/archive.zip")
    assert packed.headers["content-disposition"] == 'attachment; filename="triangle-front.zip"'
    archive = zipfile.ZipFile(io.BytesIO(packed.content))
    assert archive.namelist() == ["triangle-front-0000.png", "triangle-front-0001.png"]
    assert archive.read("triangle-front-0001.png") == frame.content
    assert client.delete(url).status_code == 204
    assert client.get(url).status_code == 404


def test_render_resumes_after_a_restart(settings: Settings, client: TestClient, baked: Baked) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}, {}], "format": "exr"}
    url = client.post("/api/renders", json=request).headers["location"]
    assert wait_until_done(client, url)["state"] == "ready"
    services = client.app.state.services
    identity = url.rsplit("/", 1)[1]
    services.renders._service.ledger._update(
        JobRow.id == identity, state="running", done=1
    )  # the state after a killed server
    status = services.renders.get(url.rsplit("/", 1)[1])
    services.renders.frame_path(status, 1).unlink()
    services.renders.archive_path(status).unlink()
    untouched = services.renders.frame_path(status, 0).stat().st_mtime_ns
    control = Control()
    with TestClient(create_app(settings, open_library=control.open_library, open_steps=InThreadSteps)) as restarted:
        assert wait_until_done(restarted, url)["state"] == "ready"
        assert restarted.get(f"{url}/frames/1").status_code == 200
    assert services.renders.frame_path(status, 0).stat().st_mtime_ns == untouched


def test_complete_look_is_saved(client: TestClient) -> None:
    whole = {section: {} for section in Look.model_fields}
    assert client.put("/api/looks/Whole", json=whole, headers={"If-None-Match": "*"}).status_code == 201
    assert client.get("/api/looks/Whole").json() == whole
    assert client.put("/api/looks/Other", json={"mood": {}}, headers={"If-None-Match": "*"}).status_code == 422


def test_look_changes_need_its_current_version(client: TestClient) -> None:
    url = "/api/looks/Red%20teapot"
    look = {"display": {"exposure": 1.5}}
    created = client.put(url, json=look, headers={"If-None-Match": "*"})
    assert created.status_code == 201
    etag = created.headers["etag"]
    assert client.get(url).json() == look
    assert client.get(url, headers={"If-None-Match": etag}).status_code == 304
    assert client.put(url, json=look, headers={"If-None-Match": "*"}).status_code == 412
    assert client.put(url, json=look).status_code == 428
    changed = client.put(url, json={"display": {}}, headers={"If-Match": etag})
    assert changed.status_code == 204
    assert changed.headers["etag"] != etag
    assert client.put(url, json=look, headers={"If-Match": etag}).status_code == 412
    assert [entry["name"] for entry in client.get("/api/looks").json()] == ["Red teapot"]
    assert client.delete(url).status_code == 428
    assert client.delete(url, headers={"If-Match": etag}).status_code == 412
    assert client.delete(url, headers={"If-Match": changed.headers["etag"]}).status_code == 204
    assert client.get(url).status_code == 404


def test_health_and_metrics(client: TestClient) -> None:
    assert client.get("/livez").json() == {"status": "alive"}
    assert client.get("/readyz").json() == {"status": "ready"}
    text = client.get("/metrics").text
    assert 'relume_http_requests_total{method="GET",status="200"} 2.0' in text
    assert "relume_frozen_cache_bytes 123.0" in text
    assert "relume_edit_to_socket_seconds_bucket" in text


@pytest.fixture
def dist(settings: Settings) -> Iterator[Path]:
    (settings.client / "assets").mkdir(parents=True)
    (settings.client / "index.html").write_text("<title>editor</title>")
    (settings.client / "assets" / "main-abc.js").write_text("1")
    return settings.client


def test_editor_is_served_with_its_routes(client: TestClient, dist: Path) -> None:
    for path in ("/", "/scenes/0123456789abcdef", "/index.html"):
        page = client.get(path)
        assert page.text == "<title>editor</title>"
        assert page.headers["cache-control"] == "no-cache"
        assert "default-src 'self'" in page.headers["content-security-policy"]
        assert page.headers["x-content-type-options"] == "nosniff"
    asset = client.get("/assets/main-abc.js")
    assert "immutable" in asset.headers["cache-control"]
    assert client.get("/assets/missing.js").status_code == 404


def test_missing_editor_says_how_to_build_it(client: TestClient) -> None:
    page = client.get("/")
    assert page.status_code == 503
    assert "npm run build" in page.text
