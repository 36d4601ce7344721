"""USD exports, checked by usd-core and read again by our reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_scenes import METAL, PLASTIC, checker, export_of, sample_scene, scene_of, srgb_texture, terms_of

from relume.core.errors import DiskFullError
from relume.export import export_images
from relume.export.export_scene import FORMATS, export_report
from relume.export.write_usd import write_usd
from relume.scene.lens import Lens
from relume.scene.model import Light, Material, Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface
from relume_bench.export_validators import find_usd_errors

pytest.importorskip("pxr", reason="needs the package usd-core")


def exported(path: Path, scene: Scene, look: dict[str, Any] | None = None, **variants: dict[str, Any]) -> Scene:
    write_usd(export_of(scene, look, **variants), path)
    return import_scene(path, "again")


def test_the_package_is_compliant(tmp_path: Path) -> None:
    red = {"materials": {"Metal": {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}
    exported(tmp_path / "a.usdz", sample_scene(), {"lights": {"Panel": {"kind": "rectangle"}}}, red=red)
    assert find_usd_errors(tmp_path / "a.usdz") == []


def test_geometry_cameras_and_lights_are_read_again(tmp_path: Path) -> None:
    scene = sample_scene()
    scene = replace(scene, cameras=(replace(scene.cameras[0], lens=Lens(0.02, 3.0)),))
    panel = {
        "kind": "rectangle",
        "position": [1.0, 2.0, 3.0],
        "direction": [0.6, -0.8, 0.0],
        "rotation": 25.0,
        "size": [2.0, 1.0],
        "emission": [3.0, 2.0, 1.0],
    }
    placed = {"position": [1.0, 2.0, 3.0], "emission": [3.0, 2.0, 1.0]}
    shapes = {
        "Panel": panel,
        "Disc": {"kind": "disc", **placed, "direction": [0.6, -0.8, 0.0], "radius": 0.3},
        "Ball": {"kind": "sphere", **placed, "radius": 0.3},
        "Tube": {"kind": "tube", **placed, "direction": [0.0, 0.6, -0.8], "radius": 0.1, "length": 2.0},
        "Soft": {"kind": "directional", "direction": [0.6, -0.8, 0.0], "angle": 5.0, "emission": [3.0, 2.0, 1.0]},
    }
    again = exported(tmp_path / "a.usdz", scene, {"lights": shapes})
    originals = {mesh.name: mesh for mesh in scene.meshes}
    assert originals.keys() == {mesh.name for mesh in again.meshes}
    for read in again.meshes:
        mesh = originals[read.name]
        corners, read_corners = mesh.positions[mesh.faces], read.positions[read.faces]
        assert read_corners == pytest.approx(corners, abs=1e-6)
        if read.name in ("Textured", "Leaf"):  # others are read without UV coordinates
            assert read.uvs[read.faces] == pytest.approx(mesh.uvs[mesh.faces], abs=1e-6)
    (camera,) = again.cameras
    assert camera.to_world == pytest.approx(scene.cameras[0].to_world)
    assert (camera.yfov, camera.aspect) == pytest.approx((0.7, 1.5), rel=1e-5)
    assert camera.lens is not None
    assert (camera.lens.radius, camera.lens.focus_distance) == pytest.approx((0.02, 3.0), rel=1e-5)
    lights = {light.name: light.fields for light in again.lights}
    for light in (*scene.lights[1:], *(Light(name, shape) for name, shape in shapes.items())):
        for key, value in light.fields.items():
            got = lights[light.name][key]
            assert got == value if isinstance(value, str) else got == pytest.approx(value, abs=1e-4), (light.name, key)


def test_the_environment_keeps_its_directions(tmp_path: Path) -> None:
    radiance = np.random.default_rng(1).uniform(0.5, 2, (32, 64, 3)).astype(np.float32)
    from dataclasses import replace

    scene = scene_of(Material("Wall", terms_of(PLASTIC)))
    scene = replace(scene, environment=replace(scene.environment, radiance=radiance))
    again = exported(tmp_path / "a.usdz", scene, {"environment": {"intensity": 0.5, "color": [1.0, 0.5, 2.0]}})
    assert again.environment.radiance == pytest.approx(radiance * [0.5, 0.25, 1.0], rel=0.02, abs=0.02)


@pytest.mark.parametrize(
    ("surface", "coat"),
    [
        (PLASTIC, CoatLayer()),
        (METAL, CoatLayer()),
        (PLASTIC, CoatLayer(coat=0.8, coat_roughness=0.1)),
        (PLASTIC, CoatLayer(sheen=(0.3, 0.2, 0.1), sheen_roughness=0.5)),
    ],
    ids=["plastic", "metal", "coat", "sheen"],
)
def test_open_pbr_is_read_again_with_its_terms(tmp_path: Path, surface: PbrSurface, coat: CoatLayer) -> None:
    """Without UsdPreviewSurface, which our reader takes first, and which has no sheen."""
    from pxr import Usd, UsdShade

    scene = scene_of(Material("Wall", terms_of(surface, coat)))
    write_usd(export_of(scene), tmp_path / "a.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdz"))
    flat = stage.Flatten()
    flat_stage = Usd.Stage.Open(flat)
    UsdShade.Material.Get(flat_stage, "/Scene/Materials/Wall").GetSurfaceOutput().GetAttr().ClearConnections()
    flat_stage.RemovePrim("/Scene/Lights/environment")
    flat.Export(str(tmp_path / "b.usda"))
    read = import_scene(tmp_path / "b.usda", "again").materials[0]
    assert [term["model"] for term in read.terms] == [term["model"] for term in scene.materials[0].terms]
    for term, expected in zip(read.terms, scene.materials[0].terms, strict=True):
        assert term["color"] == pytest.approx(expected["color"], abs=1e-3)
        for key, value in expected.get("params", {}).items():
            assert np.broadcast_to(term["params"][key], 3) == pytest.approx(np.broadcast_to(value, 3), abs=2e-3), key


def test_preview_surface_has_the_images(tmp_path: Path) -> None:
    scene = sample_scene()
    again = {material.name: material for material in exported(tmp_path / "a.usdz", scene).materials}
    textured, original = again["Textured"], scene.materials[0]
    assert (textured.textures["diffuse"].pixels == original.textures["diffuse"].pixels).all()
    assert textured.textures["diffuse"].wrap == ("mirror", "clamp")
    assert textured.normal_map is not None
    leaf = again["Leaf"].opacity
    assert leaf is not None
    assert leaf.cutoff == 0.5
    assert (leaf.alpha == checker([255, 0])).all()
    assert again["Metal"].terms[-1]["params"]["f0"] == pytest.approx([0.9, 0.7, 0.3], abs=1e-4)


def test_looks_are_variants_of_the_variant_set(tmp_path: Path) -> None:
    from pxr import Usd, UsdShade

    scene = scene_of(Material("Wall", terms_of(PLASTIC)), Material("Ball", terms_of(METAL)))
    red = {"materials": {"Wall": {"terms": [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]}}}
    write_usd(export_of(scene, None, **{"Red \U0001f534": red, "1/2": {}}), tmp_path / "a.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdz"))
    variants = stage.GetDefaultPrim().GetVariantSet("look")
    assert variants.GetVariantNames() == ["1_2", "Red__", "exported"]
    assert variants.GetVariantSelection() == "exported"

    def bound() -> str:
        prim = stage.GetPrimAtPath("/Scene/Meshes/Wall")
        return str(UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPath())

    original = bound()
    variants.SetVariantSelection("1_2")
    assert bound() == original
    variants.SetVariantSelection("Red__")
    assert bound() != original


@pytest.mark.parametrize("name", [" ", "a/b", "..", 'say "hi"', "\U0001f600", "x" * 200, "9"])
def test_any_name_is_written(tmp_path: Path, name: str) -> None:
    texture = {"diffuse": srgb_texture(checker([[255, 0, 0], [9, 9, 9]]))}
    surface = PbrSurface(PLASTIC.diffuse, PLASTIC.f0, 1.0, 0.4, 0.0, texture)
    again = exported(tmp_path / "a.usdz", scene_of(Material(name, terms_of(surface), texture)))
    assert "diffuse" in again.materials[0].textures
    assert find_usd_errors(tmp_path / "a.usdz") == []


def test_a_full_disk_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Any, file: str) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(export_images.ExportImages, "png", fail)
    with pytest.raises(DiskFullError, match=r"a\.usdz cannot be written, the disk is full"):
        write_usd(export_of(sample_scene()), tmp_path / "a.usdz")
    assert [*tmp_path.iterdir()] == []


def test_the_report_names_what_preview_surfaces_lack() -> None:
    scene = scene_of(Material("Felt", terms_of(PLASTIC, CoatLayer(sheen=(0.3, 0.2, 0.1), sheen_roughness=0.5))))
    report = export_report(export_of(scene), FORMATS["usd"])
    assert report.omitted == ("Programs that read UsdPreviewSurface alone show “Felt” simplified.",)


def test_the_report_does_not_say_that_area_lights_become_meshes() -> None:
    panel = Light("Panel", {"kind": "rectangle", "position": [0.0, 1.0, 2.0], "emission": [2.0, 2.0, 2.0]})
    for name, sentence in (("usd", ()), ("glb", ("Area lights become visible emissive meshes.",))):
        omitted = export_report(
            export_of(scene_of(Material("Felt", terms_of(PLASTIC)), lights=(panel,))), FORMATS[name]
        ).omitted
        assert tuple(each for each in omitted if "meshes" in each) == sentence
