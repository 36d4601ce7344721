"""Calls of the client: scenes, bakes, renders, and what can go wrong."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from coroutines import run_in_thread
from PIL import Image
from running_server import Running, running_server
from server_fakes import SIZE, Control

from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes
from relume_client import (
    AccessError,
    Bake,
    Client,
    JobFailedError,
    ProblemError,
    ServerUnavailableError,
    ServerVersionError,
)
from relume_client.transport import Transport, normalize_url
from relume_server.io.import_request import _import
from relume_server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
TRIANGLE = b"mtllib colors/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Red\nf 1 2 3\n"


def displayed(radiance: float) -> np.ndarray:
    return to_bytes(tone_map(np.full((SIZE[1], SIZE[0], 3), radiance, np.float32), 0.0, "agx"))


def sigma_look(sigma: float) -> dict[str, Any]:
    lambert = {"model": "lambert", "color": [0.5, 0.5, 0.5]}
    gloss = {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": sigma}}
    return {"materials": {"Paper": {"terms": [lambert, gloss]}}}


def test_package_needs_nothing_of_the_server() -> None:
    missing = ["relume", "numba", "embreex", "fastapi", "pydantic", "anywidget", "PIL"]
    code = f"import sys; sys.modules.update(dict.fromkeys({missing})); import relume_client"
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": str(ROOT / "client")}, timeout=60)


@pytest.fixture
def _quick_imports(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    """Import in the server's process: a process of its own takes seconds to start."""
    monkeypatch.setattr(running.app.state.services.import_queue.importers, "run", _import)


@pytest.mark.usefixtures("_quick_imports")
def test_scene_with_companions_is_imported(client: Client, tmp_path: Path) -> None:
    folder = tmp_path / "model"
    (folder / "colors").mkdir(parents=True)
    (folder / "colors" / "m.mtl").write_text("newmtl Red\nKd 0.8 0.1 0.1\n")
    (folder / "tri.obj").write_bytes(TRIANGLE)
    scene = client.import_scene(folder / "tri.obj", companions=[folder], up="z", name="tri")
    assert (scene.info["name"], scene.info["import_options"]["up"]) == ("tri", "z")
    assert [material["name"] for material in scene.info["materials"]] == ["Red"]
    assert scene.id in [other.id for other in client.scenes()]
    assert client.scene(scene.id).info == scene.info
    bake = scene.bake("direct", size=(32, 24), lights=10).wait(timeout=30)
    assert (bake.info["recipe"]["size"], bake.info["scene"]) == ([32, 24], scene.id)
    scene.delete()
    with pytest.raises(ProblemError, match="scene") as missing:
        client.scene(scene.id)
    assert (missing.value.status, missing.value.kind) == (404, "not-found")


@pytest.mark.usefixtures("_quick_imports")
def test_rejections_have_the_sentence_and_the_fields(client: Client, bake: Bake, tmp_path: Path) -> None:
    (tmp_path / "bad.glb").write_bytes(b"glTF nonsense")
    with pytest.raises(ProblemError) as rejected:
        client.import_scene(tmp_path / "bad.glb")
    assert (rejected.value.status, rejected.value.kind) == (422, "scene")
    with pytest.raises(FileNotFoundError):
        client.import_scene(tmp_path / "missing.glb")
    with pytest.raises(ProblemError, match="lights") as rejected:
        client.scene(bake.info["scene"]).bake("direct", lights=-1)
    assert rejected.value.errors[0]["pointer"] == "/lights"


def test_images_of_looks(bake: Bake) -> None:
    images = bake.images([sigma_look(0.3), sigma_look(0.4)])
    assert [np.array_equal(image, displayed(v)) for image, v in zip(images, (0.8, 0.9), strict=True)] == [True, True]
    look = bake.look(sigma_look(0.4))
    look["Paper"].lambert.color = 0.1, 0.1, 0.1
    assert np.array_equal(bake.images(look)[0], displayed(0.5))


