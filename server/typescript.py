"""Writes the editor's types from the server's models: `python -m server.typescript [--check]`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from server import bodies, protocol

TARGET = Path(__file__).resolve().parent.parent / "client_web" / "src" / "protocol.gen.ts"
HEAD = "// Written by `python -m server.typescript` from the server's models. Do not edit.\n"

CLIENT_MESSAGES: tuple[type[BaseModel], ...] = (
    protocol.EditMessage,
    protocol.ViewMessage,
    protocol.ViewsMessage,
    protocol.FocusMessage,
    protocol.AckMessage,
    protocol.StreamMessage,
    protocol.ProbeMessage,
    protocol.BrushMessage,
    protocol.TouchMessage,
)
SERVER_MESSAGES: tuple[type[BaseModel], ...] = (
    protocol.HelloMessage,
    protocol.StatusMessage,
    protocol.ProblemMessage,
    protocol.ProbeAnswer,
    protocol.CurveMessage,
    protocol.BakeMessage,
)
INPUTS: tuple[type[BaseModel], ...] = (
    protocol.PatchOperation,
    *CLIENT_MESSAGES,
    bodies.BakeRequest,
    bodies.RenderRequest,
    bodies.TruthRequest,
    bodies.ShareRequest,
)
OUTPUTS: tuple[type[BaseModel], ...] = (
    protocol.Problem,
    *SERVER_MESSAGES,
    protocol.FrameHeader,
    bodies.SceneBody,
    bodies.BuiltInBody,
    bodies.ModelBody,
    bodies.MaterialBody,
    bodies.MaterialMapBody,
    bodies.EnvironmentBody,
    bodies.MeasuredBody,
    bodies.PlanBody,
    bodies.BakeBody,
    bodies.DryRunBody,
    bodies.RenderBody,
    bodies.TruthBody,
    bodies.TruthPlanBody,
    bodies.LookEntry,
    bodies.ShareEntry,
    bodies.ShareBody,
)


def generate() -> str:
    """The whole TypeScript file; the same models give the same text."""
    parts = [HEAD]
    for name in ("SUBPROTOCOL", "MAX_MESSAGE_BYTES", "MAX_FRAMES_IN_FLIGHT", "MAX_VIEWS_SHOWN"):
        value = getattr(protocol, name)
        parts.append(f"export const {name} = {_literal(value)};")
    for mode, models in (("validation", INPUTS), ("serialization", OUTPUTS)):
        _, schema = models_json_schema([(m, mode) for m in models], by_alias=True)  # type: ignore[misc]
        parts.extend(_interface(name, body, mode) for name, body in sorted(schema["$defs"].items()))
    parts = list(dict.fromkeys(parts))  # a part of inputs and outputs alike is written once
    parts.append(_union("ClientMessage", CLIENT_MESSAGES))
    parts.append(_union("ServerMessage", SERVER_MESSAGES))
    return "\n\n".join(parts) + "\n"


def _interface(name: str, schema: Mapping[str, Any], mode: str) -> str:
    """One model as an interface; an input's defaulted fields are optional, an output's are always there."""
    required = set(schema.get("required", ()))
    lines = [f"/** {' '.join(schema['description'].split())} */"] if "description" in schema else []
    lines.append(f"export interface {name} {{")
    for field, body in schema.get("properties", {}).items():
        optional = "?" if mode == "validation" and field not in required else ""
        lines.append(f"  {field}{optional}: {_type(body)};")
    if schema.get("additionalProperties") is True:
        lines.append("  [extra: string]: unknown;")
    return "\n".join([*lines, "}"])


def _type(schema: Mapping[str, Any]) -> str:
    """A JSON schema as a TypeScript type."""
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "const" in schema:
        return _literal(schema["const"])
    if "enum" in schema:
        return " | ".join(_literal(value) for value in schema["enum"])
    if "anyOf" in schema:
        return _join(_type(part) for part in schema["anyOf"])
    kind = schema.get("type")
    if kind == "array":
        if "prefixItems" in schema:
            return "[" + ", ".join(_type(part) for part in schema["prefixItems"]) + "]"
        item = _type(schema.get("items", {}))
        return f"({item})[]" if " | " in item else f"{item}[]"
    if kind == "object":
        values = schema.get("additionalProperties")
        return f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"
    plain = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
    return plain.get(str(kind), "unknown")


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def _join(parts: Iterable[str]) -> str:
    return " | ".join(dict.fromkeys(parts))


def _union(name: str, models: Iterable[type[BaseModel]]) -> str:
    return f"export type {name} =\n" + "\n".join(f"  | {m.__name__}" for m in models) + ";"


def main() -> int:
    """Write the file, or with --check say whether it is up to date."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when the file is stale")
    text = generate()
    if parser.parse_args().check:
        if TARGET.exists() and TARGET.read_text(encoding="utf-8") == text:
            return 0
        sys.stderr.write(f"{TARGET.name} is stale; run python -m server.typescript\n")
        return 1
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
