"""Completing and checking looks, and patching them; inputs as they come from anybody."""

from __future__ import annotations

import copy
import json
import math

import jsonpatch
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from relume.errors import EditError, ParameterError
from relume.look import Look, apply_patch, complete, default_look, validate
from relume.scene.model import Light, Material

MATERIALS = [
    Material("Teapot", ({"model": "lambert", "color": [0.1, 0.02, 0.02]}, {"model": "cook_torrance"})),
    Material("a/b~c", ({"model": "ggx", "color": [1, 1, 1], "texture": None, "params": {"f0": [1, 0.8, 0.3]}},)),
]
KEY = Light("Key", {"kind": "spot", "position": [1.0, 2.0, 3.0]})
PANEL = Light("Panel", {"kind": "mesh", "material": "Teapot", "emission": [5.0, 5.0, 4.0]})
LIGHTS = [KEY, PANEL]
NAN, INF = math.nan, math.inf
SIGMA = "/materials/Teapot/terms/1/params/sigma"
CURVES = "/materials/Teapot/terms/1/curves"


@pytest.fixture
def default():
    return default_look(MATERIALS, LIGHTS)


def replace(path, value):
    return [{"op": "replace", "path": path, "value": value}]


def test_default_look_has_every_field(default):
    assert default["materials"]["Teapot"]["terms"][1] == {
        "model": "cook_torrance",
        "color": [1.0, 1.0, 1.0],
        "texture": "specular",
        "params": {"sigma": 0.2, "ior": 1.5, "extinction": 0.0},
        "curves": {},
    }
    assert default["materials"]["a/b~c"]["terms"][0]["texture"] is None
    assert default["environment"] == {"map": None, "scale": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0}
    plain = {"scale": 1.0, "color": [1.0, 1.0, 1.0], "on": True}
    spot = {"kind": "spot", "position": [1.0, 2.0, 3.0], "direction": [0.0, -1.0, 0.0], "cone": [20.0, 30.0]}
    panel = {"kind": "mesh", "material": "Teapot", "emission": [5.0, 5.0, 4.0]}
    assert default["lights"] == {"Key": {**plain, **spot, "emission": [1.0, 1.0, 1.0]}, "Panel": {**plain, **panel}}
    assert default["transport"] == {"show": "all", "bounces": 24}
    assert default["display"] == {"exposure": 0.0, "tone_map": "agx"}
    assert json.loads(json.dumps(default)) == default
    assert complete(default, default) == default


def test_partial_look_keeps_what_it_does_not_name(default):
    partial = {
        "materials": {"Teapot": {"terms": [{"model": "lambert", "color": [0, 1, 0]}]}},
        "lights": {"Key": {"on": False}},
        "display": {"exposure": 2},
    }
    full = complete(partial, default)
    assert [t["model"] for t in full["materials"]["Teapot"]["terms"]] == ["lambert"]
    assert full["materials"]["a/b~c"] == default["materials"]["a/b~c"]
    assert full["lights"] == {**default["lights"], "Key": {**default["lights"]["Key"], "on": False}}
    assert full["display"] == {"exposure": 2, "tone_map": "agx"}
    assert complete({}, default) == default


def test_the_contract_s_example_is_valid(default):
    example = {
        "materials": {
            "Teapot": {
                "terms": [
                    {"model": "lambert", "color": [0.1, 0.02, 0.02]},
                    {
                        "model": "cook_torrance",
                        "color": [1, 1, 1],
                        "params": {"sigma": 0.2, "ior": 1.5, "extinction": 0.0},
                        "curves": {"theta_h": {"points": [[0, 4.0], [12, 1.5], [90, 0]], "channels": "rgb"}},
                    },
                ]
            }
        },
        "environment": {"map": None, "scale": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0},
        "lights": {"Key": {"scale": 1.0, "color": [1, 1, 1], "on": True}},
        "display": {"exposure": 0.0, "tone_map": "agx"},
    }
    look = validate(example, default)
    assert isinstance(look, Look)
    assert look.materials["Teapot"].terms[1]["params"]["sigma"] == 0.2
    assert look.display.tone_map == "agx"
    assert look.lights["Key"].on is True
    with pytest.raises(ValidationError):
        look.display.exposure = 3.0


