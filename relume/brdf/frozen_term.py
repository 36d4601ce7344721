"""Term documents as keys of caches."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class FrozenTerm:
    """A term of a complete look that is hashable: equal terms have equal values.

    Attributes:
        values: of all its fields. document: the term.
    """

    values: Hashable
    document: Mapping[str, Any] = field(compare=False, repr=False)

    @classmethod
    def from_document(cls, document: Mapping[str, Any], **replaced: Any) -> FrozenTerm:
        """Freeze a document. replaced: fields with other values, such as a white color"""
        frozen_document = {**document, **replaced}
        return cls(_hashable(frozen_document), frozen_document)


def _hashable(value: Any) -> Hashable:
    """Return JSON as nested tuples; the order of names does not matter."""
    if isinstance(value, dict):
        return tuple([(name, _hashable(value[name])) for name in sorted(value)])
    if isinstance(value, list | tuple):
        is_flat = not value or isinstance(value[0], float)  # most numbers are in curves: lists of numbers alone
        return tuple(value) if is_flat else tuple([_hashable(item) for item in value])
    scalar: Hashable = value
    return scalar
