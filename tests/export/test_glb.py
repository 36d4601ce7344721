"""GLB exports, read again by our importer, by their JSON, and by the validator of Khronos if it is installed."""

from __future__ import annotations

import json
import os
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_scenes import METAL, PLASTIC, checker, export_of, sample_scene, scene_of, srgb_texture, terms_of

from relume.core import filesystem
from relume.core.errors import DiskFullError, ParameterError, SceneError
from relume.export import glb_buffer
from relume.export.export_document import look_of_scene, prepare_export
from relume.export.export_images import ExportImages, color_image
from relume.export.export_scene import FORMATS, export_report, format_of
from relume.export.write_glb import write_glb
from relume.look import Look
from relume.luts.lut_store import LUTS
from relume.scene.model import Glass, Light, Material, Scene
from relume.scene.texture_encoding import decode
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.import_scene import import_scene
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface
from relume_bench.export_validators import find_glb_errors


def written(path: Path, scene: Scene, look: dict[str, Any] | None = None, **variants: dict[str, Any]) -> dict[str, Any]:
    """Write a file and return its JSON."""
    write_glb(export_of(scene, look, **variants), path)
    data = path.read_bytes()
    magic, glb_version, length = struct.unpack_from("<4sII", data)
    assert (magic, glb_version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    document: dict[str, Any] = json.loads(data[20 : 20 + size])
    return document


def look_of(scene: Scene) -> Look:
    return look_of_scene(scene, {}, "look")


def test_every_material_is_read_again_with_its_terms(tmp_path: Path) -> None:
    scene = sample_scene()
    written(tmp_path / "a.glb", scene)
    again = import_scene(tmp_path / "a.glb", "again", scene.environment)
    original, read = look_of(scene).materials, look_of(again).materials
    assert [*original] == [*read]
    for name in original:
        assert [term["model"] for term in read[name].terms] == [term["model"] for term in original[name].terms]
        for term, expected in zip(read[name].terms, original[name].terms, strict=True):
            assert term["color"] == pytest.approx(expected["color"], abs=1e-4), name
            for key, value in expected["params"].items():
                assert np.broadcast_to(term["params"][key], 3) == pytest.approx(np.broadcast_to(value, 3), abs=1e-4)
            if name != "Leaf":  # whose opacity comes with a white image
                assert term["texture"] == expected["texture"]
            assert term.get("roughness_map") == expected.get("roughness_map")
    assert [w.severity for w in again.warnings] == ["approximated"] * len(again.warnings)


def test_textures_are_the_same_bytes(tmp_path: Path) -> None:
    scene = sample_scene()
    written(tmp_path / "a.glb", scene)
    material, again = scene.materials[0], import_scene(tmp_path / "a.glb", "again").materials[0]
    for channel in ("diffuse", "roughness"):
        assert (again.textures[channel].pixels == material.textures[channel].pixels).all()
        assert again.textures[channel].wrap == ("mirror", "clamp")
    assert again.textures["roughness"].encoding == material.textures["roughness"].encoding
    assert again.normal_map is not None
    assert material.normal_map is not None
    assert (again.normal_map.pixels == material.normal_map.pixels).all()
    assert again.normal_map.encoding == material.normal_map.encoding


def test_glass_opacity_emission_lights_and_cameras_are_read_again(tmp_path: Path) -> None:
    scene = sample_scene()
    written(tmp_path / "a.glb", scene)
    again = import_scene(tmp_path / "a.glb", "again")
    glass, expected = again.materials[4].glass, scene.materials[4].glass
    assert glass is not None
    assert expected is not None
    assert glass.tint == pytest.approx(expected.tint, abs=1e-5)
    assert glass.absorbed == pytest.approx(expected.absorbed, rel=1e-4)
    assert (glass.ior, glass.thickness, glass.roughness) == pytest.approx((1.3, 0.01, 0.2))
    opacity, leaf = again.materials[5].opacity, scene.materials[5].opacity
    assert opacity is not None
    assert leaf is not None
    assert (opacity.alpha == leaf.alpha).all()
    assert opacity.cutoff == 0.5
    lights = {light.name: light.fields for light in again.lights}
    for light in scene.lights:
        for key, value in light.fields.items():
            if isinstance(value, list):
                assert lights[light.name][key] == pytest.approx(value, abs=1e-5), light.name
            else:
                assert lights[light.name][key] == value
    (camera,) = again.cameras
    assert np.allclose(camera.to_world, scene.cameras[0].to_world)
    assert (camera.yfov, camera.aspect) == (0.7, 1.5)


def test_geometry_is_the_same(tmp_path: Path) -> None:
    scene = sample_scene()
    written(tmp_path / "a.glb", scene)
    for mesh, again in zip(scene.meshes, import_scene(tmp_path / "a.glb", "again").meshes, strict=True):
        assert again.name == mesh.name
        for array in ("positions", "normals", "uvs", "faces"):
            assert (getattr(again, array) == getattr(mesh, array)).all(), array


def test_the_look_decides(tmp_path: Path) -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), lights=(Light("Sun", {"kind": "directional"}),))
    look = {
        "materials": {"Wall": {"terms": [{"model": "lambert", "color": [0.2, 0.4, 0.6]}]}},
        "lights": {
            "Sun": {"intensity": 2.0, "color": [1.0, 0.5, 0.25], "emission": [3.0, 3.0, 3.0]},
            "Off": {"kind": "point", "enabled": False},
        },
    }
    document = written(tmp_path / "a.glb", scene, look)
    (material,) = document["materials"]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([0.2, 0.4, 0.6, 1.0])
    assert material["extensions"]["KHR_materials_specular"]["specularFactor"] == 0
    sun, off = document["extensions"]["KHR_lights_punctual"]["lights"]
    assert (sun["intensity"], sun["color"]) == (pytest.approx(6 * 683), [1.0, 0.5, 0.25])
    assert off["intensity"] == 0


