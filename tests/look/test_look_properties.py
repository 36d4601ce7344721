"""Round trips of random looks: JSON, patches and their inverses, rotations, keyframes."""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
from example_look import LIGHTS, MATERIALS
from for_all import for_all
from hypothesis import strategies as st
from random_looks import PARTIAL_LOOKS

from relume.look import apply_patch, complete, default_look, validate
from relume.look.difference import diff_looks
from relume.look.interpolate import interpolate_looks
from relume.look.patch import rebase
from relume.look.rotate import rotated_lights

DEFAULT = default_look(MATERIALS, LIGHTS)


def through_json(document: Any) -> Any:
    return json.loads(json.dumps(document, allow_nan=False))


@for_all(40, partial=PARTIAL_LOOKS)
def test_a_look_survives_json(partial: dict[str, Any]) -> None:
    given = copy.deepcopy(partial)
    look = complete(partial, DEFAULT)
    assert partial == given
    assert through_json(look) == look
    assert complete(through_json(look), DEFAULT) == look
    assert validate(through_json(look), DEFAULT) == validate(partial, DEFAULT)


@for_all(40, before=PARTIAL_LOOKS, after=PARTIAL_LOOKS)
def test_a_difference_is_applied_and_its_inverse_undoes_it(before: dict[str, Any], after: dict[str, Any]) -> None:
    start, end = complete(before, DEFAULT), complete(after, DEFAULT)
    originals = copy.deepcopy((start, end))
    edit, undo = through_json(diff_looks(start, end)), through_json(diff_looks(end, start))
    edited = apply_patch(start, edit, DEFAULT)
    assert edited == end
    assert apply_patch(edited, undo, DEFAULT) == start
    assert rebase(start, edit) == end
    assert diff_looks(edited, end) == []
    assert (start, end) == originals


@for_all(
    40, partial=PARTIAL_LOOKS, degrees=st.floats(-720, 720), center=st.lists(st.floats(-5, 5), min_size=3, max_size=3)
)
def test_a_rotation_is_undone_by_its_inverse(partial: dict[str, Any], degrees: float, center: list[float]) -> None:
    look = complete(partial, DEFAULT)
    rotated = rotated_lights(look, degrees, center)
    assert complete(rotated, DEFAULT) == rotated
    again = rotated_lights(rotated, -degrees, center)
    for name, light in look["lights"].items():
        for field, value in light.items():
            if field in ("position", "direction"):
                np.testing.assert_allclose(again["lights"][name][field], value, atol=1e-9)
            elif field == "rotation":
                assert_equal_angles(again["lights"][name][field], value)
            else:
                assert again["lights"][name][field] == value
    assert_equal_angles(again["environment"]["rotation"], look["environment"]["rotation"])


def assert_equal_angles(actual: float, expected: float) -> None:
    assert abs((actual - expected + 180) % 360 - 180) < 1e-9


@for_all(40, first=PARTIAL_LOOKS, last=PARTIAL_LOOKS, weight=st.floats(0.0, 1.0))
def test_looks_between_keyframes_are_valid(first: dict[str, Any], last: dict[str, Any], weight: float) -> None:
    keyframes = [complete(first, DEFAULT), complete(last, DEFAULT)]
    between = interpolate_looks(keyframes, weight)
    assert complete(between, DEFAULT) == between
    assert interpolate_looks(keyframes, 0.0) == keyframes[0]
    assert interpolate_looks(keyframes, 1.0) == keyframes[1]
