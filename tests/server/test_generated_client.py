"""A client generated from the OpenAPI document imports a scene, bakes it and downloads an image."""

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from fastapi.testclient import TestClient
from test_comparisons import wait_until

openapi_python_client = pytest.importorskip("openapi_python_client")

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
AS_BYTES = ("image/png", "image/webp", "image/jpeg", "image/x-exr", "video/mp4", "application/zip")
"""Content types that the generator does not know: bytes."""


@pytest.fixture
def generated(client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The generated package."""
    from openapi_python_client.config import Config, ConfigFile, MetaType

    document = tmp_path / "openapi.json"
    document.write_text(json.dumps(client.get("/api/openapi.json").json()))
    file = ConfigFile(post_hooks=[], content_type_overrides=dict.fromkeys(AS_BYTES, "application/octet-stream"))
    config = Config.from_sources(
        file, MetaType.NONE, document, "utf-8", overwrite=True, output_path=tmp_path / "generated_client"
    )
    problems = openapi_python_client.generate(config=config)
    assert [f"{problem.header} {problem.detail}" for problem in problems] == []
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    yield importlib.import_module("generated_client")
    for name in set(sys.modules) - before:
        if name.startswith("generated_client"):
            del sys.modules[name]


def call(name: str, **values: Any) -> Any:
    return importlib.import_module(f"generated_client.api.{name}").sync_detailed(**values)


def model(name: str) -> Any:
    return getattr(importlib.import_module("generated_client.models"), name)


def test_generated_client_imports_bakes_and_downloads(generated: ModuleType, client: TestClient) -> None:
    from generated_client.types import File  # type: ignore[import-not-found]

    api = generated.Client(base_url="http://testserver")
    api.set_httpx_client(client)
    file = File(payload=OBJ, file_name="triangle.obj", mime_type="model/obj")
    sent = model("BodyImportScene")(scene=file)
    scene = call("scenes.import_scene", client=api, body=sent, idempotency_key="a-scene").parsed
    assert scene.name == "triangle"
    assert call("scenes.import_scene", client=api, body=sent, idempotency_key="a-scene").parsed.id == scene.id
    (listed,) = call("scenes.list_scenes", client=api, limit=5).parsed
    assert listed == scene

    asked = model("BakeRequest")(scene=scene.id, size=[160, 96], lights=10)
    bake = call("bakes.submit_bake", client=api, body=asked).parsed
    assert wait_until(client, f"/api/bakes/{bake.id}", lambda body: body["state"] == "ready")
    view = scene.views[0].name
    arguments = {"bake": bake.id, "view": view, "format_": model("RenderRequestFormat").PNG}
    asked = model("RenderRequest")(looks=[model("Look")()], **arguments)
    render = call("renders.submit_render", client=api, body=asked).parsed
    assert wait_until(client, f"/api/renders/{render.id}", lambda body: body["state"] == "ready")
    frame = call("renders.get_frame", client=api, render=render.id, index=0).parsed
    assert frame.payload.read(8) == b"\x89PNG\r\n\x1a\n"
    archive = call("renders.get_archive", client=api, render=render.id).parsed
    assert archive.payload.read(2) == b"PK"

    problem = call("renders.get_render", client=api, render="0123456789abcdef").parsed
    assert isinstance(problem, model("Problem"))
    assert problem.type_ == "urn:relume:problem:not-found"


def test_description_suits_people_and_generators(client: TestClient) -> None:
    document = client.get("/api/openapi.json").json()
    operations = [operation for path in document["paths"].values() for operation in path.values()]
    names = [operation["operationId"] for operation in operations]
    assert len(set(names)) == len(names)
    assert {"import_scene", "list_renders", "get_frame", "delete_camera"} <= set(names)
    assert set(document["components"]["securitySchemes"]) == {"token", "cookie"}
    text = json.dumps(document)
    assert text.count("RFC 9457") == 1
    assert text.count('"contentMediaType"') == text.count('"contentMediaType": "application/octet-stream"')
    for operation in operations:
        for status, response in operation["responses"].items():
            content = response.get("content", {})
            if status in ("4XX", "5XX"):
                assert content["application/problem+json"]["schema"] == {"$ref": "#/components/schemas/Problem"}
            elif status not in ("201", "204") or content:
                assert content, (operation["operationId"], status)
                assert all(content.values()), operation["operationId"]