def test_a_rectangle_is_an_emissive_quad_that_faces_its_direction(tmp_path: Path) -> None:
    fields = {
        "kind": "rectangle",
        "position": [0.0, 2.0, 0.0],
        "direction": [0.0, -1.0, 0.0],
        "size": [2.0, 1.0],
        "rotation": 30.0,
        "emission": [8.0, 4.0, 2.0],
    }
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), lights=(Light("Panel", fields),))
    written(tmp_path / "a.glb", scene)
    again = import_scene(tmp_path / "a.glb", "again")
    panel = again.meshes[1]
    assert panel.normals == pytest.approx(np.tile([0, -1, 0], (6, 1)), abs=1e-6)
    a, b, c = panel.positions[panel.faces[0]]
    assert np.cross(b - a, c - a)[1] < 0
    sides = sorted([np.linalg.norm(b - a), np.linalg.norm(c - b)])
    assert sides == pytest.approx([1.0, 2.0])
    assert panel.positions.mean(axis=0) == pytest.approx([0, 2, 0], abs=1e-6)
    assert again.lights[0].fields["emission"] == pytest.approx([8, 4, 2])
    report = export_report(export_of(scene), FORMATS["glb"])
    assert any("visible emissive meshes" in sentence for sentence in report.omitted)


@pytest.mark.parametrize(
    ("fields", "low", "high"),
    [
        ({"kind": "disc", "direction": [0.0, -1.0, 0.0], "radius": 0.5}, [-0.5, 2.0, -0.5], [0.5, 2.0, 0.5]),
        ({"kind": "sphere", "radius": 0.5}, [-0.5, 1.5, -0.5], [0.5, 2.5, 0.5]),
        (
            {"kind": "tube", "direction": [0.0, 0.0, 2.0], "radius": 0.1, "length": 3.0},
            [-0.1, 1.9, -1.5],
            [0.1, 2.1, 1.5],
        ),
    ],
)
def test_shapes_are_emissive_meshes_of_their_size(
    tmp_path: Path, fields: dict[str, Any], low: list[float], high: list[float]
) -> None:
    light = Light("Key", {"position": [0.0, 2.0, 0.0], "emission": [8.0, 4.0, 2.0], **fields})
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), lights=(light,))
    written(tmp_path / "a.glb", scene)
    report = export_report(export_of(scene), FORMATS["glb"])
    assert any("visible emissive meshes" in sentence for sentence in report.omitted)
    mesh = import_scene(tmp_path / "a.glb", "again").meshes[1]
    np.testing.assert_allclose(mesh.positions.min(axis=0), low, atol=0.02)
    np.testing.assert_allclose(mesh.positions.max(axis=0), high, atol=0.02)
    a, b, c = mesh.positions[mesh.faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a) * mesh.normals[mesh.faces[:, 0]]).sum(axis=1).min() > 0


