"""Checks of single values in a document from outside. Each raises ParameterError with a JSON pointer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from relume.core.errors import ParameterError

Pointer = tuple[str | int, ...]
MAX_COLOR = 1e4


def pointer_text(pointer: Pointer) -> str:
    """RFC 6901, each token cut at 80 characters: names may come from anybody."""
    return "".join("/" + str(token)[:80].replace("~", "~0").replace("/", "~1") for token in pointer) or "the look"


def invalid_value(pointer: Pointer, value: object, allowed: str) -> ParameterError:
    """The error to raise for a value that a document must not have.

    Args:
        pointer: where in the document it stands. value: what stands there, of any size.
        allowed: what may stand there, as the end of a sentence.
    """
    if isinstance(value, dict | list | tuple):
        value = f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"  # its text could be huge
    elif isinstance(value, int) and value.bit_length() > 64:
        value = "an integer beyond 64 bits"  # too long to be printed
    return ParameterError(pointer_text(pointer), value, allowed)


def names_text(names: Iterable[str]) -> str:
    """A list of names for a message, cut where it would be long."""
    ordered = sorted(names)
    text = ", ".join(repr(name[:40]) for name in ordered[:12])
    return text + (f" and {len(ordered) - 12} more" if len(ordered) > 12 else "") if ordered else "nothing"


def is_number(value: object) -> bool:
    """Whether a value is a number; booleans, which Python counts among them, are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def check_number(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    """Refuse what is no number in [minimum, maximum]; comparing refuses NaN and infinities too.

    Args:
        pointer: where in the document the value stands. value: of any type.
        minimum, maximum: both allowed.
    Raises:
        ParameterError: it is none.
    """
    if not is_number(value) or not minimum <= value <= maximum:
        raise invalid_value(pointer, value, f"a number in [{minimum:g}, {maximum:g}]")


def check_number_or_rgb(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    """Refuse what is neither one number nor one for each of R, G, B.

    Args:
        pointer: where in the document the value stands. value: of any type.
        minimum, maximum: of each number, both allowed.
    Raises:
        ParameterError: it is neither.
    """
    if is_number(value):
        check_number(pointer, value, minimum, maximum)
    else:
        check_triple(pointer, value, minimum, maximum, "a number or three numbers")


def check_triple(pointer: Pointer, value: Any, minimum: float, maximum: float, label: str = "three numbers") -> None:
    """Refuse what is not three numbers in [minimum, maximum].

    Args:
        pointer: where in the document the value stands. value: of any type.
        minimum, maximum: of each number, both allowed.
        label: how the message calls what is allowed.
    Raises:
        ParameterError: it is not.
    """
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise invalid_value(pointer, value, f"{label} in [{minimum:g}, {maximum:g}]")
    for k, channel in enumerate(value):
        check_number((*pointer, k), channel, minimum, maximum)


def check_object(pointer: Pointer, value: Any, allowed: Iterable[str]) -> None:
    """Refuse what is no object, or has other fields than those allowed.

    Args:
        pointer: where in the document the value stands. value: of any type.
        allowed: names of fields.
    Raises:
        ParameterError: it is none, or has others.
    """
    if not isinstance(value, Mapping):
        raise invalid_value(pointer, value, "an object")
    unknown = value.keys() - set(allowed)
    if unknown:
        name = min(unknown, key=str)
        raise invalid_value((*pointer, name), "unknown", f"one of {names_text(allowed)}, or leave it out")
