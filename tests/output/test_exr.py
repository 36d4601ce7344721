"""OpenEXR files read back by OpenImageIO: layers and names, attributes, half and full floats."""

from __future__ import annotations

import json
import re

import numpy as np
import OpenImageIO
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_scenes import make_camera, still_life

from relume.image_io.exr_writer import image_channels, write_exr
from relume.look import Look, default_look, validate
from relume.look.light_validation import RESERVED_LIGHT_NAMES
from relume.output.exr.export import export_exr
from relume.output.exr.layers import light_and_path_layers, light_group_layers, make_layers
from relume.output.exr.metadata import Provenance, build_attributes, world_to_ndc
from relume.raytrace.camera_rays import camera_directions
from relume.scene.shadow_catcher_ground import with_ground

POINT = {"kind": "point", "position": [0, 1, 0]}
SIZE = (48, 32)


def look_with(**changes):
    return validate(changes, default_look(still_life().materials))


def names_of(layers):
    return [layer.name for layer in layers]


def read(path):
    buffer = OpenImageIO.ImageBuf(str(path))
    return buffer.spec(), buffer.get_pixels(OpenImageIO.FLOAT)


def test_halves_are_rounded_and_nothing_becomes_infinite(tmp_path):
    image = np.random.default_rng(4).uniform(0, 3, (200, 48, 3)).astype(np.float32)
    image[0, 0] = (1e6, 1e-6, 0)
    write_exr(tmp_path / "a.exr", image_channels(image), {})
    spec, pixels = read(tmp_path / "a.exr")
    assert str(spec.format) == "half"
    assert list(spec.channelnames) == ["R", "G", "B"]
    np.testing.assert_array_equal(pixels, np.minimum(image, 65504).astype(np.float16).astype(np.float32))
    write_exr(tmp_path / "b.exr", image_channels(image), {}, "float")
    np.testing.assert_array_equal(read(tmp_path / "b.exr")[1], image)


def test_alpha_and_layers_are_channels_of_their_names(tmp_path):
    image = np.random.default_rng(4).uniform(0, 3, (32, 48, 4)).astype(np.float32)
    write_exr(tmp_path / "a.exr", [*image_channels(image), *image_channels(image[..., :3], "light_Key")], {}, "float")
    spec, pixels = read(tmp_path / "a.exr")
    order = [spec.channelnames.index(name) for name in ("R", "G", "B", "A", "light_Key.R", "light_Key.B")]
    np.testing.assert_array_equal(pixels[..., order], image[..., [0, 1, 2, 3, 0, 2]])


def test_each_enabled_light_and_each_light_path_has_a_layer():
    lights = {"Key": POINT, "Off": POINT | {"enabled": False}, "Black": POINT | {"intensity": 0}}
    look = look_with(lights=lights)
    lit = ["light_environment", "light_Key"]
    assert names_of(light_and_path_layers(look, has_indirect=False)) == lit
    paths = ["path_direct", "path_first_bounce", "path_further_bounces"]
    assert names_of(light_and_path_layers(look, has_indirect=True)) == [*lit, *paths]
    assert names_of(light_and_path_layers(look_with(), has_indirect=False)) == []
    assert names_of(light_and_path_layers(look_with(), has_indirect=True)) == paths
    assert names_of(light_and_path_layers(look_with(transport={"bounces": 1}), has_indirect=True)) == paths[:2]
    assert names_of(light_and_path_layers(look_with(transport={"show": "first_bounce"}), has_indirect=True)) == []
    assert (
        names_of(light_and_path_layers(look_with(lights=lights, environment={"intensity": 0.0}), has_indirect=False))
        == []
    )