def test_saved_looks_are_variants_of_the_materials_that_differ(tmp_path: Path) -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), Material("Ball", terms_of(METAL)))
    red = {"materials": {"Wall": {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}
    document = written(tmp_path / "a.glb", scene, None, **{"Red \U0001f534": red, 'a/b "c"': {}})
    assert len(document["materials"]) == 3
    again = import_scene(tmp_path / "a.glb", "again")
    names = [variant["name"] for variant in document["extensions"]["KHR_materials_variants"]["variants"]]
    assert names == ["Red 🔴", 'a/b "c"']
    assert [*again.variants] == ["Red 🔴", 'a-b "c"']  # as imports name looks
    assert [*again.variants["Red \U0001f534"]["materials"]] == ["Wall"]
    assert again.variants["Red \U0001f534"]["materials"]["Wall"]["terms"][0]["color"] == pytest.approx([0.8, 0.1, 0.1])
    assert again.variants['a-b "c"']["materials"] == {}


def test_variants_of_the_file_come_back_unless_a_look_has_their_name(tmp_path: Path) -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), Material("Ball", terms_of(METAL)))
    red, blue, green = (
        {"materials": {"Wall": {"terms": [{"model": "lambert", "color": color}]}}}
        for color in ([0.8, 0.1, 0.1], [0.1, 0.1, 0.8], [0.1, 0.8, 0.1])
    )
    written(tmp_path / "a.glb", replace(scene, variants={"Red": red, "Blue": blue}), None, Blue=green)
    again = import_scene(tmp_path / "a.glb", "again")
    colors = {name: look["materials"]["Wall"]["terms"][0]["color"] for name, look in again.variants.items()}
    assert colors == {"Red": pytest.approx([0.8, 0.1, 0.1]), "Blue": pytest.approx([0.1, 0.8, 0.1])}


def test_metal_and_dielectric_are_blended_per_texel(tmp_path: Path) -> None:
    """Texels of gold and of blue paint: base color and metalness are those of the file that they came from."""
    is_metal = checker([[0], [1]]).astype(np.float64)
    base = np.where(is_metal, [0.9, 0.7, 0.3], [0.1, 0.2, 0.8])
    diffuse, f0 = base * (1 - is_metal), 0.04 + (base - 0.04) * is_metal
    mean = f0.mean(axis=(0, 1))
    from relume.core.color import srgb_encode

    def texture(values: Any, scale: Any) -> Any:
        encoded = np.rint(255 * srgb_encode((values / scale).astype(np.float32)))
        return srgb_texture(encoded, tuple(np.asarray(scale, float)))

    textures = {"diffuse": texture(diffuse, np.ones(3)), "specular": texture(f0 / mean, f0.max(axis=(0, 1)) / mean)}
    surface = PbrSurface(np.ones(3), mean, 1.0, 0.3, 0.043537, textures)
    scene = scene_of(Material("Gilded", terms_of(surface), textures))
    document = written(tmp_path / "a.glb", scene)
    (material,) = document["materials"]
    assert "KHR_materials_specular" not in material.get("extensions", {})
    again = import_scene(tmp_path / "a.glb", "again").materials[0]
    for channel, expected in (("diffuse", diffuse), ("specular", f0 / mean)):
        got = again.textures[channel]
        assert decode(got.pixels, got.encoding) == pytest.approx(expected, abs=0.03), channel


def test_colored_highlights_of_a_diffuse_surface_become_specular_colors(tmp_path: Path) -> None:
    """No metal reflects 0.5 green above a red diffuse layer: f0 per texel is kept as the specular color."""
    image = checker([[255, 255, 255], [120, 120, 120]])
    textures = {"diffuse": srgb_texture(image), "specular": srgb_texture(image)}
    surface = PbrSurface(np.array([0.5, 0.1, 0.1]), np.array([0.02, 0.5, 0.02]), 1.0, 0.3, 0.0, textures)
    scene = scene_of(Material("Odd", terms_of(surface), textures))
    document = written(tmp_path / "a.glb", scene)
    assert "specularColorTexture" in document["materials"][0]["extensions"]["KHR_materials_specular"]
    again = import_scene(tmp_path / "a.glb", "again")
    original, read = scene.materials[0], again.materials[0]
    for channel, index, key in (("diffuse", 0, "color"), ("specular", 1, "f0")):
        values = []
        for material in (original, read):
            texture, term = material.textures[channel], material.terms[index]
            reflectance = np.array(term["color"]) * term.get("params", {}).get(key, 1.0)
            values.append(decode(texture.pixels, texture.encoding) * reflectance)
        assert values[1] == pytest.approx(values[0], abs=0.01), channel


