"""Turn pydantic's errors on bodies, queries and messages into relume's wording.

Each entry names the field by a JSON pointer, its value, and the allowed values. For a field with several forms pydantic
reports one error per form, with the form in the location; here they become one sentence on the field.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from relume.core.errors import count_text

MAX_FIELDS = 20
_MAX_VALUE_CHARS = 80
_QUOTED = re.compile(r"'((?:[^'\\]|\\.)*)'")
_Error = Mapping[str, Any]

_ALLOWED: Mapping[str, str] = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "an object",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a smaller number",
    "int_type": "a whole number",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "list_type": "a list",
    "model_attributes_type": "an object",
    "model_type": "an object",
    "string_too_long": "at most {max_length} characters",
    "string_too_short": "at least {min_length} characters",
    "string_type": "text",
    "too_long": "at most {max_length} entries",
    "too_short": "at least {min_length} entries",
    "tuple_type": "a list",
}
_PATTERNS = {
    "^[0-9a-f]{16}$": "its id, 16 hexadecimal digits",
    "^[a-z2-7]+$": "the id of a link",
    "^/": "a JSON pointer, which begins with /",
}
_LISTS = {"size": "[width, height] in pixels", "to_world": "16 numbers, row by row", "pivot": "[x, y, z] in meters"}


class _LocatedError(NamedTuple):
    """An error, the part of the request, the path in it, and whether it belongs to one of several forms."""

    location: str
    path: tuple[str | int, ...]
    is_union_branch: bool
    error: _Error


def list_field_errors(errors: Sequence[_Error], document: object, *, is_message: bool = False) -> list[dict[str, str]]:
    """Return one entry per invalid field: `pointer` into the body, or `parameter` of query, path or headers, and
    `detail`.

    Args:
        errors: pydantic's errors. document: the parsed body or message. is_message: true for a session message.
    """
    fields: dict[tuple[str, tuple[str | int, ...]], list[_Error]] = defaultdict(list)
    located = [_locate_error(error, document, is_message) for error in errors]
    for error_entry in located:
        is_superseded = error_entry.is_union_branch and any(
            deeper.location == error_entry.location
            and len(deeper.path) > len(error_entry.path)
            and deeper.path[: len(error_entry.path)] == error_entry.path
            for deeper in located
        )
        if not is_superseded:  # another form was meant, whose error is deeper
            fields[error_entry.location, error_entry.path].append(error_entry.error)
    return [
        _describe_field(location, path, field_errors)
        for (location, path), field_errors in list(fields.items())[:MAX_FIELDS]
    ]


def _locate_error(error: _Error, document: object, is_message: bool) -> _LocatedError:
    path = tuple(error["loc"])
    location = "message" if is_message else str(path[0]) if path else "body"
    path = path if is_message else path[1:]
    if error["type"] == "json_invalid":
        return _LocatedError(location, (), False, error)
    if location not in ("body", "message"):
        return _LocatedError(location, path, False, error)
    is_absent = error["type"] in ("missing", "extra_forbidden", "union_tag_not_found")
    existing_path = _existing_path(
        path,
        document if is_message or not hasattr(document, "multi_items") else dict(document),  # type: ignore[call-overload]
        is_absent,
    )
    if error["type"].startswith("union_tag") and (name := _QUOTED.search(error["ctx"]["discriminator"])):
        existing_path = (*existing_path, name[1])
    return _LocatedError(location, existing_path, len(existing_path) < len(path), error)


def _existing_path(path: Sequence[str | int], value: object, is_absent: bool) -> tuple[str | int, ...]:
    """The longest existing path; a step that is not a field names one of several forms."""
    if not path:
        return ()
    first, remaining = path[0], path[1:]
    without = _existing_path(remaining, value, is_absent)
    is_entry = isinstance(value, list | tuple) and isinstance(first, int) and first < len(value)
    if is_entry or (isinstance(value, Mapping) and first in value):
        inner = value[first]  # type: ignore[index]
    elif not remaining and is_absent and isinstance(value, Mapping):
        return (first,)
    else:
        return without
    within = (first, *_existing_path(remaining, inner, is_absent))
    return within if len(within) >= len(without) else without


def _describe_field(location: str, path: tuple[str | int, ...], errors: Sequence[_Error]) -> dict[str, str]:
    if location in ("body", "message"):
        pointer = "".join("/" + str(step).replace("~", "~0").replace("/", "~1") for step in path)
        return {"pointer": pointer, "detail": _sentence(pointer or f"the {location}", path, errors)}
    name = str(path[0]) if path else location
    return {"parameter": name, "detail": _sentence(name, path, errors)}


def _sentence(name: str, path: Sequence[str | int], errors: Sequence[_Error]) -> str:
    first = errors[0]
    if first["type"] == "json_invalid":
        reason = first.get("ctx", {}).get("error", "")
        at = f", character {first['loc'][-1]}" if first["loc"] and isinstance(first["loc"][-1], int) else ""
        return f"{name} is not JSON ({reason}{at}); send JSON"
    if first["type"] in ("missing", "union_tag_not_found"):
        return f"{name} is missing; add it" if path else f"{name} is missing; send JSON"
    if first["type"] == "extra_forbidden":
        return f"{name} is unknown; remove it"
    if first["type"].startswith("model_") and not path:
        return f"{name} is not a JSON object; send one with Content-Type: application/json"
    if first["type"] in ("value_error", "assertion_error"):
        return _describe_validator_error(
            name, str(first["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
        )
    return f"{name} is {format_value(first['input'])}; give {describe_allowed(path, errors)}"


def _describe_validator_error(name: str, message: str) -> str:
    if message.startswith("Expected UploadFile"):
        return f"{name} is text; give a file, with a file name in its part of the form"
    return f"{name}: {message[:300]}"


def describe_allowed(path: Sequence[str | int], errors: Sequence[_Error]) -> str:
    """Describe the values that all forms of a field allow together."""
    choices = [choice for error in errors for choice in _choices(error)]
    descriptions = [_allowed_by(error, path) for error in errors if not _choices(error)]
    alternatives = [_join_alternatives([f"'{choice}'" for choice in dict.fromkeys(choices)])] if choices else []
    return ", or ".join(dict.fromkeys([*alternatives, *descriptions]))


def _choices(error: _Error) -> list[str]:
    context = error.get("ctx", {})
    context_key = {"literal_error": "expected", "enum": "expected", "union_tag_invalid": "expected_tags"}.get(
        error["type"]
    )
    return _QUOTED.findall(str(context[context_key])) if context_key in context else []


def _allowed_by(error: _Error, path: Sequence[str | int]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in ("tuple_type", "list_type", "too_short", "too_long") and path and path[-1] in _LISTS:
        return _LISTS[str(path[-1])]
    if kind == "string_pattern_mismatch":
        return _PATTERNS.get(context["pattern"], f"text of the form {context['pattern']}")
    if kind in _ALLOWED:
        text = _ALLOWED[kind].format(**{name: _plain(value) for name, value in context.items()})
        return re.sub(r"\b1 entries", "1 entry", text)
    message = str(error["msg"])
    return message.removeprefix("Input should be ").removeprefix("Value error, ")[:200]


def _plain(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _join_alternatives(alternatives: Sequence[str]) -> str:
    return (
        " or ".join([", ".join(alternatives[:-1]), alternatives[-1]])
        if len(alternatives) > 1
        else "".join(alternatives)
    )


def format_value(value: object) -> str:
    """Format a value for a sentence, at most 80 characters."""
    if isinstance(value, str):
        text = repr(value[: 2 * _MAX_VALUE_CHARS])
    elif value is None or isinstance(value, bool | int | float):
        text = json.dumps(value)
    elif isinstance(value, Mapping | list | tuple):
        text = "an object" if isinstance(value, Mapping) else f"a list of {count_text(len(value), 'entry', 'entries')}"
    else:
        text = "a file" if hasattr(value, "filename") else "of another type"
    return text if len(text) <= _MAX_VALUE_CHARS else text[: _MAX_VALUE_CHARS - 3] + "..."