def test_light_groups_are_direct_and_indirect_light_of_each_light():
    look = look_with(lights={"Key": POINT, "Off": POINT | {"enabled": False}})
    groups = light_group_layers(look, has_indirect=True)
    names = ["light_environment_direct", "light_environment_indirect", "light_Key_direct", "light_Key_indirect"]
    assert names_of(groups) == names
    assert [layer.look.transport.paths for layer in groups[:2]] == [(True, 1, 0), (False, 1, 24)]
    assert names_of(light_group_layers(look, has_indirect=False)) == names[::2]
    # names that a compositor expects
    assert names_of(light_group_layers(look_with(), has_indirect=False)) == names[:1]
    shown = look_with(transport={"show": "first_bounce"})
    (first,) = light_group_layers(shown, has_indirect=True)
    assert (first.name, first.look.transport.paths) == (names[1], (False, 1, 1))
    behind = look_with(background={"kind": "color"})
    assert names_of(light_group_layers(behind, has_indirect=True)) == [*names[:2], "light_background"]


def test_names_of_light_groups_keep_their_suffix():
    names = ["x" * 79, "x" * 80, "a b", "a_b"]
    groups = names_of(light_group_layers(look_with(lights=dict.fromkeys(names, POINT)), has_indirect=True))[2:]
    assert all(name.endswith(("_direct", "_indirect")) for name in groups)
    assert len({name.casefold() for name in groups}) == 2 * len(names)
    assert max(map(len, groups)) == 29
    assert "light_a_b_2_direct" in groups


def test_a_background_color_has_a_layer_and_shadow_catchers_have_none():
    look = look_with(lights={"Key": POINT}, background={"kind": "color", "color": [0.2, 0.3, 0.4]})
    *lit, behind = light_and_path_layers(look, has_indirect=False)
    assert behind.source == "background"
    assert behind.look.background.color == (0.2, 0.3, 0.4)
    assert not any(any(light.gain) for light in behind.look.lights.values())
    assert not any(behind.look.environment.gain)
    assert all(layer.look.background.color == (0, 0, 0) for layer in lit)
    assert light_and_path_layers(look_with(background={"kind": "color"}), has_indirect=False) == []
    catching = look.model_dump()
    catching["materials"]["Floor"]["shadow_catcher"] = True
    for layering in (True, "light_groups", False):
        assert make_layers(layering, Look.model_validate(catching), has_indirect=True) == []
    assert names_of(make_layers(True, look, has_indirect=True)) == names_of(
        light_and_path_layers(look, has_indirect=True)
    )
    assert make_layers(False, look, has_indirect=True) == []


LIGHT_NAMES = st.text(min_size=1, max_size=80).filter(lambda name: name not in RESERVED_LIGHT_NAMES)


def test_lights_with_similar_names_have_distinct_layers():
    names = ["a.b/c", "a b c", "A-B-C", "灯", "🙂", "Environment", "x" * 79, "x" * 80, "../..", "key\nR", "Lampe é"]
    layers = light_and_path_layers(look_with(lights=dict.fromkeys(names, POINT)), has_indirect=False)
    assert [layer.source for layer in layers] == ["environment", *names]
    assert names_of(layers)[:6] == [
        "light_environment", "light_a_b_c", "light_a_b_c_2", "light_A_B_C_3", "light_unnamed", "light_unnamed_2",
    ]  # fmt: skip
    assert names_of(layers)[-1] == "light_Lampe_e"


@given(st.lists(LIGHT_NAMES, min_size=2, max_size=12, unique=True))
def test_layer_names_are_plain_short_and_different(names):
    layers = names_of(light_and_path_layers(look_with(lights=dict.fromkeys(names, POINT)), has_indirect=True))
    assert all(re.fullmatch(r"(light|path)_[A-Za-z0-9_]{1,23}", name) for name in layers)
    assert len({name.casefold() for name in layers}) == len(names) + 4


def test_the_image_of_a_light_contains_that_light_only():
    look = look_with(lights={"Key": POINT, "Fill": POINT, "Off": POINT | {"enabled": False}})
    for layer in light_and_path_layers(look, has_indirect=False):
        emissive = [name for name, light in layer.look.lights.items() if any(light.gain)]
        emissive += ["environment"] if any(layer.look.environment.gain) else []
        assert emissive == [layer.source]


