"""Differences between two looks as JSON Patch operations, which tell the members of a room about each other's edits."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import jsonpointer

Operation = dict[str, Any]


def diff_looks(before: Mapping[str, Any], after: Mapping[str, Any], excluded: Collection[str] = ()) -> list[Operation]:
    """Return the JSON Patch operations `add`, `remove` and `replace` that turn one look into another.

    Two lists of objects with the same length are compared object by object. Any other list is a single value, and so is
    each edited curve of a term: a drawn curve is always sent whole. Shared objects are skipped.

    Args:
        before: a look document. after: another. excluded: sections to ignore.
    """
    names = [name for name in {**before, **after} if name not in excluded]
    return list(_members((), before, after, names))


def _members(
    path: tuple[str, ...], before: Mapping[str, Any], after: Mapping[str, Any], names: Collection[str]
) -> Iterator[Operation]:
    for name in names:
        inner = (*path, name)
        if name not in after:
            yield {"op": "remove", "path": _pointer(inner)}
        elif name not in before:
            yield {"op": "add", "path": _pointer(inner), "value": after[name]}
        else:
            yield from _changes(inner, before[name], after[name])


def _changes(path: tuple[str, ...], before: Any, after: Any) -> Iterator[Operation]:
    if before is after:
        return
    is_curve = len(path) > 1 and path[-2] == "curves"
    if isinstance(before, Mapping) and isinstance(after, Mapping) and not is_curve:
        yield from _members(path, before, after, list({**before, **after}))
    elif _are_aligned_lists(before, after):
        for k, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from _changes((*path, str(k)), old, new)
    elif before != after:
        yield {"op": "replace", "path": _pointer(path), "value": after}


def _are_aligned_lists(before: Any, after: Any) -> bool:
    """True if both are lists of objects with the same length."""
    return (
        isinstance(before, list | tuple)
        and isinstance(after, list | tuple)
        and len(before) == len(after)
        and all(isinstance(item, Mapping) for item in (*before, *after))
    )


def _pointer(path: Sequence[str]) -> str:
    return str(jsonpointer.JsonPointer.from_parts(path).path)