def test_bright_textures_are_clamped_in_the_image_not_in_the_factor(tmp_path: Path) -> None:
    textures = {"diffuse": srgb_texture(checker([[255, 255, 255], [99, 99, 99]]), (0.5, 0.5, 0.5))}
    surface = PbrSurface(np.array([1.8, 1.8, 1.8]), np.zeros(3), 0.0, 1.0, 0.0, textures)
    document = written(tmp_path / "a.glb", scene_of(Material("Paper", terms_of(surface), textures)))
    assert document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx(
        [0.9, 0.9, 0.9, 1.0], abs=1e-5
    )
    textures = {"diffuse": srgb_texture(checker([[255, 255, 255], [99, 99, 99]]))}
    surface = PbrSurface(np.array([1.8, 1.8, 1.8]), np.zeros(3), 0.0, 1.0, 0.0, textures)
    written(tmp_path / "b.glb", scene_of(Material("Paper", terms_of(surface), textures)))
    again = import_scene(tmp_path / "b.glb", "again").materials[0]
    values = decode(again.textures["diffuse"].pixels, again.textures["diffuse"].encoding)
    assert values.max() == pytest.approx(1)
    assert values.min() == pytest.approx(1.8 * 0.1247, abs=0.01)


def test_factor_above_one_by_rounding_stays_a_factor() -> None:
    """Colors of terms have six digits."""
    texture = srgb_texture(checker([[255, 255, 255], [99, 99, 99]]))
    image = color_image(ExportImages(), "paper", texture, np.array([1 + 6e-7, 0.5, 0.25]))
    assert image.factor == (1.0, 0.5, 0.25)


def test_the_offset_is_given_back(tmp_path: Path) -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), offset=(500_000.25, 0.0, 4_500_000.5))
    written(tmp_path / "a.glb", scene)
    again = import_scene(tmp_path / "a.glb", "again", options=ImportOptions(recenter="always"))
    middle = (scene.meshes[0].positions.max(axis=0) + scene.meshes[0].positions.min(axis=0)) / 2
    assert again.offset == pytest.approx(np.array(scene.offset) + middle, abs=1e-3)


@pytest.mark.parametrize("name", [" ", "a/b", "..", 'say "hi"', "\U0001f600", "x" * 200, "a\\b\n"])
def test_any_name_is_written(tmp_path: Path, name: str) -> None:
    texture = {"diffuse": srgb_texture(checker([[255, 0, 0], [9, 9, 9]]))}
    surface = PbrSurface(PLASTIC.diffuse, PLASTIC.f0, 1.0, 0.4, 0.0, texture)
    document = written(tmp_path / "a.glb", scene_of(Material(name, terms_of(surface), texture)))
    assert document["materials"][0]["name"] == name
    assert all(set(image["name"]) <= set("abcdefghijklmnopqrstuvwxyz0123456789-.") for image in document["images"])


def test_a_look_of_another_scene_is_refused() -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)))
    with pytest.raises(ParameterError, match=r"look is 'Teapot'; give a look of the scene “Quads”"):
        look_of_scene(scene, {"materials": {"Teapot": {"terms": []}}}, "look")


def test_too_many_variants_are_refused() -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)))
    looks = {str(k): look_of_scene(scene, {}, "look") for k in range(101)}
    with pytest.raises(ParameterError, match="at most 100 looks"):
        prepare_export(scene, look_of_scene(scene, {}, "look"), looks)


def test_a_full_disk_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Any, data: Any, **fields: Any) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(glb_buffer.GlbBuffer, "add_view", fail)
    (tmp_path / "a.glb").write_bytes(b"old")
    with pytest.raises(DiskFullError, match=r"a\.glb cannot be written, the disk is full"):
        written(tmp_path / "a.glb", sample_scene())
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]
    assert (tmp_path / "a.glb").read_bytes() == b"old"
    assert filesystem.UNFINISHED not in os.listdir(tmp_path)


