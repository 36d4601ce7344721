"""Exported images: file names, EXR layers and attributes, progress and cancellation."""

import json
import time
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import OpenImageIO
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import Baked
from test_comparisons import is_done, wait_until


def test_renders_are_named_after_the_scene_or_as_requested(client: TestClient, baked: Baked) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "exr"}

    def name_of(more: dict[str, Any]) -> str:
        url = client.post("/api/renders", json=request | more).headers["location"]
        assert wait_until(client, url, is_done)["state"] == "ready"
        return unquote(client.get(f"{url}/frames/0").headers["content-disposition"])

    assert name_of({}) == 'attachment; filename="triangle-front.exr"'
    assert name_of({"name": '../a\r\nb "c"/灯'}) == "attachment; filename*=utf-8''a-b-c-灯.exr"
    assert name_of({"name": "...", "format": "png"}) == 'attachment; filename="picture.png"'
    assert name_of({"name": "x" * 256}) == f'attachment; filename="{"x" * 120}.exr"'
    assert name_of({"looks": [{}, {}]}) == 'attachment; filename="triangle-front-0000.exr"'


def test_exr_render_has_layers_progress_and_cancellation(
    client: TestClient, control: Control, baked: Baked, tmp_path: Path
) -> None:
    lights = {name: {"kind": "point", "position": [0, 1, 0]} for name in ("Key", "key")}
    request = {"bake": baked.bake, "view": "front", "looks": [{"lights": lights}], "format": "exr", "size": [32, 16]}
    assert client.post("/api/renders", json=request | {"format": "png", "layers": True}).status_code == 422
    control.render_gate.clear()
    assert client.post("/api/renders", json=request | {"layers": "all"}).status_code == 422
    stopped, url, groups = (
        client.post("/api/renders", json=request | {"layers": light, "precision": "float"}).headers["location"]
        for light in (True, True, "light_groups")
    )
    while client.get(stopped).json()["progress"] != 0.5 / 4:
        time.sleep(0.02)
    assert client.delete(stopped).status_code == 204
    while client.get(url).json()["progress"] == 0.0:  # the next job does not wait for the stopped one
        time.sleep(0.02)
    control.render_gate.set()
    assert wait_until(client, url, is_done)["progress"] == 1.0
    (tmp_path / "a.exr").write_bytes(client.get(f"{url}/frames/0").content)
    spec = OpenImageIO.ImageBuf(str(tmp_path / "a.exr")).spec()
    assert (spec.width, spec.height, str(spec.format)) == (32, 16, "float")
    assert {name.partition(".")[0] for name in spec.channelnames} >= {"light_environment", "light_Key", "light_key_2"}
    assert spec.get_string_attribute("relume:bake") == baked.bake
    assert json.loads(spec.get_string_attribute("relume:look"))["lights"]["key"]["position"] == [0, 1, 0]
    assert wait_until(client, groups, is_done)["state"] == "ready"
    (tmp_path / "a.exr").write_bytes(client.get(f"{groups}/frames/0").content)
    names = {name.partition(".")[0] for name in OpenImageIO.ImageBuf(str(tmp_path / "a.exr")).spec().channelnames}
    assert names == {"R", "G", "B", *(f"light_{light}_direct" for light in ("environment", "Key", "key_2"))}
    assert len(list((client.app.state.services.settings.data / "renders").iterdir())) == 2


def test_exr_render_has_aovs_of_its_size(client: TestClient, baked: Baked, tmp_path: Path) -> None:
    request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "exr", "size": [32, 16], "aovs": True}
    assert client.post("/api/renders", json=request | {"format": "png"}).status_code == 422
    url = client.post("/api/renders", json=request).headers["location"]
    assert wait_until(client, url, is_done)["state"] == "ready"
    (tmp_path / "a.exr").write_bytes(client.get(f"{url}/frames/0").content)
    image = OpenImageIO.ImageBuf(str(tmp_path / "a.exr"))
    assert (image.spec().width, image.spec().height) == (32, 16)
    assert {"R", "Z", "N.X", "albedo.R", "CryptoMaterial00.R"} <= set(image.spec().channelnames)
