"""Lights of glTF files: punctual lights and emissive materials in relume's units, or rejected with a message."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import Glb
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.errors import ParameterError, SceneError
from relume.look import default_look
from relume.look.document import complete
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_options import ImportOptions

LIGHT = Environment("gray", np.ones((4, 8, 3), np.float32))


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "lights", LIGHT)


def with_lights(lights: list[Any], nodes: list[dict[str, Any]] | None = None) -> Glb:
    """A quad and a node for each light, or the given nodes."""
    glb = Glb().quad()
    glb.document["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    nodes = (
        [{"extensions": {"KHR_lights_punctual": {"light": k}}} for k in range(len(lights))] if nodes is None else nodes
    )
    glb.document["nodes"] += nodes
    glb.document["scenes"][0]["nodes"] += range(1, len(nodes) + 1)
    return glb


def test_punctual_lights_have_the_pose_and_intensity_of_their_node() -> None:
    lights = [
        {"type": "point", "name": "Bulb", "color": [1, 0.5, 0], "intensity": 1366},
        {"type": "spot", "intensity": 683, "spot": {"innerConeAngle": np.pi / 6, "outerConeAngle": np.pi / 3}},
        {"type": "directional", "name": "Sun", "intensity": 683},
    ]
    down = {"rotation": [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)], "translation": [1, 2, 3], "scale": [2, 2, 2]}
    nodes = [{**down, "name": f"N{k}", "extensions": {"KHR_lights_punctual": {"light": k}}} for k in range(3)]
    scene = imported(with_lights(lights, nodes))
    look = default_look(scene.materials, scene.lights)["lights"]
    assert list(look) == ["Bulb", "N1", "Sun"]
    assert look["Bulb"]["kind"] == "point"
    np.testing.assert_allclose(look["Bulb"]["emission"], [2, 1, 0])
    np.testing.assert_allclose(look["Bulb"]["position"], [1, 2, 3])
    np.testing.assert_allclose(look["N1"]["cone"], [30, 60])
    np.testing.assert_allclose(look["N1"]["direction"], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(look["Sun"]["direction"], [0, -1, 0], atol=1e-12)
    assert "position" not in look["Sun"]
    assert len([warning for warning in scene.warnings if "683" in warning]) == 1


def test_lights_get_other_names_than_the_environment_and_than_all_objects_of_javascript_have() -> None:
    lights = [{"type": "point", "name": name} for name in ("environment", "__proto__", "constructor")]
    scene = imported(with_lights(lights))
    assert [light.name for light in scene.lights] == ["environment 2", "__proto__ 2", "constructor 2"]
    default = default_look(scene.materials, scene.lights)
    for name in ("environment", "toString"):
        with pytest.raises(ParameterError, match="reserved"):
            complete({"lights": {name: {"kind": "point"}}}, default)


def test_emission_is_factor_times_strength_times_texture_mean() -> None:
    glb = Glb()
    half = {"index": glb.texture([[[255, 255, 255], [0, 0, 0]]])}
    glb.quad(
        {
            "name": "Panel",
            "emissiveFactor": [1, 0.5, 0],
            "emissiveTexture": half,
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}},
        }
    )
    scene = imported(glb)
    assert [light.name for light in scene.lights] == ["Panel"]
    panel = default_look(scene.materials, scene.lights)["lights"]["Panel"]
    assert (panel["kind"], panel["material"]) == ("mesh", "Panel")
    np.testing.assert_allclose(panel["emission"], [4, 2, 0])
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["emission"]), [[[2, 2, 2], [0, 0, 0]]])
    assert not scene.warnings


def test_emission_images_black_on_the_surface_give_no_light() -> None:
    glb = Glb()
    half = glb.texture(np.repeat([[[0, 0, 0]] * 8 + [[255, 255, 255]] * 8], 16, axis=0))
    shrunk = {"extensions": {"KHR_texture_transform": {"scale": [0.25, 1]}}}
    glb.quad({"name": "Panel", "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": half, **shrunk}})
    scene = imported(glb)
    assert not scene.lights
    assert not scene.materials[0].textures
    assert any("black" in warning for warning in scene.warnings)


def test_material_without_emission_is_no_light() -> None:
    glb = Glb()
    assert not imported(glb.quad({"emissiveTexture": {"index": glb.texture([[[255, 255, 255]]])}})).lights


def test_equal_light_names_are_made_unique_and_ranges_give_a_warning() -> None:
    point_light = {"type": "point", "name": "Bulb/1", "range": 3.0}
    scene = imported(with_lights([point_light, point_light]))
    assert [light.name for light in scene.lights] == ["Bulb-1", "Bulb-1 2"]
    assert len([warning for warning in scene.warnings if "range" in warning]) == 2


def test_no_light_of_many_is_left_out() -> None:
    assert len(imported(with_lights([{"type": "point"}] * 64)).lights) == 64
    lights = [{"type": "point", "name": f"L{k}", "intensity": 683 * (1 + k)} for k in range(70)]
    scene = imported(with_lights(lights))
    (source,) = scene.lights
    assert source.members is not None
    assert source.fields["emission"] == [35.5] * 3
    np.testing.assert_allclose(source.members.relative_emission * 35.5, np.arange(1, 71), rtol=1e-6)
    assert any("70 of 70 lights were merged into 1 source" in warning for warning in scene.warnings)


def test_nodes_of_one_light_are_a_group() -> None:
    nodes = [
        {"name": name, "extensions": {"KHR_lights_punctual": {"light": k}}}
        for name, k in (("Lobby", 0), ("Kitchen", 0), ("Bath", 1))
    ]
    scene = imported(with_lights([{"type": "point"}, {"type": "point"}], nodes))
    groups = default_look(scene.materials, scene.lights)["light_groups"]
    assert {name: group["lights"] for name, group in groups.items()} == {"Lobby": ["Lobby", "Kitchen"]}


def test_lights_of_all_kinds_compare_by_their_power() -> None:
    """A quad that emits L has π L; a directional light of irradiance E passes π d² / 4 E."""
    names = [f"{chr(65 + k % 26)}{chr(65 + k // 26)}" for k in range(64)]
    glb = with_lights([{"type": "point", "name": name, "intensity": 683} for name in names])
    glb.document["extensions"]["KHR_lights_punctual"]["lights"] += [
        {"type": "directional", "name": "Sun", "intensity": 683 * 10},
        {"type": "spot", "name": "Spot", "intensity": 683 * 2, "spot": {"outerConeAngle": np.pi / 3}},
    ]
    glb.document["nodes"] += [{"extensions": {"KHR_lights_punctual": {"light": k}}} for k in (64, 65)]
    glb.document["scenes"][0]["nodes"] += [65, 66]
    lights = {light.name: light for light in imported(glb).lights}
    assert "Sun" in lights  # π/4 · 2 · 10 = 15.7 W, a point light has 12.6 W
    assert "Spot" not in lights  # π · 2 = 6.3 W
    rest = lights["Other lights"].members
    assert rest is not None
    assert len(rest.position) == 4  # 62 sources of single lights, and these
    np.testing.assert_allclose(sorted(rest.cone[:, 1]), [60, 180, 180, 180])


def test_too_bright_lights_are_clamped_and_zero_scaled_ones_omitted() -> None:
    named = {"extensions": {"KHR_lights_punctual": {"light": 0}}}
    scene = imported(with_lights([{"type": "spot", "intensity": 1e20}], [named, {**named, "scale": [0, 0, 0]}]))
    assert [light.fields["emission"] for light in scene.lights] == [[1e12, 1e12, 1e12]]
    assert any("clamped" in warning for warning in scene.warnings)
    assert any("scale is zero" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    ("lights", "node"),
    [
        ([{"type": "laser"}], {"light": 0}),
        ([{"type": "point"}], {"light": 1}),
        ([{"type": "point"}], {"light": -1}),
        ([{"type": "point"}], "lamp"),
        ({"a": 1}, {"light": 0}),
    ],
)
def test_lights_that_cannot_be_read_are_left_out_with_a_warning(lights: Any, node: Any) -> None:
    scene = imported(with_lights(lights, [{"extensions": {"KHR_lights_punctual": node}}]))
    assert len(scene.meshes) == 1
    assert not scene.lights
    assert [warning for warning in scene.warnings if "left out" in warning and warning.severity == "unsupported"]


def test_other_lights_of_a_file_remain() -> None:
    scene = imported(with_lights([{"type": "ambient"}, {"type": "point", "name": "Bulb"}]))
    assert [light.name for light in scene.lights] == ["Bulb"]
    assert any("light 0" in warning and "“ambient”" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    ("light", "name", "value"),
    [
        ({"type": "point", "color": [1.2, 0.5, 0], "intensity": 683}, "emission", [1, 0.5, 0]),
        ({"type": "point", "color": [1, 1], "intensity": 683}, "emission", [1, 1, 1]),
        ({"type": "spot", "spot": {"outerConeAngle": 1.6, "innerConeAngle": 0.5}}, "cone", [np.degrees(0.5), 90]),
        ({"type": "spot", "spot": {"outerConeAngle": 0}}, "cone", [0, 45]),
    ],
)
def test_numbers_of_lights_out_of_range_are_clamped_or_default(light: dict[str, Any], name: str, value: Any) -> None:
    scene = imported(with_lights([light]))
    np.testing.assert_allclose(scene.lights[0].fields[name], value)
    assert len([warning for warning in scene.warnings if "light 0" in warning]) == 1


@pytest.mark.parametrize(
    ("unit", "point", "sun"), [("file", 100 / 683, 10 / 683), ("W/sr", 100, 10), ("W", 25 / np.pi, 10)]
)
def test_lights_have_the_unit_that_is_given(unit: Any, point: float, sun: float) -> None:
    """100 W of a point light are 7.96 W/sr."""
    glb = with_lights([{"type": "point", "intensity": 100}, {"type": "directional", "intensity": 10}])
    scene = import_gltf(glb.bytes(), "lights", LIGHT, options=ImportOptions(light_unit=unit))
    np.testing.assert_allclose([light.fields["emission"][0] for light in scene.lights], [point, sun], rtol=1e-6)
    assert len(scene.warnings) == (unit == "file")


@pytest.mark.parametrize(("intensity", "num_warnings"), [(7.96, 1), (5435.0, 0)])
def test_lights_that_are_dim_for_candela_give_a_warning(intensity: float, num_warnings: int) -> None:
    """A point light of 100 W, as Blender exports it without and with units."""
    glb = with_lights([{"type": "point", "intensity": intensity}])
    glb.document["asset"]["generator"] = "Blender I/O"
    warnings = [warning for warning in imported(glb).warnings if "light unit" in warning]
    assert len(warnings) == num_warnings
    assert all("“Blender I/O”" in warning and "7.96 candela" in warning for warning in warnings)


def test_too_many_definitions_are_rejected() -> None:
    with pytest.raises(SceneError, match="more than 10,000 lights"):
        imported(with_lights([{"type": "point"}] * 10_001, []))
