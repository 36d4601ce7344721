"""Complete the OpenAPI description for client generators: binary files, `Problem`, security schemes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from relume.look import Look
from relume_server.auth.identity import COOKIE
from relume_server.auth.rules import is_change
from relume_server.idempotency import HEADER
from relume_server.schemas.protocol import Problem

LOOK = "#/components/schemas/Look"
_BINARY = {"type": "string", "format": "binary"}
_SCHEMES = {
    "token": {"type": "http", "scheme": "bearer", "description": "access token, if the server requires login"},
    "cookie": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "set by POST /api/login"},
}
_WITH_LOOKS = (
    "LooksBody", "LooksRequest", "RenderRequest", "ShareBody", "ShareRequest", "ComparisonRequest", "ExportRequest",
)  # fmt: skip
_KEY_PARAMETER = {
    "name": HEADER,
    "in": "header",
    "required": False,
    "description": "a repeated call with the same key has no further effect, and gets the same response for a day",
    "schema": {"type": "string", "minLength": 1, "maxLength": 200},
}


def files(*media_types: str) -> dict[int | str, dict[str, Any]]:
    """OpenAPI responses of a route that returns files of these media types."""
    return {200: {"description": "The file", "content": {each: {"schema": _BINARY} for each in media_types}}}


def install(app: FastAPI) -> None:
    """Install the description in the app."""

    def describe() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _description(app)
        return app.openapi_schema

    app.openapi = describe  # type: ignore[method-assign]


def _description(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, summary=app.summary, routes=app.routes)
    components = document["components"]
    schemas = {**_looks(), "Problem": Problem.model_json_schema()}
    components["schemas"] = dict(sorted({**schemas, **components["schemas"]}.items()))
    components["securitySchemes"] = _SCHEMES
    document["security"] = [{"token": []}, {"cookie": []}, {}]
    for path, method, operation in _operations(document):
        if method == "post" and is_change("POST", path):
            operation.setdefault("parameters", []).append(_KEY_PARAMETER)
        for response in operation["responses"].values():
            for media_type, content in response.get("content", {}).items():
                if media_type.startswith(("image/", "video/")) or media_type == "application/octet-stream":
                    content["schema"] = _BINARY
    _name_binary(components["schemas"])
    for body in _WITH_LOOKS:
        _refer_to_look(components["schemas"][body]["properties"])
    return document


def _looks() -> dict[str, Any]:
    """Schemas of a look and its parts. Nothing is required, because looks in requests may be partial."""
    look = Look.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas = {**look.pop("$defs"), "Look": look}
    for schema in schemas.values():
        schema.pop("required", None)
    return schemas


def _refer_to_look(properties: dict[str, Any]) -> None:
    if "looks" in properties:
        properties["looks"]["items"] = {"$ref": LOOK}
    if "look" in properties:
        properties["look"] = {"$ref": LOOK}


def _operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield path, method, operation


def _name_binary(schema: object) -> None:
    """Add `format: binary` to files in forms, which most generators need in addition to `contentMediaType`."""
    if isinstance(schema, dict):
        if schema.get("contentMediaType") == "application/octet-stream":
            schema["format"] = "binary"
        for inner in schema.values():
            _name_binary(inner)
    elif isinstance(schema, list):
        for inner in schema:
            _name_binary(inner)
