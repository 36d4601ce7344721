"""Completion of looks, and fields of complete looks."""

from __future__ import annotations

import copy
import json

import pytest
from example_look import replace
from pydantic import ValidationError

from relume.look import Look, apply_patch, complete, validate


def test_default_look_has_every_field(default):
    assert default["materials"]["Teapot"]["terms"][1] == {
        "model": "cook_torrance",
        "color": [1.0, 1.0, 1.0],
        "texture": "specular",
        "params": {"sigma": 0.2, "ior": 1.5, "extinction": 0.0},
        "curves": {},
    }
    assert default["materials"]["a/b~c"]["terms"][0]["texture"] is None
    assert default["environment"] == {
        "map": None, "intensity": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0, "link": None,
    }  # fmt: skip
    plain = {"intensity": 1.0, "color": [1.0, 1.0, 1.0], "enabled": True, "link": None, "shadow_link": None}
    spot = {"kind": "spot", "position": [1.0, 2.0, 3.0], "direction": [0.0, -1.0, 0.0], "cone": [20.0, 30.0]}
    spot |= {"rotation": 0.0, "profile": None, "gobo": None}
    panel = {"kind": "mesh", "material": "Teapot", "image": None, "emission": [5.0, 5.0, 4.0]}
    assert default["lights"] == {"Key": {**plain, **spot, "emission": [1.0, 1.0, 1.0]}, "Panel": {**plain, **panel}}
    assert default["transport"] == {"show": "all", "bounces": 24}
    balance = {"temperature": 6500.0, "tint": 0.0, "contrast": 1.0}
    assert default["display"] == {"exposure": 0.0, "tone_map": "agx", **balance, "lut": None}
    assert json.loads(json.dumps(default)) == default
    assert complete(default, default) == default


def test_partial_look_keeps_what_it_does_not_name(default):
    partial = {
        "materials": {"Teapot": {"terms": [{"model": "lambert", "color": [0, 1, 0]}]}},
        "lights": {"Key": {"enabled": False}},
        "display": {"exposure": 2},
    }
    full = complete(partial, default)
    assert [t["model"] for t in full["materials"]["Teapot"]["terms"]] == ["lambert"]
    assert full["materials"]["a/b~c"] == default["materials"]["a/b~c"]
    assert full["lights"] == {**default["lights"], "Key": {**default["lights"]["Key"], "enabled": False}}
    assert full["display"] == {**default["display"], "exposure": 2}
    assert complete({}, default) == default


def test_the_example_of_the_contract_is_valid(default):
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
        "environment": {"map": None, "intensity": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0},
        "lights": {"Key": {"intensity": 1.0, "color": [1, 1, 1], "enabled": True}},
        "display": {"exposure": 0.0, "tone_map": "agx"},
    }
    look = validate(example, default)
    assert isinstance(look, Look)
    assert look.materials["Teapot"].terms[1]["params"]["sigma"] == 0.2
    assert look.display.tone_map == "agx"
    assert look.lights["Key"].enabled is True
    with pytest.raises(ValidationError):
        look.display.exposure = 3.0


def test_look_does_not_follow_later_changes_of_its_document(default):
    document = copy.deepcopy(default)
    look = validate(document, default)
    document["materials"]["Teapot"]["terms"][1]["params"]["sigma"] = 0.9
    document["materials"]["Teapot"]["terms"].clear()
    assert look.materials["Teapot"].terms[1]["params"]["sigma"] == 0.2


def test_lights_are_added_completed_and_removed(default):
    addition = {"op": "add", "path": "/lights/Lamp", "value": {"kind": "rectangle", "size": [1, 2]}}
    added = apply_patch(default, [addition], default)
    assert added["lights"]["Lamp"] == {
        "kind": "rectangle", "intensity": 1.0, "color": [1.0, 1.0, 1.0], "enabled": True, "emission": [1.0, 1.0, 1.0],
        "position": [0.0, 1.0, 0.0], "direction": [0.0, -1.0, 0.0], "rotation": 0.0, "size": [1, 2],
        "link": None, "shadow_link": None,
    }  # fmt: skip
    moved = apply_patch(added, replace("/lights/Lamp/position/1", 1.5), default)
    assert moved["lights"]["Lamp"]["position"] == [0.0, 1.5, 0.0]
    assert moved["lights"]["Key"] is default["lights"]["Key"]
    assert apply_patch(moved, [{"op": "remove", "path": "/lights/Lamp"}], default) == default


def test_a_light_of_the_scene_can_change_its_kind_and_returns_when_removed(default):
    edited = apply_patch(default, replace("/lights/Key", {"kind": "point"}), default)
    assert edited["lights"]["Key"]["position"] == [0.0, 1.0, 0.0], "another kind starts from its own defaults"
    edited = apply_patch(edited, [{"op": "remove", "path": "/lights/Key"}], default)
    assert edited == default
    dark = apply_patch(default, replace("/lights/Panel/enabled", False), default)
    assert validate(dark, default).lights["Panel"].gain == (0.0, 0.0, 0.0)


def test_gain_and_geometry_determine_a_light(default):
    edited = apply_patch(
        default,
        replace("/lights/Key", {"intensity": 2, "color": [1, 0.5, 0], "emission": [3, 3, 3]}),
        default,
    )
    key, before = validate(edited, default).lights["Key"], validate(default, default).lights["Key"]
    assert key.gain == (6.0, 3.0, 0.0)
    assert key.geometry == before.geometry
    assert key.geometry.position == (1.0, 2.0, 3.0)
    wider = validate(apply_patch(default, replace("/lights/Key/cone/1", 60), default), default)
    assert wider.lights["Key"].geometry != before.geometry


@pytest.mark.parametrize(
    ("transport", "paths"),
    [
        ({}, (True, 1, 24)),
        ({"bounces": 1}, (True, 1, 1)),
        ({"bounces": 0}, (True, 1, 0)),
        ({"show": "direct"}, (True, 1, 0)),
        ({"show": "indirect"}, (False, 1, 24)),
        ({"show": "indirect", "bounces": 0}, (False, 1, 0)),
        ({"show": "first_bounce"}, (False, 1, 1)),
        ({"show": "first_bounce", "bounces": 0}, (False, 1, 0)),
        ({"show": "further_bounces", "bounces": 3}, (False, 2, 3)),
        ({"show": "further_bounces", "bounces": 1}, (False, 1, 0)),
    ],
)
def test_displayed_light_paths_are_equal_for_equal_pictures(default, transport, paths):
    assert validate({"transport": transport}, default).transport.paths == paths


def test_stores_without_transport_show_all_light(default):
    older = {name: value for name, value in default.items() if name != "transport"}
    assert complete({}, older)["transport"] == default["transport"]
