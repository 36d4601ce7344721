"""The client's types are those of the server's models."""

from __future__ import annotations

import inspect
from typing import NotRequired, get_origin, get_type_hints

import pytest
from fastapi import FastAPI

from relume_client import bodies
from relume_server import python_types
from relume_server.app import create_app
from relume_server.schemas.protocol import FrameHeader, HelloMessage
from relume_server.settings import Settings


@pytest.fixture(scope="module")
def app() -> FastAPI:
    return create_app(Settings())


def test_generated_file_is_current() -> None:
    text = python_types.TARGET.read_text(encoding="utf-8")
    assert text == python_types.generate(), "run python -m relume_server.python_types"


@pytest.mark.parametrize("name", ["SceneBody", "BakeBody", "RenderBody", "LooksBody", "ModelBody", "SceneMaterial"])
def test_bodies_have_the_fields_of_the_document(app: FastAPI, name: str) -> None:
    schema = app.openapi()["components"]["schemas"][name]
    assert set(get_type_hints(getattr(bodies, name))) == set(schema["properties"])
    assert getattr(bodies, name).__required_keys__ == set(schema["required"])


def test_messages_have_the_fields_of_the_protocol() -> None:
    assert set(get_type_hints(bodies.HelloMessage)) == set(HelloMessage.model_fields)
    assert set(get_type_hints(bodies.FrameHeader)) == set(FrameHeader.model_fields)


def test_options_are_the_requests_without_what_the_client_fills_in(app: FastAPI) -> None:
    schemas = app.openapi()["components"]["schemas"]
    for name, (request, omitted) in python_types.OPTIONS.items():
        options = getattr(bodies, name)
        assert set(get_type_hints(options)) | omitted == set(schemas[request]["properties"])
        hints = get_type_hints(options, include_extras=True).values()
        assert all(get_origin(hint) is NotRequired for hint in hints)
    assert set(schemas["BakeRequest"]["required"]) == {"scene"}


@pytest.mark.parametrize(
    ("schema", "written"),
    [
        ({"type": "array", "prefixItems": [{"type": "integer"}, {"type": "integer"}]}, "Sequence[int]"),
        ({"anyOf": [{"$ref": "#/x/Look"}, {"type": "null"}]}, "LookDocument | None"),
        ({"enum": ["a", 1]}, 'Literal["a", 1]'),
        ({"type": "object", "additionalProperties": {"type": "number"}}, "Mapping[str, float]"),
        ({"type": "object"}, "Mapping[str, Any]"),
        ({}, "Any"),
    ],
)
def test_types_of_schemas(schema: dict[str, object], written: str) -> None:
    assert python_types.py_type(schema) == written


def test_both_clients_have_the_same_methods() -> None:
    import relume_client

    for name in ("Client", "Scene", "Bake", "Session"):
        sync, other = getattr(relume_client, name), getattr(relume_client, f"Async{name}")
        for method, function in inspect.getmembers(sync, inspect.isfunction):
            if not method.startswith("_"):
                parameters = inspect.signature(function).parameters
                assert parameters.keys() == inspect.signature(getattr(other, method)).parameters.keys(), method
