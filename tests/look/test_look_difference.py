"""Differences of looks as JSON Patches."""

from __future__ import annotations

import copy
from typing import Any

import jsonpatch
from hypothesis import given
from hypothesis import strategies as st

from relume.look.difference import diff_looks

LEAVES = st.one_of(st.none(), st.booleans(), st.integers(-3, 3), st.text("a/~", max_size=2))
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.sampled_from(["a", "b/c", "~", "curves"]), inner, max_size=3),
    ),
    max_leaves=12,
)
DOCUMENTS = st.dictionaries(st.sampled_from(["materials", "lights", "display"]), VALUES, max_size=3)


@given(DOCUMENTS, DOCUMENTS)
def test_a_difference_turns_one_look_into_another(before: dict[str, Any], after: dict[str, Any]) -> None:
    originals = copy.deepcopy((before, after))
    assert jsonpatch.apply_patch(before, diff_looks(before, after)) == after
    assert (before, after) == originals


@given(DOCUMENTS)
def test_equal_looks_have_no_difference(document: dict[str, Any]) -> None:
    assert diff_looks(document, copy.deepcopy(document)) == []


def test_paths_are_as_deep_as_possible_and_curves_are_replaced_whole() -> None:
    points = {"theta_h": {"points": [[0, 1], [90, 0]]}}
    term: dict[str, Any] = {"params": {"sigma": 0.2, "ior": 1.5}, "color": [1, 1, 1], "curves": points}
    before = {"materials": {"a/b": {"terms": [term, term]}}, "display": {"exposure": 0}}
    drawn = {**term, "params": {"sigma": 0.3, "ior": 1.5}, "curves": {"theta_h": {"bands": [1, 2]}}}
    after = {"materials": {"a/b": {"terms": [term, drawn]}}, "display": {"exposure": 1}}
    at = "/materials/a~1b/terms/1"
    assert diff_looks(before, after, excluded=["display"]) == [
        {"op": "replace", "path": f"{at}/params/sigma", "value": 0.3},
        {"op": "replace", "path": f"{at}/curves/theta_h", "value": {"bands": [1, 2]}},
    ]
    assert diff_looks(before, {**after, "materials": {"a/b": {"terms": [term]}}}, excluded=["display"]) == [
        {"op": "replace", "path": "/materials/a~1b/terms", "value": [term]}
    ]