def test_look_does_not_follow_later_changes_of_its_document(default):
    document = copy.deepcopy(default)
    look = validate(document, default)
    document["materials"]["Teapot"]["terms"][1]["params"]["sigma"] = 0.9
    document["materials"]["Teapot"]["terms"].clear()
    assert look.materials["Teapot"].terms[1]["params"]["sigma"] == 0.2


def points(count):
    return [[90 * k / (count - 1), 1.0] for k in range(count)]


@pytest.mark.parametrize(
    ("path", "value", "pointer", "allowed"),
    [
        ("", [], "the look", "an object"),
        ("", {"material": {}}, "/material", "'materials'"),
        ("/materials", 3, "/materials", "material"),
        ("/transport", {"depth": 3}, "/transport/depth", "'bounces'"),
        ("/transport/show", "shadows", "/transport/show", "'further_bounces'"),
        ("/transport/show", ["all"], "/transport/show", "'further_bounces'"),
        *(("/transport/bounces", bad, "/transport/bounces", "0 to 24") for bad in (-1, 25, 1.5, True, None, NAN)),
        ("/materials", {"Cup": {}}, "/materials", "'Teapot'"),
        ("/materials/Teapot", None, "/materials/Teapot", "an object"),
        ("/materials/Teapot/terms", {}, "/materials/Teapot/terms", "at most 16"),
        ("/materials/Teapot/terms", [{"model": "lambert"}] * 17, "/materials/Teapot/terms", "at most 16"),
        ("/materials/Teapot/terms/1", {}, "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/model", "velvet", "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/model", ["ggx"], "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/texture", "bump", "/materials/Teapot/terms/1/texture", "'specular'"),
        ("/materials/Teapot/terms/1/color", [1, 1], "/materials/Teapot/terms/1/color", "three numbers"),
        ("/materials/Teapot/terms/1/color", [1, 1, -0.1], "/materials/Teapot/terms/1/color/2", "[0, 10000]"),
        ("/materials/Teapot/terms/1/color", [1, NAN, 1], "/materials/Teapot/terms/1/color/1", "[0, 10000]"),
        ("/materials/Teapot/terms/1/color", [True, 1, 1], "/materials/Teapot/terms/1/color/0", "[0, 10000]"),
        ("/materials/Teapot/terms/1/params", {"roughness": 1}, "/materials/Teapot/terms/1/params/roughness", "'sigma'"),
        ("/materials/a~1b~0c/terms/0/params/f0", [1, 2, 0], "/materials/a~1b~0c/terms/0/params/f0/1", "[0, 1]"),
        *((SIGMA, bad, SIGMA, "[0.005, 1]") for bad in (0, 1.5, NAN, INF, -INF, True, None, "0.2", 10**400, [], {})),
        (CURVES, {"theta_i": {"points": points(3)}}, f"{CURVES}/theta_i", "'theta_h'"),
        (f"{CURVES}/theta_h", 7, f"{CURVES}/theta_h", "an object"),
        (f"{CURVES}/theta_h", {}, f"{CURVES}/theta_h", "points or bands"),
        (f"{CURVES}/theta_h", {"points": points(3), "bands": []}, f"{CURVES}/theta_h", "points or bands"),
        (f"{CURVES}/theta_h", {"points": points(3), "x": 1}, f"{CURVES}/theta_h/x", "leave it out"),
        (f"{CURVES}/theta_h", {"points": points(4097)}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": points(1_000_000)}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": [[0, 1]]}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [0, 2]]}, f"{CURVES}/theta_h/points/1/0", "greater"),
        (f"{CURVES}/theta_h", {"points": [[3, 1], [2, 2]]}, f"{CURVES}/theta_h/points/1/0", "greater"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [91, 2]]}, f"{CURVES}/theta_h/points/1/0", "[0, 90]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [NAN, 2], [80, 1]]}, f"{CURVES}/theta_h/points/1/0", "[0, 90]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1.0], [5, NAN]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1.0], [5, INF]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, False], [5, 1]]}, f"{CURVES}/theta_h/points/0/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [5, 10**400]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [5]]}, f"{CURVES}/theta_h/points/1", "a point"),
        (f"{CURVES}/theta_h", {"points": ["ab", "cd"]}, f"{CURVES}/theta_h/points/0", "a point"),
        (f"{CURVES}/theta_h", {"points": "0123"}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"bands": [1.0] * 255}, f"{CURVES}/theta_h/bands", "256 values"),
        (f"{CURVES}/theta_h", {"bands": [[1.0] * 256] * 2}, f"{CURVES}/theta_h/bands", "256 values"),
        (f"{CURVES}/theta_h", {"bands": [1.0] * 255 + [NAN]}, f"{CURVES}/theta_h/bands/255", "[0, 1e+06]"),
        (
            f"{CURVES}/theta_h",
            {"bands": [[1.0] * 256, [1.0] * 256, [1.0] * 9 + [-1.0] * 247]},
            f"{CURVES}/theta_h/bands/2/9",
            "[0, 1e+06]",
        ),
        *(
            (f"{CURVES}/theta_h", {"points": points(3), "channels": bad}, f"{CURVES}/theta_h/channels", "letters")
            for bad in ("", "rgba", "rr", 1, ["r"])
        ),
        (f"{CURVES}/theta_h", [], f"{CURVES}/theta_h", "one to three"),
        (f"{CURVES}/theta_h", [{"points": points(3), "channels": "r"}] * 4, f"{CURVES}/theta_h", "one to three"),
        (
            f"{CURVES}/theta_h",
            [{"points": points(3), "channels": "rg"}, {"points": points(3), "channels": "gb"}],
            f"{CURVES}/theta_h/1/channels",
            "no other object",
        ),
        ("/environment/scale", -1, "/environment/scale", "[0, 10000]"),
        ("/environment/color", [1, -1, 1], "/environment/color/1", "[0, 10000]"),
        ("/environment/color", 0.5, "/environment/color", "three numbers"),
        ("/environment/rotation", 1e9, "/environment/rotation", "[-360, 360]"),
        ("/environment/map", "env:0123456789abcdef", "/environment/map", "'studio'"),
        ("/environment/map", "../studio", "/environment/map", "null for the scene's own"),
        ("/environment/map", ["studio"], "/environment/map", "'sunset'"),
        ("/environment/tilt", 1, "/environment/tilt", "'rotation'"),
        ("/lights", [], "/lights", "each light"),
        ("/lights", {f"L{k}": {"kind": "point"} for k in range(63)}, "/lights", "at most 64"),
        ("/lights/Moon", 3, "/lights/Moon", "an object"),
        ("/lights/Moon", {}, "/lights/Moon/kind", "'point'"),
        ("/lights/Moon", {"kind": ["point"]}, "/lights/Moon/kind", "'point'"),
        ("/lights/Moon", {"kind": "mesh", "material": "Teapot"}, "/lights/Moon/kind", "'point'"),
        ("/lights/" + "x" * 81, {"kind": "point"}, "/lights/" + "x" * 80, "1 to 80"),
        ("/lights/Moon", {"kind": "point", "cone": [1, 2]}, "/lights/Moon/cone", "'position'"),
        ("/lights/Moon", {"kind": "point", "emission": [1, -1, 1]}, "/lights/Moon/emission/1", "[0, 1e+06]"),
        ("/lights/Moon", {"kind": "rectangle", "size": [1, 0]}, "/lights/Moon/size/1", "[0.0001, 10000]"),
        ("/lights/Moon", {"kind": "rectangle", "rotation": 361}, "/lights/Moon/rotation", "[-360, 360]"),
        ("/lights/Key/on", 1, "/lights/Key/on", "true or false"),
        ("/lights/Key/scale", NAN, "/lights/Key/scale", "[0, 10000]"),
        ("/lights/Key/size", [1, 1], "/lights/Key/size", "'cone'"),
        ("/lights/Key/position", [0, INF, 0], "/lights/Key/position/1", "[-1e+06, 1e+06]"),
        ("/lights/Key/position", [0, 1], "/lights/Key/position", "three numbers"),
        ("/lights/Key/direction", [0, 0, 1e-30], "/lights/Key/direction", "not all zero"),
        ("/lights/Key/cone", [20], "/lights/Key/cone", "two numbers"),
        ("/lights/Key/cone", [0, 0], "/lights/Key/cone", "above 0"),
        ("/lights/Key/cone", [40, 30], "/lights/Key/cone", "inner ≤ outer"),
        ("/lights/Key/cone", [20, 91], "/lights/Key/cone/1", "[0, 90]"),
        ("/lights/Key/kind", "mesh", "/lights/Key/kind", "'spot'"),
        ("/lights/Panel/kind", "point", "/lights/Panel/kind", "'mesh'"),
        ("/lights/Panel/material", "a/b~c", "/lights/Panel/material", "'Teapot'"),
        ("/lights/Panel/position", [0, 0, 0], "/lights/Panel/position", "'material'"),
        ("/display/exposure", 21, "/display/exposure", "[-20, 20]"),
        ("/display/tone_map", "reinhard", "/display/tone_map", "'agx'"),
        ("/display/tone_map", {"a": 1}, "/display/tone_map", "'agx'"),
    ],
)
def test_bad_value_is_refused_with_its_pointer_and_what_is_allowed(default, path, value, pointer, allowed):
    before = copy.deepcopy(default)
    with pytest.raises(ParameterError) as caught:
        apply_patch(default, [{"op": "add", "path": path, "value": value}], default)
    assert caught.value.name == pointer
    assert allowed in caught.value.allowed
    assert len(str(caught.value)) < 600
    assert "\n" not in str(caught.value)
    assert default == before
    # the same document whole, as a file or a PUT would bring it, is refused likewise
    document = jsonpatch.apply_patch(default, [{"op": "add", "path": path, "value": value}])
    with pytest.raises(ParameterError) as caught:
        validate(document, default)
    assert caught.value.name == pointer


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
def test_patch_that_does_not_fit_is_refused_and_nothing_changes(default, patch):
    before = copy.deepcopy(default)
    with pytest.raises(EditError) as caught:
        apply_patch(default, patch, default)
    assert len(str(caught.value)) < 600
    assert default == before


