"""Malicious or invalid REST requests are rejected clearly, and no data is lost."""

import json
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked

IDS = "0123456789abcdef"


def test_invalid_scene_file_is_refused(client: TestClient) -> None:
    response = client.post("/api/scenes", files={"scene": ("../../x.glb", b"glTF\x02\x00\x00\x00\xff\xff\xff\x7f")})
    assert parse_problem(response)["type"] == "urn:relume:problem:scene"
    assert client.get("/api/scenes").json() == []


def test_referenced_files_are_bounded_and_their_names_are_not_paths(client: TestClient, settings: Any) -> None:
    obj = b"mtllib ../../relume.db\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    beside = [("companions", (f"{number}.png", b"")) for number in range(901)]
    rejected = client.post("/api/scenes", files=[("scene", ("a.obj", obj)), *beside])
    assert parse_problem(rejected)["type"] == "urn:relume:problem:parameter"
    climbing = [("scene", ("a/b/c.obj", obj)), ("companions", ("../../../../tmp/x", b"newmtl Red\n"))]
    taken = client.post("/api/scenes", files=climbing).json()
    assert ["relume.db”: import it together" in warning["text"] for warning in taken["warnings"]] == [True]
    client.delete(f"/api/scenes/{taken['id']}")
    assert list(settings.data.glob("upload-*")) == []


def test_import_beyond_the_memory_limit_is_stopped(client: TestClient, settings: Any) -> None:
    settings.import_bytes = 64 * 1024**2  # less than an interpreter with NumPy needs
    response = client.post("/api/scenes", files={"scene": ("x.glb", b"glTF")})
    assert parse_problem(response)["status"] == 422
    assert list(settings.data.glob("upload-*")) == []


def test_upload_beyond_the_limit_is_413(client: TestClient) -> None:
    response = client.post("/api/scenes", files={"scene": ("x.glb", b"\x00" * (4 * 1024**2 + 1))})
    assert parse_problem(response)["status"] == 413


@pytest.mark.parametrize(("path", "field"), [("/api/environments", "environment"), ("/api/images", "image")])
def test_environments_and_images_may_be_as_large_as_scenes(client: TestClient, path: str, field: str) -> None:
    """4K images have more bytes than any document."""
    for num_mib, is_too_large in ((3, False), (4, True)):  # documents have a limit of 2 MiB
        response = client.post(path, files={field: ("x.exr", b"\x00" * (num_mib * 1024**2))})
        assert (parse_problem(response)["status"] == 413) == is_too_large


def test_upload_of_unknown_length_is_cut_at_the_limit(client: TestClient) -> None:
    num_chunks = 0

    def chunks() -> Any:
        nonlocal num_chunks
        yield b'--b\r\nContent-Disposition: form-data; name="scene"; filename="x.glb"\r\n\r\n'
        for num_chunks in range(8):  # noqa: B007
            yield b"\x00" * 1024**2

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    response = client.post("/api/scenes", content=chunks(), headers=headers)
    assert parse_problem(response)["status"] == 413


def test_body_of_another_call_beyond_the_limit_is_413(client: TestClient) -> None:
    assert parse_problem(client.post("/api/bakes", content=b" " * (2 * 1024**2 + 1)))["status"] == 413
    headers = {"Content-Length": "9" * 5000}
    assert parse_problem(client.post("/api/bakes", content=b"{}", headers=headers))["status"] == 413


@pytest.mark.parametrize(
    "name", ["%00", "a%0Ab", "%20a", "..", "%2e%2e%2fetc%2fpasswd", "..%5c..", "x" * 81, "%E2%80%AE", "%7F"]
)
def test_invalid_look_name_is_refused(client: TestClient, name: str) -> None:
    response = client.put(f"/api/looks/{name}", json={})
    assert parse_problem(response)["status"] in (404, 405, 422)
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
def test_invalid_look_is_refused(client: TestClient, body: bytes) -> None:
    assert parse_problem(client.put("/api/looks/a", content=body))["status"] == 422


def test_oversized_look_is_413(client: TestClient) -> None:
    body = json.dumps({"materials": {"a": {"x": "y" * 262_144}}})
    assert parse_problem(client.put("/api/looks/a", content=body))["status"] == 413


@pytest.mark.parametrize(
    "change",
    [
        {"bake": IDS},
        {"view": "nowhere"},
        {"looks": []},
        {"looks": [{}] * 1001},
        {"looks": [{"materials": {"Nothing": {}}}]},
        {"looks": [{"environment": {"intensity": -1}}]},
        {"format": "exe"},
        {"size": [0, 1]},
        {"size": [161, 96]},
        {"size": [16384, 16384]},
        {"size": [10**12, 1]},
        {"surprise": 1},
    ],
)
def test_impossible_render_is_refused(client: TestClient, baked: Baked, change: dict[str, Any]) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"} | change
    assert parse_problem(client.post("/api/renders", json=request))["status"] in (404, 422)


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
def test_impossible_bake_is_refused(client: TestClient, baked: Baked, change: dict[str, Any]) -> None:
    response = client.post(
        "/api/bakes", json={"scene": baked.scene, "method": "direct", "size": [8, 8], "lights": 9} | change
    )
    assert parse_problem(response)["status"] in (404, 422)


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
    assert response.status_code in (200, 404, 422)
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
    assert parse_problem(client.request(method, path))["status"] == status


@pytest.mark.parametrize(
    ("method", "path"),
    [("DELETE", f"/api/scenes/{IDS}/cameras/a%00b"), ("GET", "/api/audit?who=%00"), ("GET", f"/api/shares/{IDS}%00")],
)
def test_null_characters_never_reach_the_database(client: TestClient, method: str, path: str) -> None:
    rejected = parse_problem(client.request(method, path))
    assert (rejected["status"], rejected["parameter"]) == (422, "the address")


@pytest.mark.parametrize("path", ["/api/models/albedo", "/api/models/zernike-fit"])
def test_names_in_invalid_unicode_are_refused(client: TestClient, path: str) -> None:
    body = b'{"terms": [{"model": "lambert", "\\ud800": 1}]}'
    rejected = parse_problem(client.post(path, content=body, headers={"Content-Type": "application/json"}))
    assert rejected["status"] == 422
    assert "is unknown; give one of" in rejected["detail"]


@pytest.mark.parametrize(
    ("content", "kind", "message"),
    [
        (b"hello", "multipart/form-data; boundary=b", "the body cannot be read"),
        (b"\xff\xfe{", "application/json", "send the format of /api/openapi.json"),
    ],
)
def test_unreadable_bodies_are_a_problem(client: TestClient, content: bytes, kind: str, message: str) -> None:
    rejected = parse_problem(client.post("/api/environments", content=content, headers={"Content-Type": kind}))
    assert rejected["type"] == "urn:relume:problem:invalid-request"
    if rejected["status"] == 400:
        assert message in rejected["detail"]


def test_text_instead_of_a_file_is_refused_with_a_message(client: TestClient) -> None:
    rejected = parse_problem(client.post("/api/scenes", files={"scene": (None, b"text")}))
    assert rejected["detail"] == "/scene is text; give a file, with a file name in its part of the form"


def test_missing_data_directory_is_a_problem_without_a_traceback(client: TestClient, settings: Any) -> None:
    settings.data = settings.data / "gone"
    problem = parse_problem(client.get("/readyz"))
    assert problem["status"] == 507
    assert str(settings.data) not in json.dumps(problem)
