"""Light groups: their gains, validation, patches, interpolation, light mixes and EXR layers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relume.core.errors import ParameterError
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.look import Look, apply_patch, complete, default_look, validate
from relume.look.difference import diff_looks
from relume.look.interpolate import interpolate_looks
from relume.look.light_mix import expand_light_mix, make_light_mix
from relume.output.exr.layers import light_group_layers, make_layers
from relume.scene.model import Light

NAMES = ["Lamp", "Lamp.001", "Key"]
DEFAULT = default_look(
    [],
    [
        Light(name, {"kind": "point", "position": [k, 1.0, 0.0], "emission": [1.0, 2.0, 4.0]}, group)
        for k, (name, group) in enumerate(zip(NAMES, ("Lamp", "Lamp", "Alone"), strict=True))
    ],
)


def look(groups: Any, lights: Any = None) -> Look:
    return validate({"light_groups": groups, "lights": lights or {}}, DEFAULT)


def gains(each: Look) -> list[tuple[float, ...]]:
    return [light.gain for light in each.lights.values()]


def test_a_scene_proposes_groups_of_several_lights() -> None:
    neutral = {"intensity": 1.0, "color": [1.0, 1.0, 1.0], "enabled": True}
    assert DEFAULT["light_groups"] == {"Lamp": {"lights": ["Lamp", "Lamp.001"], **neutral}}


def test_a_group_multiplies_the_gains_of_its_lights() -> None:
    grouped = look({"Lamp": {"intensity": 3.0, "color": [1.0, 0.5, 0.0]}}, {"Lamp.001": {"intensity": 2.0}})
    assert gains(grouped) == [(3.0, 3.0, 0.0), (6.0, 6.0, 0.0), (1.0, 2.0, 4.0)]
    edited = look(
        {},
        {
            "Lamp": {"intensity": 3.0, "color": [1.0, 0.5, 0.0]},
            "Lamp.001": {"intensity": 6.0, "color": [1.0, 0.5, 0.0]},
        },
    )
    illuminations = [illumination_from_look(each, [], has_bounces=False) for each in (grouped, edited)]
    assert illuminations[0] == illuminations[1]


def test_a_muted_group_is_dark_and_a_soloed_light_of_it_is_not() -> None:
    muted = look({"Lamp": {"enabled": False, "intensity": 3.0}})
    assert gains(muted)[:2] == [(0.0, 0.0, 0.0)] * 2
    solo = illumination_from_look(muted, [], has_bounces=False, solo=frozenset(["Lamp"]))
    assert [source.gain for source in solo.local] == [(3.0, 6.0, 12.0)]


def test_a_document_with_groups_lists_all_of_them() -> None:
    assert complete({}, DEFAULT)["light_groups"] == DEFAULT["light_groups"]
    assert list(look({"Mine": {"lights": ["Key", "Lamp"]}}).light_groups) == ["Mine"]
    dissolved = apply_patch(complete({}, DEFAULT), [{"op": "remove", "path": "/light_groups/Lamp"}], DEFAULT)
    assert dissolved["light_groups"] == {}


def test_an_edit_shares_what_it_does_not_change() -> None:
    document = complete({"light_groups": {"Lamp": {}, "Mine": {"lights": ["Key"]}}}, DEFAULT)
    patch = [{"op": "replace", "path": "/light_groups/Mine/intensity", "value": 2.5}]
    edited = apply_patch(document, patch, DEFAULT)
    assert edited["light_groups"]["Lamp"] is document["light_groups"]["Lamp"]
    assert diff_looks(document, edited) == patch


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        ({"G": {"lights": ["Nobody"]}}, "/light_groups/G/lights/0 is 'Nobody'; give the name of a light"),
        ({"Lamps": {"lights": ["Lamp"]}, "All": {"lights": ["Lamps"]}}, "a group cannot contain groups"),
        ({"A": {"lights": ["Key"]}, "B": {"lights": ["Key"]}}, "it is in 'A'"),
        ({"A": {"lights": ["Key", "Key"]}}, "it is in 'A'"),
        ({"": {"lights": []}}, "a name of 1 to 80 characters"),
        ({"environment": {"lights": []}}, "this one is reserved"),
        ({str(k): {} for k in range(10_000)}, "10,000 light groups; give at most 64"),
        ({"G": {"lights": [["Key"]]}}, "the name of a light"),
        ({"G": {"lights": "Key"}}, "a list of at most 64 lights"),
        ({"G": {"lights": ["Key"] * 65}}, "a list of at most 64 lights"),
        ({"G": {"intensity": -1}}, "/light_groups/G/intensity"),
        ({"G": {"color": [1, 1]}}, "/light_groups/G/color"),
        ({"G": {"enabled": 1}}, "true or false"),
        ({"G": {"members": []}}, "members"),
        ([], "an object with a field for each light group"),
    ],
)
def test_other_groups_are_refused_with_a_sentence(groups: Any, message: str) -> None:
    with pytest.raises(ParameterError) as refused:
        look(groups)
    assert message in str(refused.value)


def test_an_empty_group_and_one_named_as_a_light_are_valid() -> None:
    assert gains(look({"Key": {"lights": ["Lamp"], "intensity": 2.0}, "Empty": {}})) == [
        (2.0, 4.0, 8.0),
        (1.0, 2.0, 4.0),
        (1.0, 2.0, 4.0),
    ]


def test_removing_a_light_that_a_group_has_is_refused() -> None:
    document = complete({"lights": {"New": {"kind": "point"}}, "light_groups": {"G": {"lights": ["New"]}}}, DEFAULT)
    with pytest.raises(ParameterError, match="the name of a light of this look"):
        apply_patch(document, [{"op": "remove", "path": "/lights/New"}], DEFAULT)


def test_faders_of_equal_groups_are_interpolated() -> None:
    ends = [complete({"light_groups": {"Lamp": {"intensity": value}}}, DEFAULT) for value in (1.0, 3.0)]
    assert interpolate_looks(ends, 0.25)["light_groups"]["Lamp"]["intensity"] == 1.5


def test_looks_with_other_groups_are_interpolated_by_the_gains_of_lights() -> None:
    groups = [{"Lamp": {"intensity": 4.0}}, {"Mine": {"lights": ["Lamp"], "color": [0.0, 1.0, 1.0]}}]
    middle = validate(interpolate_looks([complete({"light_groups": g}, DEFAULT) for g in groups], 0.5), DEFAULT)
    # intensity 4 → 1 and color (1, 1, 1) → (0, 1, 1) of the first, intensity 4 → 1 of the second
    np.testing.assert_allclose(gains(middle), [(1.25, 5.0, 10.0), (2.5, 5.0, 10.0), (1.0, 2.0, 4.0)])


def test_a_light_mix_has_the_groups_of_the_lights_that_a_scene_has() -> None:
    mixed = look({"Mine": {"lights": ["Lamp", "Key"], "intensity": 2.0}})
    mix = make_light_mix(mixed, "scene")
    assert gains(validate(mix, DEFAULT)) == gains(mixed)
    other = {**DEFAULT, "lights": {"Key": DEFAULT["lights"]["Key"]}, "light_groups": {}}
    partial, warnings = expand_light_mix(mix, other)
    assert partial["light_groups"]["Mine"]["lights"] == ["Key"]
    assert len(warnings) == 1
    without_groups = {name: value for name, value in mix.items() if name != "light_groups"}
    assert gains(validate(without_groups, DEFAULT)) == [(1.0, 2.0, 4.0)] * 3


def test_an_exr_file_has_one_layer_a_group() -> None:
    grouped = look({"Lamp": {"intensity": 2.0}})
    layers = light_group_layers(grouped, has_indirect=False)
    assert [layer.name for layer in layers] == ["light_environment_direct", "light_Lamp_direct", "light_Key_direct"]
    assert gains(layers[1].look) == [(2.0, 4.0, 8.0), (2.0, 4.0, 8.0), (0.0, 0.0, 0.0)]
    assert gains(layers[2].look) == [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 2.0, 4.0)]
    assert len(light_group_layers(look({"Lamp": {"enabled": False}}), has_indirect=False)) == 2
    names = [layer.source for layer in make_layers(True, grouped, has_indirect=False)]
    assert names == ["environment", *NAMES]