def test_patch_with_one_bad_operation_changes_nothing(default):
    before = copy.deepcopy(default)
    with pytest.raises(EditError):
        apply_patch(default, [*replace(SIGMA, 0.3), {"op": "remove", "path": "/nothing"}], default)
    assert default == before


def test_patch_shares_what_it_does_not_touch(default):
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
    sent = copy.deepcopy(patch)
    edited = apply_patch(default, patch, default)
    assert edited["materials"]["Teapot"]["terms"][1]["curves"]["theta_h"]["points"] == [[0, 3], [45, 0.5], [90, 0]]
    assert patch == sent


def test_what_a_patch_removes_is_the_default_again(default):
    edited = apply_patch(default, [*replace(SIGMA, 0.7), *replace("/display/exposure", 3)], default)
    assert edited != default
    for path in (SIGMA, "/display", "/materials/Teapot"):
        edited = apply_patch(edited, [{"op": "remove", "path": path}], default)
    assert edited == default


def test_lights_are_added_completed_and_taken_away(default):
    lamp = {"op": "add", "path": "/lights/Lamp", "value": {"kind": "rectangle", "size": [1, 2]}}
    added = apply_patch(default, [lamp], default)
    assert added["lights"]["Lamp"] == {
        "kind": "rectangle", "scale": 1.0, "color": [1.0, 1.0, 1.0], "on": True, "emission": [1.0, 1.0, 1.0],
        "position": [0.0, 1.0, 0.0], "direction": [0.0, -1.0, 0.0], "rotation": 0.0, "size": [1, 2],
    }  # fmt: skip
    moved = apply_patch(added, replace("/lights/Lamp/position/1", 1.5), default)
    assert moved["lights"]["Lamp"]["position"] == [0.0, 1.5, 0.0]
    assert moved["lights"]["Key"] is default["lights"]["Key"]
    assert apply_patch(moved, [{"op": "remove", "path": "/lights/Lamp"}], default) == default


