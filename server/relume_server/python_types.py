"""Write the types of the Python client from the server's models: bodies of OpenAPI, and session messages.

`python -m relume_server.python_types [--check]`.
"""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic.json_schema import models_json_schema

from relume_server.app import create_app
from relume_server.schemas import protocol
from relume_server.settings import Settings
from relume_server.typescript import SERVER_MESSAGES

TARGET = Path(__file__).resolve().parents[2] / "client" / "relume_client" / "bodies.py"
HEAD = '''"""Bodies of REST and messages of sessions, as `docs/api.md` describes them.

Written by `python -m relume_server.python_types` from the server's models. Do not edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, NotRequired, TypedDict
'''
BODIES = (
    "SceneBody",
    "BakeBody",
    "RenderBody",
    "LooksBody",
    "ModelBody",
    "Look",
    "LookEntry",
    "CameraFrame",
    "SolveBody",
)
OPTIONS: Mapping[str, tuple[str, frozenset[str]]] = {
    "ImportOptions": ("Body_import_scene", frozenset({"scene", "companions", "environment"})),
    "BakeOptions": ("BakeRequest", frozenset({"scene", "method", "dry_run"})),
    "RenderOptions": ("RenderRequest", frozenset({"bake", "looks", "view", "format", "dry_run"})),
    "SolveOptions": ("SolveRequest", frozenset({"bake", "look", "view", "reference"})),
}
"""Optional arguments of calls: the fields of a request, without those that the client fills in."""
RENAMED = {"Look": "LookDocument"}  # the client has a class of this name
CONSTANTS = "SUBPROTOCOL", "MAX_MESSAGE_BYTES"
INDENT = " " * 4
Schema = Mapping[str, Any]


def generate() -> str:
    """The module; deterministic."""
    schemas, messages = _components(), _messages()
    requests = {name: _options(schemas[request], omitted) for name, (request, omitted) in OPTIONS.items()}
    bodies = _with_references([*BODIES, *_references(list(requests.values()))], schemas)
    lines = [f"{name}: Final = {json.dumps(getattr(protocol, name))}" for name in CONSTANTS]
    blocks = [HEAD, "\n".join(lines) + "\n"]
    for name, schema in sorted({**bodies, **messages, **requests}.items()):
        blocks.append(_declaration(RENAMED.get(name, name), schema))
    return "\n\n\n".join(block.rstrip("\n") for block in blocks) + "\n"


@cache
def _components() -> Mapping[str, Schema]:
    components: Mapping[str, Schema] = create_app(Settings()).openapi()["components"]["schemas"]
    return components


def _messages() -> dict[str, Schema]:
    """Schemas of what a session sends, with all that they refer to."""
    models = (*SERVER_MESSAGES, protocol.FrameHeader)
    modes: list[tuple[Any, Literal["serialization"]]] = [(model, "serialization") for model in models]
    _, schema = models_json_schema(modes, by_alias=True)
    return {name: {**body, "required": list(body.get("properties", {}))} for name, body in schema["$defs"].items()}


def _options(request: Schema, omitted: frozenset[str]) -> Schema:
    properties = {name: field for name, field in request["properties"].items() if name not in omitted}
    return {"properties": properties, "description": "Optional fields of a request."}


def _with_references(names: Iterable[str], schemas: Mapping[str, Schema]) -> dict[str, Schema]:
    """The named schemas, and those that they refer to."""
    reachable, waiting = dict[str, Schema](), list(names)
    while waiting:
        name = waiting.pop()
        if name not in reachable:
            reachable[name] = schemas[name]
            waiting.extend(_references(schemas[name]))
    return reachable


def _references(schema: object) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(schema.get("$ref"), str):
            yield schema["$ref"].rsplit("/", 1)[-1]
        for inner in schema.values():
            yield from _references(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from _references(inner)


def _declaration(name: str, schema: Schema) -> str:
    """A TypedDict, or the union of an enum's values."""
    if "enum" in schema:
        return f"{name} = {py_type(schema)}"
    required = set(schema.get("required", ()))
    lines = [f"class {name}(TypedDict):"]
    if summary := str(schema.get("description", "")).split("\n\n")[0]:
        paragraph = f'"""{summary}"""'
        lines.append(
            textwrap.fill(paragraph, 120, initial_indent=INDENT, subsequent_indent=INDENT, break_on_hyphens=False)
            + "\n"
        )
    for field, body in schema.get("properties", {}).items():
        kind = py_type(body)
        lines.append(f"{INDENT}{field}: {kind if field in required else f'NotRequired[{kind}]'}")
    return "\n".join(lines)


def py_type(schema: Schema) -> str:
    """Write a JSON schema as a Python type; arrays are sequences, so that lists and tuples fit."""
    if "$ref" in schema:
        name = str(schema["$ref"]).rsplit("/", 1)[-1]
        return RENAMED.get(name, name)
    if "const" in schema or "enum" in schema:
        values = schema.get("enum", [schema.get("const")])
        return f"Literal[{', '.join(json.dumps(value) for value in values)}]"
    if members := schema.get("anyOf", schema.get("oneOf")):
        return " | ".join(dict.fromkeys(py_type(member) for member in members))
    kind = schema.get("type")
    if kind == "array":
        items = schema.get("prefixItems", [schema.get("items", {})])
        return f"Sequence[{' | '.join(dict.fromkeys(py_type(item) for item in items))}]"
    if kind == "object":
        values = schema.get("additionalProperties")
        return f"Mapping[str, {py_type(values) if isinstance(values, dict) else 'Any'}]"
    plain = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}
    return plain.get(str(kind), "Any")


def main() -> int:
    """Write the module; with --check, only compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="only check whether the file is current")
    text = generate()
    if not parser.parse_args().check:
        TARGET.write_text(text, encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != text:
        sys.stderr.write(f"{TARGET} is outdated: run python -m relume_server.python_types\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
