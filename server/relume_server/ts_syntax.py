"""Write models and values as TypeScript, for `relume_server.typescript`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel


def interface(name: str, schema: Mapping[str, Any], mode: str) -> str:
    """Write a model as an interface; defaulted fields are optional in inputs, and required in outputs.

    An enum is written as a union of its values.
    """
    required = set(schema.get("required", ()))
    lines = [f"/** {' '.join(schema['description'].split())} */"] if "description" in schema else []
    if "enum" in schema:
        return "\n".join([*lines, f"export type {name} = {ts_type(schema)};"])
    lines.append(f"export interface {name} {{")
    for field, body in schema.get("properties", {}).items():
        optional = "?" if mode == "validation" and field not in required else ""
        lines.append(f"  {field}{optional}: {ts_type(body)};")
    if schema.get("additionalProperties") is True:
        lines.append("  [extra: string]: unknown;")
    return "\n".join([*lines, "}"])


def ts_type(schema: Mapping[str, Any]) -> str:
    """Write a JSON schema as a TypeScript type."""
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "const" in schema:
        return literal(schema["const"])
    if "enum" in schema:
        return " | ".join(literal(value) for value in schema["enum"])
    if members := schema.get("anyOf", schema.get("oneOf")):
        return " | ".join(dict.fromkeys(ts_type(member) for member in members))
    kind = schema.get("type")
    if kind == "array":
        if "prefixItems" in schema:
            return "[" + ", ".join(ts_type(member) for member in schema["prefixItems"]) + "]"
        item = ts_type(schema.get("items", {}))
        return f"({item})[]" if " | " in item else f"{item}[]"
    if kind == "object":
        values = schema.get("additionalProperties")
        return f"Record<string, {ts_type(values) if isinstance(values, dict) else 'unknown'}>"
    plain = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
    return plain.get(str(kind), "unknown")


def literal(value: Any) -> str:
    """Write a JSON value as a TypeScript literal; whole numbers have no decimal point."""
    if isinstance(value, Mapping):
        fields = ", ".join(f"{name}: {literal(item)}" for name, item in value.items())
        return f"{{ {fields} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(literal(item) for item in value)}]"
    return f"{value:.15g}" if isinstance(value, float) else json.dumps(value)


def union(name: str, models: Iterable[type[BaseModel]]) -> str:
    """Write the union of these models."""
    return f"export type {name} =\n" + "\n".join(f"  | {m.__name__}" for m in models) + ";"
