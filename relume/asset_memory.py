"""What is made of files that looks name (BTFs, images, measured materials, environments), in the one budgeted memory.

Such things are as many and as large as people make them, so no fixed number of them fits. A process that opens bakes
gives the memory that it opens them with; until then there is one of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from relume.memory import ASSETS, Key, Memory

_OWN_BYTES = 1 << 30

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")


class _Process:
    memory = Memory(_OWN_BYTES)


def use(memory: Memory) -> None:
    """Store in this memory from now on what is made of files that looks name."""
    _Process.memory = memory


def stored(kind: str) -> Callable[[Callable[Arguments, Value]], Callable[Arguments, Value]]:
    """Have what a function makes stored in the memory, by its arguments, while there is room for it.

    Args:
        kind: names it among all that is stored, e.g. "BTF"; one word for each function.
    """

    def decorate(make: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
        @wraps(make)
        def found(*args: Arguments.args, **named: Arguments.kwargs) -> Value:
            return _Process.memory.keep(_key(kind, args), lambda: make(*args, **named))

        return found

    return decorate


def keep(kind: str, key: tuple[object, ...], make: Callable[[], Value]) -> Value:
    """What `make` makes, stored under a key as `stored` does by arguments."""
    return _Process.memory.keep(_key(kind, key), make)


def is_stored(kind: str, *args: object) -> bool:
    """Whether what a function of that kind makes of these arguments is there now."""
    return _Process.memory.holds(_key(kind, args))


def _key(kind: str, args: tuple[object, ...]) -> Key:
    return (ASSETS, kind, *args)