def test_light_of_the_scene_may_change_its_kind_and_comes_back_when_removed(default):
    edited = apply_patch(default, replace("/lights/Key", {"kind": "point"}), default)
    assert edited["lights"]["Key"]["position"] == [0.0, 1.0, 0.0], "another kind starts from its own defaults"
    edited = apply_patch(edited, [{"op": "remove", "path": "/lights/Key"}], default)
    assert edited == default
    dark = apply_patch(default, replace("/lights/Panel/on", False), default)
    assert validate(dark, default).lights["Panel"].gain == (0.0, 0.0, 0.0)


def test_light_s_gain_and_geometry_say_all_of_it(default):
    edited = apply_patch(
        default,
        replace("/lights/Key", {"scale": 2, "color": [1, 0.5, 0], "emission": [3, 3, 3]}),
        default,
    )
    key, before = validate(edited, default).lights["Key"], validate(default, default).lights["Key"]
    assert key.gain == (6.0, 3.0, 0.0)
    assert key.geometry == before.geometry
    assert key.geometry.position == (1.0, 2.0, 3.0)
    wider = validate(apply_patch(default, replace("/lights/Key/cone/1", 60), default), default)
    assert wider.lights["Key"].geometry != before.geometry


def test_empty_path_replaces_the_whole_look(default):
    edited = apply_patch(default, replace("/display/exposure", 3), default)
    assert apply_patch(edited, replace("", {}), default) == default
    whole = apply_patch(default, replace("", {"environment": {"scale": 2}}), default)
    assert whole["environment"] == {"map": None, "scale": 2, "color": [1.0, 1.0, 1.0], "rotation": 0.0}


