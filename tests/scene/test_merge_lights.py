"""Sources of many lights: groups that an importer proposes, and lights beyond the limit of a look."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tiny_scenes import quad

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning
from relume.scene.collect_lights import LightCollector
from relume.scene.light_members import LightMembers
from relume.scene.light_prefix import name_prefix
from relume.scene.model import Light, Material
from relume.scene.validate import MAX_LIGHTS

WHITE = Material("White", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
FLOOR = quad("floor", [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], 0)


def collected(lights: list[tuple[str, dict[str, Any], Any]]) -> tuple[list[Light], list[ImporterWarning]]:
    warnings: list[ImporterWarning] = []
    collector = LightCollector(warnings)
    for name, fields, emission in lights:
        collector.add(collector.name(name), fields, np.array(emission, np.float64))
    collector.emissive_light([WHITE], [np.zeros(3)], [FLOOR])
    return collector.lights, warnings


def point(k: int) -> dict[str, Any]:
    return {"kind": "point", "position": [float(k), 1.0, 0.0]}


@pytest.mark.parametrize(
    ("name", "prefix"),
    [
        ("Downlight.001", "Downlight"),
        ("Bulb 2", "Bulb"),
        ("Bulb_03.001", "Bulb"),
        ("Key", "Key"),
        ("12", "12"),
        ("", ""),
    ],
)
def test_prefixes_are_names_without_numbers(name: str, prefix: str) -> None:
    assert name_prefix(name) == prefix


def test_lights_of_one_prefix_are_proposed_as_a_group() -> None:
    lights, warnings = collected(
        [("Bulb", point(0), [1, 1, 1]), ("Bulb.001", point(1), [1, 0, 0]), ("Key", point(2), [1, 1, 1])]
    )
    assert [light.group for light in lights] == ["Bulb", "Bulb", ""]
    assert not warnings


def test_as_many_lights_as_a_look_has_stay_single() -> None:
    lights, warnings = collected([(f"Bulb.{k:03}", point(k), [1, 1, 1]) for k in range(MAX_LIGHTS)])
    assert all(light.members is None for light in lights)
    assert not warnings


def test_one_more_makes_a_source_of_their_group_and_color() -> None:
    intensities = np.linspace(1, 3, MAX_LIGHTS)
    white = [(f"Bulb.{k:03}", point(k), [i, i, i]) for k, i in enumerate(intensities)]
    lights, warnings = collected([*white, ("Bulb.red", point(99), [1, 0, 0]), ("Bulb.999", point(98), [2, 0, 0])])
    assert [light.name for light in lights] == ["Bulb", "Bulb.999", "Bulb.red"]
    source = lights[0]
    assert source.members is not None
    assert source.group == "Bulb"
    assert source.fields == {"kind": "points", "source": "Bulb", "emission": pytest.approx([2.0] * 3)}
    np.testing.assert_allclose(source.members.relative_emission, intensities / intensities.mean(), rtol=1e-6)
    np.testing.assert_array_equal(source.members.position[:, 0], np.arange(MAX_LIGHTS))
    assert "64 of 66 lights were merged into 1 source, for example “Bulb”" in warnings[0]
    assert warnings[0].severity == "approximated"


def test_a_thousand_lights_of_any_name_and_color_keep_their_power() -> None:
    rng = np.random.default_rng(0)
    emissions = rng.uniform(0.1, 1, (1000, 3))
    emissions[:5] *= 100
    names = [f"{chr(65 + k % 26)}{chr(65 + k // 26)} light" for k in range(1000)]
    spot = {"direction": [0.0, -1.0, 0.0], "cone": [20.0, 30.0]}
    fields = [{**point(k), **({"kind": "spot", **spot} if k % 2 else {})} for k in range(1000)]
    lights, warnings = collected(list(zip(names, fields, emissions, strict=True)))
    assert len(lights) <= MAX_LIGHTS
    total = sum(
        np.array(light.fields["emission"]) * (1 if light.members is None else len(light.members.position))
        for light in lights
    )
    np.testing.assert_allclose(total, emissions.sum(axis=0))
    assert {light.name for light in lights} >= {names[0], names[2], names[4]}  # the brightest stay
    assert any("colors; all get their mean color" in warning for warning in warnings)
    rest = lights[-1].members
    assert rest is not None
    assert {each["kind"] for each in rest.light_fields("points", (1.0, 1.0, 1.0))} == {"point", "spot"}


def test_rectangles_have_their_mean_radiance_by_area() -> None:
    panels = [
        (
            f"Panel.{k:03}",
            {"kind": "rectangle", "position": [k, 2, 0], "direction": [0, -1, 0], "size": [1, 1 + k % 2]},
            [1 + k % 2] * 3,
        )
        for k in range(66)
    ]
    (source,), _ = collected(panels)
    np.testing.assert_allclose(source.fields["emission"], (1 * 1 + 2 * 2) / 3)  # W/sr/m²
    assert source.members is not None
    fields = source.members.light_fields("panels", source.fields["emission"])
    np.testing.assert_allclose([each["emission"][0] for each in fields], [1 + k % 2 for k in range(66)], rtol=1e-6)
    assert [each["size"] for each in fields[:2]] == [[1.0, 1.0], [1.0, 2.0]]


def test_dark_lights_are_a_source_that_can_be_turned_up() -> None:
    (source,), _ = collected([(f"Bulb.{k:03}", point(k), [0, 0, 0]) for k in range(70)])
    assert source.members is not None
    assert source.fields["emission"] == [0, 0, 0]
    assert (source.members.relative_emission == 1).all()


def test_emissive_materials_beyond_the_limit_are_left_out_with_a_warning() -> None:
    warnings: list[ImporterWarning] = []
    collector = LightCollector(warnings)
    collector.add(collector.name("Key"), point(0), np.full(3, 1e-3))
    materials = [replace(WHITE, name=f"Glow {k}") for k in range(70)]
    meshes = [replace(FLOOR, name=f"floor {k}", material=k) for k in range(70)]
    collector.emissive_light(materials, [np.full(3, 1.0 + k) for k in range(70)], meshes)
    names = [light.name for light in collector.lights]
    assert len(names) == MAX_LIGHTS
    assert "Key" in names
    assert {"Glow 69", "Glow 7"} <= set(names)
    assert "Glow 6" not in names
    assert "7 emissive materials or directional lights, the dimmest, were left out, for example “Glow 0”" in warnings[0]
    assert warnings[0].severity == "unsupported"


@pytest.mark.parametrize("rows", [np.zeros((2, 11)), np.zeros((0, 12)), np.full((1, 12), np.nan), np.zeros(12)])
def test_damaged_members_are_refused(rows: Any) -> None:
    with pytest.raises(SceneError, match="import the scene again"):
        LightMembers.from_rows(rows)
