"""Patches of looks: applied completely or not at all."""

from __future__ import annotations

import copy
import json

import jsonpatch
import pytest
from example_look import CURVES, LIGHTS, MATERIALS, NAN, SIGMA, replace
from hypothesis import given, settings
from hypothesis import strategies as st

from relume.core.errors import EditError, ParameterError
from relume.look import apply_patch, complete, default_look


def nested(depth):
    value = 1
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize(
    "patch",
    [
        None,
        {"op": "replace"},
        "replace",
        [None],
        ["replace"],
        [{}],
        [{"op": "move", "from": "/display", "path": "/x"}],
        [{"op": "copy", "from": "/display", "path": "/x"}],
        [{"op": "replace", "value": 1}],
        [{"op": "replace", "path": SIGMA}],
        [{"op": "replace", "path": 3, "value": 1}],
        [{"op": "replace", "path": "materials", "value": 1}],
        [{"op": "replace", "path": "/x" * 600, "value": 1}],
        [{"op": "replace", "path": "/a~2", "value": 1}],
        [{"op": ["replace"], "path": SIGMA, "value": 1}],
        replace("/materials/Cup/terms/0", {}),
        replace("/materials/Teapot/terms/7", {"model": "lambert"}),
        replace("/materials/Teapot/terms/x", {"model": "lambert"}),
        replace("/materials/Teapot/terms/-1/color", [1, 1, 1]),
        replace("/materials/Teapot/terms/٣/color", [1, 1, 1]),
        replace(SIGMA + "/0", 1),
        replace("/materials/Teapot/terms/0/model/0", "x"),
        replace(SIGMA, nested(20_000)),
        [{"op": "add", "path": "/materials/Teapot/terms/9", "value": {"model": "lambert"}}],
        [{"op": "remove", "path": "/lights/Moon"}],
        [{"op": "remove", "path": ""}],
        [{"op": "test", "path": SIGMA, "value": 0.7}],
        [{"op": "test", "path": "/nowhere", "value": 0.7}],
        replace(SIGMA, 0.3) * 257,
    ],
)
def test_an_invalid_patch_is_rejected_and_nothing_changes(default, patch):
    before = copy.deepcopy(default)
    with pytest.raises(EditError) as raised:
        apply_patch(default, patch, default)
    assert len(str(raised.value)) < 600
    assert default == before


def test_patch_with_one_bad_operation_changes_nothing(default):
    before = copy.deepcopy(default)
    with pytest.raises(EditError):
        apply_patch(default, [*replace(SIGMA, 0.3), {"op": "remove", "path": "/nothing"}], default)
    assert default == before


def test_a_patch_shares_unchanged_parts(default):
    edited = apply_patch(default, replace(SIGMA, 0.31), default)
    assert edited["materials"]["Teapot"]["terms"][1]["params"]["sigma"] == 0.31
    assert default["materials"]["Teapot"]["terms"][1]["params"]["sigma"] == 0.2
    assert edited["materials"]["a/b~c"] is default["materials"]["a/b~c"]
    assert edited["materials"]["Teapot"]["terms"][0] is default["materials"]["Teapot"]["terms"][0]


def test_patch_may_build_on_its_own_operations_without_touching_its_values(default):
    curve = {"points": [[0, 1], [90, 0]]}
    patch = [
        {"op": "add", "path": f"{CURVES}/theta_h", "value": curve},
        {"op": "add", "path": f"{CURVES}/theta_h/points/1", "value": [45, 0.5]},
        {"op": "test", "path": f"{CURVES}/theta_h/points/1/0", "value": 45},
        {"op": "replace", "path": f"{CURVES}/theta_h/points/0/1", "value": 3},
    ]
    outgoing = copy.deepcopy(patch)
    edited = apply_patch(default, patch, default)
    assert edited["materials"]["Teapot"]["terms"][1]["curves"]["theta_h"]["points"] == [[0, 3], [45, 0.5], [90, 0]]
    assert patch == outgoing


def test_removed_values_return_to_the_default(default):
    edited = apply_patch(default, [*replace(SIGMA, 0.7), *replace("/display/exposure", 3)], default)
    assert edited != default
    for path in (SIGMA, "/display", "/materials/Teapot"):
        edited = apply_patch(edited, [{"op": "remove", "path": path}], default)
    assert edited == default


def test_empty_path_replaces_the_whole_look(default):
    edited = apply_patch(default, replace("/display/exposure", 3), default)
    assert apply_patch(edited, replace("", {}), default) == default
    whole = apply_patch(default, replace("", {"environment": {"intensity": 2}}), default)
    assert whole["environment"] == default["environment"] | {"intensity": 2}


def test_term_may_be_added_moved_down_and_changed_in_model(default):
    ggx = {"model": "ggx", "color": [1, 0, 0]}
    edited = apply_patch(default, [{"op": "add", "path": "/materials/Teapot/terms/0", "value": ggx}], default)
    terms = edited["materials"]["Teapot"]["terms"]
    assert [t["model"] for t in terms] == ["ggx", "lambert", "cook_torrance"]
    assert terms[0]["params"] == {"roughness": 0.4, "f0": 0.04}
    blinn = apply_patch(edited, replace("/materials/Teapot/terms/2", {"model": "blinn_phong"}), default)
    assert blinn["materials"]["Teapot"]["terms"][2]["params"] == {"exponent": 50.0}


def test_curves_are_checked_again_for_another_model(default):
    bands = replace("/materials/a~1b~0c/terms/0/curves", {"theta_i": {"bands": [1.0] * 64}})
    edited = apply_patch(default, bands, default)
    with pytest.raises(ParameterError, match="theta_i"):
        apply_patch(
            edited,
            [
                *replace("/materials/a~1b~0c/terms/0/model", "blinn_phong"),
                {"op": "remove", "path": "/materials/a~1b~0c/terms/0/params"},
            ],
            default,
        )


NUMBERS = st.one_of(st.floats(0.02, 0.9), st.integers(0, 2), st.just(NAN), st.booleans(), st.none())


OPERATIONS = st.builds(
    lambda op, path, value: {"op": op, "path": path, "value": value},
    st.sampled_from(["add", "replace", "remove", "test"]),
    st.sampled_from(
        [
            SIGMA,
            CURVES,
            "/materials/Teapot/terms/0",
            "/materials/Teapot/terms/-",
            "/materials/Teapot/terms/1/color",
            "/display/exposure",
            "/environment",
            "/lights/Key/enabled",
            "/lights/Lamp",
            "/lights/Lamp/cone",
            "/lights/Lamp/intensity",
            f"{CURVES}/theta_d",
            "",
        ]
    ),
    st.one_of(
        NUMBERS,
        st.lists(NUMBERS, min_size=3, max_size=3),
        st.just({}),
        st.just({"model": "ggx"}),
        st.just({"kind": "spot"}),
        st.just({"kind": "rectangle", "rotation": 30}),
        st.builds(lambda a, b: {"points": [[0, a], [b, 1.0]]}, NUMBERS, st.floats(0, 100)),
    ),
)


@settings(max_examples=300)
@given(st.lists(st.lists(OPERATIONS, max_size=4), max_size=5))
def test_patches_in_a_row_equal_plain_json_patch_and_whole_checking(patches):
    default = default_look(MATERIALS, LIGHTS)
    before = copy.deepcopy(default)
    document = default
    for patch in patches:
        try:
            edited = apply_patch(document, patch, default)
        except (EditError, ParameterError):
            continue
        assert edited == complete(jsonpatch.apply_patch(document, patch), default)
        assert edited == complete(json.loads(json.dumps(edited)), default)
        document = edited
    assert default == before
