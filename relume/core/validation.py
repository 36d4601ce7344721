"""Checks of single values in an external document. Each raises ParameterError with a JSON pointer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from relume.core.errors import Description, ParameterError, count_text

Pointer = tuple[str | int, ...]
MAX_COLOR = 1e4


def pointer_text(pointer: Pointer) -> str:
    """Format a JSON pointer (RFC 6901), each token cut at 80 characters: names may come from any user."""
    return "".join("/" + str(token)[:80].replace("~", "~0").replace("/", "~1") for token in pointer) or "the look"


def invalid_value(pointer: Pointer, value: object, allowed: str) -> ParameterError:
    """Make the error for a value that a document must not have.

    Args:
        pointer: location in the document. value: the value there, of any size.
        allowed: the allowed values, as the end of a sentence.
    """
    if isinstance(value, dict | list | tuple):
        kind = "an object" if isinstance(value, dict) else "a list"
        value = Description(f"{kind} of {count_text(len(value), 'entry', 'entries')}")  # its text could be huge
    elif value is None:
        value = Description("null")
    elif isinstance(value, int) and value.bit_length() > 64:
        value = Description("an integer beyond 64 bits")  # too long to be printed
    return ParameterError(pointer_text(pointer), value, allowed)


def names_text(names: Iterable[str]) -> str:
    """Format names as a list for a message; long lists and names are cut."""
    ordered = sorted(names)
    text = ", ".join(repr(name[:40]) for name in ordered[:12])
    return text + (f" and {len(ordered) - 12} more" if len(ordered) > 12 else "") if ordered else "nothing"


def is_number(value: object) -> bool:
    """True if a value is a number; booleans, which Python counts as numbers, are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def check_number(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    """Reject anything but a number in [minimum, maximum], NaN and infinities included.

    Args:
        pointer: location in the document. value: value of any type.
        minimum, maximum: inclusive bounds.
    Raises:
        ParameterError: the value is not allowed.
    """
    if not is_number(value) or not minimum <= value <= maximum:
        raise invalid_value(pointer, value, f"a number in [{minimum:g}, {maximum:g}]")


def check_number_or_rgb(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    """Reject anything but one number or three numbers for R, G, B.

    Args:
        pointer: location in the document. value: value of any type.
        minimum, maximum: inclusive bounds of each number.
    Raises:
        ParameterError: the value is not allowed.
    """
    if is_number(value):
        check_number(pointer, value, minimum, maximum)
    else:
        check_triple(pointer, value, minimum, maximum, "a number or three numbers")


def check_triple(pointer: Pointer, value: Any, minimum: float, maximum: float, label: str = "three numbers") -> None:
    """Reject anything but three numbers in [minimum, maximum].

    Args:
        pointer: location in the document. value: value of any type.
        minimum, maximum: inclusive bounds of each number.
        label: name of the allowed values in the message.
    Raises:
        ParameterError: the value is not allowed.
    """
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise invalid_value(pointer, value, f"{label} in [{minimum:g}, {maximum:g}]")
    for k, channel in enumerate(value):
        check_number((*pointer, k), channel, minimum, maximum)


def check_object(pointer: Pointer, value: Any, allowed: Iterable[str]) -> None:
    """Reject anything but an object with fields from `allowed`.

    Args:
        pointer: location in the document. value: value of any type.
        allowed: names of fields.
    Raises:
        ParameterError: the value is not an object, or has an unknown field.
    """
    if not isinstance(value, Mapping):
        raise invalid_value(pointer, value, "an object")
    unknown = value.keys() - set(allowed)
    if unknown:
        name = min(unknown, key=str)
        raise invalid_value((*pointer, name), Description("unknown"), f"one of {names_text(allowed)}, or leave it out")
