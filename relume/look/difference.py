"""What has become of a look, path by path: how edits of several people are told to each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import jsonpointer

Operation = dict[str, Any]


def diff_looks(before: Mapping[str, Any], after: Mapping[str, Any], excluded: Collection[str] = ()) -> list[Operation]:
    """The operations `add`, `remove` and `replace` of a JSON Patch that lead from a look to another.

    Lists of objects of one length are compared object by object; any other list is one value, as is each edited curve
    of a term: half of a drawn curve never travels alone. Parts that both share are not looked into.

    Args:
        before: a look document. after: another. excluded: sections that are left out.
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
    """Whether both are lists of as many objects."""
    return (
        isinstance(before, list | tuple)
        and isinstance(after, list | tuple)
        and len(before) == len(after)
        and all(isinstance(item, Mapping) for item in (*before, *after))
    )


def _pointer(path: Sequence[str]) -> str:
    return str(jsonpointer.JsonPointer.from_parts(path).path)