def test_a_scene_beyond_the_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glb_buffer, "MAX_CHUNK_BYTES", 1000)
    with pytest.raises(SceneError, match="the limit of GLB"):
        written(tmp_path / "a.glb", sample_scene())
    assert [*tmp_path.iterdir()] == []


def test_unknown_formats_are_refused() -> None:
    assert format_of(Path("A.GLB")).suffix == ".glb"
    with pytest.raises(ParameterError, match=r"a file name ending in \.glb, \.zip, \.usdz"):
        format_of(Path("a.blend"))


def test_report_lists_fits_and_what_is_missing() -> None:
    scene = scene_of(Material("Wall", terms_of(PLASTIC)), Material("Tray", ({"model": "ward", "color": [0.5] * 3},)))
    report = export_report(export_of(scene, {"display": {"exposure": 2.0}}), FORMATS["glb"])
    wall, tray = report.materials
    assert (wall.is_exact, tray.is_exact) == (True, False)
    assert report.fitted == (tray,)
    assert report.sentences()[0] == f"Material “Tray” is fitted, error {tray.error:.0%}."
    assert any("gray is not part of the file" in sentence for sentence in report.omitted)
    assert any("Exposure" in sentence for sentence in report.omitted)


@pytest.mark.parametrize(
    ("display", "setting"),
    [
        ({"temperature": 4000.0}, "white balance"),
        ({"tint": 5.0}, "white balance"),
        ({"contrast": 1.2}, "contrast"),
        ({"lut": "lut:0123456789abcdef"}, "LUT"),
        ({}, None),
    ],
)
def test_report_lists_display_settings(display: dict[str, Any], setting: str | None, tmp_path: Path) -> None:
    (tmp_path / "0123456789abcdef").mkdir()
    with LUTS.with_search_folder(tmp_path):
        export = export_of(scene_of(Material("Wall", terms_of(PLASTIC))), {"display": display})
        omitted = export_report(export, FORMATS["glb"]).omitted
    listed = [sentence for sentence in omitted if "of the display" in sentence]
    assert listed == ([] if setting is None else [f"The {setting} of the display is not exported."])


def test_extras_have_the_error(tmp_path: Path) -> None:
    scene = scene_of(Material("Tray", ({"model": "ward", "color": [0.5] * 3},)))
    document = written(tmp_path / "a.glb", scene)
    extras = document["materials"][0]["extras"]["relume"]
    assert 0.1 < extras["error"] < 0.4
    assert document["scenes"][0]["extras"]["relume"]["environment"]["map"] == "gray"


def test_changed_glass_is_exported(tmp_path: Path) -> None:
    scene = sample_scene()
    look = {"materials": {"Pane": {"glass": {"color": [0.2, 0.3, 0.4], "absorption": [0.0, 0.0, 0.0], "ior": 1.7}}}}
    written(tmp_path / "a.glb", scene, look)
    glass = import_scene(tmp_path / "a.glb", "again").materials[4].glass
    assert glass is not None
    assert (*glass.tint, *glass.absorbed, glass.ior) == pytest.approx((0.2, 0.3, 0.4, 0, 0, 0, 1.7), abs=1e-5)


def test_validator_has_no_errors(tmp_path: Path) -> None:
    anisotropic = Material("Brushed", terms_of(METAL, CoatLayer(anisotropy=0.6)))
    scene = sample_scene()
    extended = scene_of(*scene.materials, anisotropic, lights=scene.lights)
    look = {"lights": {"Panel": {"kind": "rectangle"}}}
    red = {"materials": {"Metal": {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}
    written(tmp_path / "a.glb", extended, look, red=red)
    errors = find_glb_errors(tmp_path / "a.glb")
    if errors is None:
        pytest.skip("RELUME_GLTF_VALIDATOR does not name the folder of the npm package gltf-validator")
    assert errors == []


def test_a_pane_without_a_highlight_has_no_reflectance(tmp_path: Path) -> None:
    material = Material("Pane", ({"model": "lambert", "color": [0.1, 0.1, 0.1]},), glass=Glass((0.5, 0.5, 0.5)))
    (written_material,) = written(tmp_path / "a.glb", scene_of(material))["materials"]
    assert written_material["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx([0.6] * 3)
    transmission = written_material["extensions"]["KHR_materials_transmission"]["transmissionFactor"]
    assert transmission == pytest.approx(5 / 6)
