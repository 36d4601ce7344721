"""Light mixes: what a file has, what a look gets from it, and what is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest
from export_scenes import export_of, sample_scene

from relume.core.errors import ParameterError
from relume.export.export_scene import FORMATS, export_report, format_of
from relume.export.write_light_mix import write_light_mix
from relume.look import complete, default_look, validate
from relume.look.light_mix import UNITS, expand_light_mix
from relume.look.model import LightKind
from relume.scene.model import Light

PANEL = Light("Panel", {"kind": "rectangle", "position": [0.0, 1.0, 2.0], "emission": [2.0, 2.0, 2.0]})
SCENE = replace(sample_scene(), lights=(*sample_scene().lights, PANEL))
DEFAULT = default_look(SCENE.materials, SCENE.lights)
VALUES = {"intensity": 0.1 + 0.2, "color": [1.0, 0.25, 1 / 3], "enabled": True, "emission": [3.0, 2.0, 1e-7]}
MATERIAL = next(iter(DEFAULT["materials"]))
RED = {MATERIAL: {"terms": [{"model": "lambert", "color": [0.8, 0.0, 0.0]}]}}
MIX = {
    "materials": RED,
    "lights": {name: {**VALUES, "enabled": index % 2 == 0} for index, name in enumerate(DEFAULT["lights"])},
    "environment": {"intensity": 0.7, "color": [0.1, 0.2, 0.3], "rotation": 33.3, "map": "studio"},
}


@pytest.fixture
def mix(tmp_path: Path) -> Any:
    write_light_mix(export_of(SCENE, MIX), tmp_path / "mix.json")
    return json.loads((tmp_path / "mix.json").read_text())


def test_a_mix_restores_all_lights_and_the_environment(mix: Any) -> None:
    assert set(get_args(LightKind)) == set(UNITS)
    restored, edited = validate(mix, DEFAULT), validate(MIX, DEFAULT)
    assert restored.lights == edited.lights
    assert restored.environment == edited.environment
    assert restored.materials == validate({}, DEFAULT).materials
    sections = {name: mix[name] for name in ("lights", "light_groups", "environment")}
    assert expand_light_mix(mix, DEFAULT) == (sections, [])


def test_its_sections_are_a_partial_look_that_leaves_materials_alone(mix: Any) -> None:
    after = {"materials": RED, "lights": mix["lights"], "environment": mix["environment"]}
    assert complete(after, DEFAULT) == complete(MIX, DEFAULT)


def test_units_are_those_of_the_kinds(mix: Any) -> None:
    kinds = {name: light["kind"] for name, light in DEFAULT["lights"].items()}
    assert (mix["kinds"], mix["units"]) == (kinds, UNITS)
    assert (UNITS["point"], UNITS["directional"], UNITS["mesh"]) == ("W/sr", "W/m²", "W/(sr·m²)")


def test_names_that_the_scene_does_not_have_are_said_and_the_others_applied(mix: Any) -> None:
    first, *others = DEFAULT["lights"]
    fewer = {**DEFAULT, "lights": {name: DEFAULT["lights"][name] for name in others}}
    look, warnings = expand_light_mix(mix, fewer)
    assert list(look["lights"]) == others
    assert warnings == [f"The light mix has values for lights that the scene does not have: {first!r}."]
    assert complete(mix, fewer)["lights"][others[0]]["intensity"] == VALUES["intensity"]


def test_emission_of_another_kind_of_light_is_not_taken(mix: Any) -> None:
    name = next(name for name, light in DEFAULT["lights"].items() if light["kind"] == "point")
    point = DEFAULT["lights"][name]
    fields = {**{field: value for field, value in point.items() if field != "position"}, "kind": "directional"}
    sun = {**fields, "direction": [0.0, -1.0, 0.0], "emission": [9.0, 9.0, 9.0]}
    other = {**DEFAULT, "lights": {**DEFAULT["lights"], name: sun}}
    light = complete(mix, other)["lights"][name]
    assert (light["emission"], light["intensity"]) == ([9.0, 9.0, 9.0], VALUES["intensity"])
    assert expand_light_mix(mix, other)[1] == [
        f"These lights are of another kind in the scene and keep its emission: {name!r}."
    ]


def test_an_environment_that_is_not_here_is_said(mix: Any) -> None:
    mix["environment"]["map"] = "dawn at home"
    environment = complete(mix, DEFAULT)["environment"]
    assert (environment["map"], environment["intensity"]) == (None, 0.7)
    assert expand_light_mix(mix, DEFAULT)[1] == [
        "The environment 'dawn at home' of the light mix is not available; the scene's own stays."
    ]


def test_the_report_says_what_a_mix_does_not_restore() -> None:
    name = next(name for name, light in DEFAULT["lights"].items() if light["kind"] == "point")
    lights = {name: {"position": [9.0, 9.0, 9.0]}, "Kicker": {"kind": "spot"}}
    export = export_of(SCENE, {"lights": lights}, Red={"materials": RED})
    report = export_report(export, FORMATS["light_mix"])
    assert report.omitted == (
        "Lights that the look adds have their values, but not their places: 'Kicker'.",
        f"Position, shape, image and links of these lights stay those of the scene: {name!r}.",
        "A light mix has the lights of one look; further looks are left out.",
    )
    assert format_of(Path("a.JSON")) is FORMATS["light_mix"]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"version": 2}, "/version is 2; give 1"),
        ({"lights": 3}, "/lights is 3"),
        ({"kinds": []}, "/kinds is a list"),
        ({"environment": "studio"}, "/environment"),
        ({"lights": dict.fromkeys(DEFAULT["lights"], 3)}, "/lights/"),
        ({"lights": {"Point": {"intensity": -1}}}, "/intensity is -1"),
    ],
)
def test_damaged_mixes_are_rejected(mix: Any, change: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        complete({**mix, **change}, DEFAULT)
