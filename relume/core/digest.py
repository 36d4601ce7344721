"""Digests of values, to name stored results: unlike `hash` and `repr`, the same in all processes and versions."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from typing import Any


def digest(value: Any) -> str:
    """Digest of a value by its content. 32 hexadecimal digits

    Args:
        value: nested sequences, mappings and dataclasses of numbers, strings and bytes. Fields of a dataclass count if
            they are compared.
    Raises:
        TypeError: it contains anything else.
    """
    return hashlib.sha256(_text(value).encode()).hexdigest()[:32]


def _text(value: Any) -> str:
    """Write a value; different values give different texts."""
    if value is None or isinstance(value, bool | str | bytes):
        return ascii(value)
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return float(value).hex()
    if isinstance(value, tuple | list):
        return f"({','.join(map(_text, value))})"
    if isinstance(value, Mapping):
        return f"{{{','.join(map(_text, sorted(value.items())))}}}"
    if is_dataclass(value):
        return type(value).__name__ + _text([getattr(value, field.name) for field in fields(value) if field.compare])
    raise TypeError(f"{type(value).__name__} has no digest")