def test_term_may_be_added_moved_down_and_changed_in_model(default):
    ggx = {"model": "ggx", "color": [1, 0, 0]}
    edited = apply_patch(default, [{"op": "add", "path": "/materials/Teapot/terms/0", "value": ggx}], default)
    terms = edited["materials"]["Teapot"]["terms"]
    assert [t["model"] for t in terms] == ["ggx", "lambert", "cook_torrance"]
    assert terms[0]["params"] == {"roughness": 0.4, "f0": 0.04}
    blinn = apply_patch(edited, replace("/materials/Teapot/terms/2", {"model": "blinn_phong"}), default)
    assert blinn["materials"]["Teapot"]["terms"][2]["params"] == {"exponent": 50.0}


def test_curves_of_one_model_are_not_taken_on_trust_for_another(default):
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
            "/lights/Key/on",
            "/lights/Lamp",
            "/lights/Lamp/cone",
            "/lights/Lamp/scale",
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


@settings(max_examples=300, deadline=None, derandomize=True)
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


def test_scene_with_a_bad_term_is_refused_with_its_pointer():
    with pytest.raises(ParameterError) as caught:
        default_look([Material("Cup", ({"model": "ggx", "params": {"roughness": 0.0}},))])
    assert caught.value.name == "/materials/Cup/terms/0/params/roughness"


@pytest.mark.parametrize(
    ("transport", "paths"),
    [
        ({}, (True, 1, 24)),
        ({"bounces": 1}, (True, 1, 1)),
        ({"bounces": 0}, (True, 1, 0)),
        ({"show": "direct"}, (True, 1, 0)),
        ({"show": "first_bounce"}, (False, 1, 1)),
        ({"show": "first_bounce", "bounces": 0}, (False, 1, 0)),
        ({"show": "further_bounces", "bounces": 3}, (False, 2, 3)),
        ({"show": "further_bounces", "bounces": 1}, (False, 1, 0)),
    ],
)
def test_shown_paths_are_equal_where_the_picture_is(default, transport, paths):
    assert validate({"transport": transport}, default).transport.paths == paths


def test_a_store_that_knows_no_transport_shows_all_of_it(default):
    older = {name: part for name, part in default.items() if name != "transport"}
    assert complete({}, older)["transport"] == default["transport"]


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({}, "/lights/A/kind"),
        ({"kind": ["spot"]}, "/lights/A/kind"),
        ({"kind": "mesh", "material": "Cup"}, "/lights/A/material"),
        ({"kind": "spot", "size": [1, 1]}, "/lights/A/size"),
    ],
)
def test_scene_with_a_bad_light_is_refused_with_its_pointer(fields, pointer):
    with pytest.raises(ParameterError) as caught:
        default_look(MATERIALS, [Light("A", fields)])
    assert caught.value.name == pointer