def test_attributes_describe_the_origin_of_the_image(tmp_path):
    camera = make_camera("front", [0.3, 1.1, 3], [0, 0.45, 0], 0.8)
    look = look_with(environment={"map": "studio"}, lights={"灯": POINT})
    layers = light_and_path_layers(look, has_indirect=False)
    attributes = build_attributes(Provenance("5" * 16, "still\0life 灯", "b" * 16), camera, SIZE, look, layers)
    image = np.ones((SIZE[1], SIZE[0], 3), np.float32)
    export_exr(tmp_path / "a.exr", lambda look, progress: image, look, layers, attributes)
    spec, _ = read(tmp_path / "a.exr")
    attributes_read = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    assert validate(json.loads(attributes_read["relume:look"]), default_look(still_life().materials)) == look
    assert json.loads(attributes_read["relume:layers"]) == {"light_environment": "environment", "light_unnamed": "灯"}
    assert json.loads(attributes_read["relume:sceneName"]) == "still\0life 灯"
    assert (attributes_read["relume:scene"], attributes_read["relume:bake"]) == ("5" * 16, "b" * 16)
    assert attributes_read["relume:environment"] == "studio"
    assert "W/(sr m^2)" in attributes_read["relume:units"]
    assert attributes_read["Software"].startswith("relume ")
    np.testing.assert_allclose(attributes_read["chromaticities"][:2], (0.64, 0.33))
    np.testing.assert_allclose(json.loads(attributes_read["relume:camera"])["to_world"], camera.to_world.ravel())
    np.testing.assert_allclose(attributes_read["worldToNDC"], world_to_ndc(camera, SIZE).ravel(), rtol=1e-5, atol=1e-6)
    camera_position = np.append(camera.to_world[:3, 3], 1) @ np.reshape(attributes_read["worldToCamera"], (4, 4))
    np.testing.assert_allclose(camera_position, [0, 0, 0, 1], atol=1e-5)


@pytest.mark.parametrize("catcher", [True, False])
def test_attributes_state_whether_the_ground_is_a_shadow_catcher(catcher):
    camera, scene = make_camera("front", [0.3, 1.1, 3], [0, 0.45, 0], 0.8), with_ground(still_life())
    default, ground = default_look(scene.materials), scene.materials[-1].name
    look = validate({"materials": {ground: {"shadow_catcher": catcher}}}, default)
    attributes = build_attributes(Provenance("5" * 16, "grounded", "b" * 16), camera, SIZE, look, [])
    assert validate(json.loads(attributes["relume:look"]), default) == look


def test_world_points_project_to_their_pixels():
    camera = make_camera("front", [0.3, 1.1, 3], [0, 0.45, 0], 0.8)
    x, y = np.array([0, 48, 0, 12], np.float32), np.array([0, 32, 32, 24], np.float32)
    world = camera.to_world[:3, 3] + 2.5 * camera_directions(camera, SIZE, x, y)
    projected = np.append(world, np.ones((4, 1)), axis=1) @ world_to_ndc(camera, SIZE)
    np.testing.assert_allclose(projected[:, :2] / projected[:, 3:], np.stack([x / 48, y / 32], axis=1), atol=1e-5)


def test_export_reports_progress_and_leaves_no_file_on_failure(tmp_path):
    look = look_with(lights={"Key": POINT})
    layers = light_and_path_layers(look, has_indirect=False)
    fractions: list[float] = []

    def render(look, progress):
        progress(0.5)
        progress(1.0)
        if len(fractions) > 5:
            raise RuntimeError("stopped")
        return np.ones((4, 6, 3), np.float32)

    export_exr(tmp_path / "a.exr", render, look, layers[:1], {}, progress=fractions.append)
    assert fractions == [0.25, 0.5, 0.75, 1.0]
    with pytest.raises(RuntimeError):
        export_exr(tmp_path / "b.exr", render, look, layers, {}, progress=fractions.append)
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