def test_looks_are_shared_and_saved(running: Running, client: Client, bake: Bake) -> None:
    link = bake.share(sigma_look(0.3))
    address, _, share = link.partition("/?share=")
    assert address == f"http://127.0.0.1:{running.port}"
    shared = client.shared_look(share)
    assert shared["materials"]["Paper"]["terms"][1]["params"]["sigma"] == 0.3
    assert client.saved_looks() == []
    httpx.put(f"{address}/api/looks/Night%20-2", json=sigma_look(0.4)).raise_for_status()
    assert [entry["name"] for entry in client.saved_looks()] == ["Night -2"]
    assert client.saved_look("Night -2") == sigma_look(0.4)
    with pytest.raises(ProblemError, match="gone"):
        client.saved_look("gone")


def test_scene_is_exported(client: Client, bake: Bake, tmp_path: Path) -> None:
    scene = client.scene(bake.info["scene"])
    scene.export(tmp_path / "new" / "a.glb", sigma_look(0.3))
    assert (tmp_path / "new" / "a.glb").read_bytes()[:4] == b"glTF"
    with pytest.raises(ValueError, match=r"does not end in \.glb"):
        scene.export(tmp_path / "a.fbx")


def test_renders_are_files(bake: Bake, tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder"
    files = bake.render([sigma_look(0.3), sigma_look(0.4)], target / "look_{}.png")
    assert [file.name for file in files] == ["look_0000.png", "look_0001.png"]
    assert np.array_equal(np.array(Image.open(io.BytesIO(files[1].read_bytes()))), displayed(0.9))
    (file,) = bake.render(sigma_look(0.3), target / "one.exr", precision="float")
    assert file.read_bytes()[:4] == b"\x76\x2f\x31\x01"
    assert sorted(path.name for path in target.rglob("*.*")) == ["look_0000.png", "look_0001.png", "one.exr"]


def test_names_of_renders_are_checked_before(bake: Bake, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"does not end in \.png"):
        bake.render({}, tmp_path / "a.jpg")
    with pytest.raises(ValueError, match=r"2 images need \{\} in their name"):
        bake.render([{}, {}], tmp_path / "a.png")
    assert list(tmp_path.glob("*.png")) == []


def test_failed_jobs_raise_the_sentence_of_the_server(bake: Bake, control: Control, tmp_path: Path) -> None:
    control.render_gate.clear()
    with pytest.raises(TimeoutError, match=r"the render \w+ is not ready after 0.3 s; it goes on"):
        bake.render({}, tmp_path / "a.png", timeout=0.3)
    control.render_gate.set()

    def fail(*_: object, **__: object) -> None:
        raise MemoryError

    control._render_small = fail  # type: ignore[method-assign,assignment]
    states = list[str]()
    bake._bake.info = {**bake.info, "state": "failed", "problem": "the disk is full; free some space"}
    with pytest.raises(JobFailedError, match="the disk is full; free some space"):
        bake.wait(progress=lambda body: states.append(body["state"]))
    assert states == ["failed"]


def test_progress_is_one_line(bake: Bake, capsys: pytest.CaptureFixture[str]) -> None:
    bake.wait(progress=True)
    assert capsys.readouterr().err.rstrip(" \n") == "\rbake: ready 100 %"


def test_server_that_is_away() -> None:
    sentence = r"the server at http://127\.0\.0\.1:9 is not available \("
    with Client("127.0.0.1:9", retry_seconds=0.1) as client, pytest.raises(ServerUnavailableError, match=sentence):
        client.scenes()


@pytest.fixture
def guarded(settings: Settings, control: Control) -> Iterator[Running]:
    with running_server(settings.model_copy(update={"login": True}), control) as running:
        yield running


def test_refused_token(guarded: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    running = guarded
    monkeypatch.setattr("relume_server.auth.tokens.TOKEN_CACHE_S", 0.0)
    tokens = running.app.state.services.access.tokens
    token, bake = tokens.add("Ann", "edit"), running.bake()
    monkeypatch.setenv("RELUME_URL", f"http://127.0.0.1:{running.port}/")
    with Client(token="nonsense") as client, pytest.raises(AccessError) as refused:
        client.bake(bake)
    assert (refused.value.status, refused.value.kind) == (401, "login")
    monkeypatch.setenv("RELUME_TOKEN", token)
    with Client() as client, client.bake(bake).session() as session:
        assert session.hello["role"] == "edit"
        assert np.array_equal(session.frame(), displayed(0.7))
        tokens.revoke("Ann")
        for sigma in np.linspace(0.2, 0.5, 100):  # sessions end within two seconds
            session["Paper"].sigma = sigma
            with contextlib.suppress(AccessError):
                session.frame()
                time.sleep(0.1)
                continue
            break
        with pytest.raises(AccessError):
            session.frame()


@pytest.mark.parametrize(
    ("given", "url"),
    [
        (None, "http://127.0.0.1:8420"),
        ("example.org:80/relume/", "http://example.org:80/relume"),
        (" https://example.org ", "https://example.org"),
    ],
)
def test_addresses(given: str | None, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RELUME_URL", raising=False)
    assert normalize_url(given) == url
    with pytest.raises(ValueError, match="is not the address of a server"):
        normalize_url("ftp://example.org")


def call(handler: Callable[[httpx.Request], httpx.Response], method: str = "POST", **limits: float) -> Any:
    """Call a server that is a function."""

    async def work() -> Any:
        transport = Transport("http://server/relume", None, **{"timeout": 5.0, "retry_seconds": 5.0, **limits})
        await transport.close()
        transport._http = httpx.AsyncClient(base_url=transport.url, transport=httpx.MockTransport(handler))
        try:
            return await transport.json(method, "/api/bakes", body={"scene": "0"})
        finally:
            await transport.close()

    return run_in_thread(work())


def problem(status: int, kind: str) -> httpx.Response:
    body = {"type": f"urn:relume:problem:{kind}", "title": "", "status": status, "detail": f"sentence of {kind}"}
    return httpx.Response(status, json=body, headers={"content-type": "application/problem+json"})


def test_repetitions_have_the_same_key() -> None:
    requests = list[httpx.Request]()

    def answer(request: httpx.Request) -> httpx.Response:
        requests.append(request)
        match len(requests):
            case 1:
                raise httpx.ConnectError("refused")
            case 2:
                return problem(503, "draining")
            case 3:
                raise httpx.RemoteProtocolError("closed")  # the server may have done it
            case 4:
                return problem(409, "in-progress")
        return httpx.Response(202, json={"id": "1"})

    assert call(answer) == {"id": "1"}
    assert [request.url.path for request in requests] == ["/relume/api/bakes"] * 5
    keys = {request.headers["Idempotency-Key"] for request in requests}
    assert len(keys) == 1
    requests.clear()
    call(answer, "GET")
    assert "Idempotency-Key" not in requests[0].headers


def test_errors_that_repetition_does_not_help() -> None:
    count = list[int]()

    def reject(request: httpx.Request) -> httpx.Response:
        count.append(1)
        return problem(422, "plan")

    with pytest.raises(ProblemError, match="sentence of plan"):
        call(reject)
    assert len(count) == 1
    with pytest.raises(ServerUnavailableError, match="sentence of busy"):
        call(lambda request: problem(503, "busy"), retry_seconds=0.1)
    with pytest.raises(ServerVersionError, match="there is no relume server"):
        call(lambda request: httpx.Response(404, html="<p>nginx</p>"))
    with pytest.raises(ServerVersionError, match="is it a relume server"):
        call(lambda request: httpx.Response(200, html="<p>hello</p>"))


def test_slow_calls_end() -> None:
    def wait(request: httpx.Request) -> httpx.Response:
        raise httpx.ReadTimeout("slow")

    with pytest.raises(TimeoutError, match="POST /api/bakes took longer than 5 s"):
        call(wait)
