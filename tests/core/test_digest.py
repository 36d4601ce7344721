"""Digests name stored results: they depend on content alone, and are the same everywhere."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pytest

from relume.core.digest import digest


class Pair(NamedTuple):
    first: int
    second: float


@dataclass(frozen=True)
class Named:
    name: str
    size: int = field(compare=False)


def test_equal_values_have_equal_digests():
    assert digest((1, 2.5)) == digest([1, np.float64(2.5)]) == digest(Pair(1, 2.5))
    assert digest({"a": 1, "b": None}) == digest({"b": None, "a": np.int64(1)})
    assert digest(Named("x", 1)) == digest(Named("x", 2))


def test_different_values_have_different_digests():
    values = [
        None, False, 0, 0.0, "", b"", (), {}, "0", b"0", 1, 1.0, True, "1", ("1",), ("1", ""), ("", "1"), (("1",),),
        ("ab", "c"), ("a", "bc"), ("a,b",), ("a", "b"), Named("x", 1), ("Named", "x"),
    ]  # fmt: skip
    assert len({digest(value) for value in values}) == len(values)


def test_digests_are_the_same_in_all_versions():
    assert digest((None, "lambert", 0.1, b"\x00", {"θ": [1, True]})) == "efcc632c1dfd8cbb8c164ad723b7aed9"


def test_sets_have_no_digest():
    """Their order differs between processes."""
    with pytest.raises(TypeError, match="frozenset has no digest"):
        digest(("a", frozenset({"b"})))
