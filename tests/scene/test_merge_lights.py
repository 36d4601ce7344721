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
    assert [light.name for light in lights] == ["Bulb", "Bulb.red", "Bulb.999"]
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
    assert {each["kind"] for each in rest.light_fields((1.0, 1.0, 1.0))} == {"point", "spot"}


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
    fields = source.members.light_fields(source.fields["emission"])
    np.testing.assert_allclose([each["emission"][0] for each in fields], [1 + k % 2 for k in range(66)], rtol=1e-6)
    assert [each["size"] for each in fields[:2]] == [[1.0, 1.0], [1.0, 2.0]]


def test_dark_lights_are_a_source_that_can_be_turned_up() -> None:
    (source,), _ = collected([(f"Bulb.{k:03}", point(k), [0, 0, 0]) for k in range(70)])
    assert source.members is not None
    assert source.fields["emission"] == [0, 0, 0]
    assert (source.members.relative_emission == 1).all()


def glowing(colors: Any) -> tuple[list[Light], list[ImporterWarning]]:
    """A dim point light, and a material of each emission with a square meter."""
    warnings: list[ImporterWarning] = []
    collector = LightCollector(warnings)
    collector.add(collector.name("Key"), point(0), np.full(3, 1e-3))
    materials = [replace(WHITE, name=f"Glow {k}") for k in range(len(colors))]
    meshes = [replace(FLOOR, name=f"floor {k}", material=k) for k in range(len(colors))]
    collector.emissive_light(materials, list(np.array(colors, np.float64)), meshes)
    return collector.lights, warnings


def test_the_least_powerful_emissive_materials_are_one_source_of_their_own_colors() -> None:
    colors = [[1.0 + k, 2.0, 0.0] for k in range(70)]
    lights, warnings = glowing(colors)
    assert len(lights) == MAX_LIGHTS
    source = next(light for light in lights if light.fields["kind"] == "surfaces")
    assert source.name == "Other emissive materials"
    assert {name for name, _ in source.fields["materials"]} == {f"Glow {k}" for k in range(8)}
    np.testing.assert_allclose(source.fields["emission"], np.mean(colors[:8], axis=0))
    emitted = {name: np.multiply(rgb, source.fields["emission"]).tolist() for name, rgb in source.fields["materials"]}
    assert emitted == {f"Glow {k}": pytest.approx(colors[k]) for k in range(8)}
    assert {light.name for light in lights} >= {"Key", "Glow 8", "Glow 69"}
    assert len(warnings) == 1
    assert warnings[0].startswith("8 of 71 lights were merged into 1 source, for example “Other emissive materials”:")
    assert warnings[0].severity == "approximated"


def test_a_dim_emissive_material_still_shines() -> None:
    lights, _ = glowing([[1e-6] * 3] + [[1.0] * 3] * 70)
    source = next(light for light in lights if light.fields["kind"] == "surfaces")
    relative = dict(source.fields["materials"])["Glow 0"]
    assert relative[0] * source.fields["emission"][0] == pytest.approx(1e-6)
    assert len(set(relative)) == 1


def test_directional_lights_are_one_source_with_their_angles() -> None:
    directionals = [
        (f"Sun {chr(65 + k % 26)}{k}x", {"kind": "directional", "direction": [k, -1, 0], "angle": k / 100}, [1 + k] * 3)
        for k in range(70)
    ]
    lights, warnings = collected(directionals)
    assert len(lights) == MAX_LIGHTS
    source = lights[-1]
    assert source.fields == {"kind": "directionals", "source": "Other lights", "emission": pytest.approx([4.0] * 3)}
    assert source.members is not None
    fields = source.members.light_fields(source.fields["emission"])
    assert sorted((each["emission"][0], each["direction"][0]) for each in fields) == [
        (pytest.approx(1 + k), k) for k in range(7)
    ]
    assert max(each["angle"] for each in fields) == pytest.approx(0.06)
    assert "7 of 70 lights were merged" in warnings[0]


def test_round_lights_are_members_weighted_by_their_area() -> None:
    shapes: list[dict[str, Any]] = [
        {"kind": "disc", "direction": [0, -1, 0], "radius": 1.0},
        {"kind": "sphere", "radius": 0.5},
        {"kind": "tube", "direction": [1, 0, 0], "radius": 0.25, "length": 2.0},
    ]
    lights, _ = collected(
        [(f"Bulb.{k:03}", {"position": [k, 1, 0], **shapes[k % 3]}, [1 + k % 3] * 3) for k in range(66)]
    )
    (source,) = lights
    assert source.members is not None
    np.testing.assert_allclose(source.fields["emission"], 2.0)  # all have an area of π
    fields = source.members.light_fields(source.fields["emission"])
    for k, shape in enumerate(shapes):
        assert fields[k] == {"position": [k, 1, 0], **shape, "emission": pytest.approx([1 + k] * 3)}


def test_links_of_merged_lights_stay_or_are_reported() -> None:
    link = {"exclude": {"materials": ["White"], "objects": []}}
    lights, warnings = collected([(f"Bulb.{k:03}", {**point(k), "link": link}, [1] * 3) for k in range(66)])
    assert lights[0].fields["link"] == link
    assert len(warnings) == 1
    names = [chr(65 + k % 26) + chr(65 + k // 26) for k in range(70)]
    fields = [{**point(k), **({"link": link} if k % 2 else {})} for k in range(70)]
    lights, warnings = collected([(name, each, [1] * 3) for name, each in zip(names, fields, strict=True)])
    assert lights[-1].fields.get("link") is None
    assert "have different links; they light all objects" in warnings[0]


@pytest.mark.parametrize(
    "rows", [np.zeros((2, 12)), np.zeros((0, 16)), np.full((1, 16), np.nan), np.zeros(16), np.full((1, 16), 7.0)]
)
def test_damaged_members_are_refused(rows: Any) -> None:
    with pytest.raises(SceneError, match="import the scene again"):
        LightMembers.from_rows(rows)
