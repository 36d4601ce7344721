"""Lights of USD in relume's kinds and units, and domes as environments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment_files import write_map
from usd_text import Files, imported, quad, usda

from relume.assets.environments.equirect import lookup
from relume.look import default_look
from relume.scene.model import Scene

pytest.importorskip("pxr.Usd")


def lit(kind: str, inputs: str = "", metadata: str = "", schemas: str = "") -> Scene:
    """A quad and a light at (1, 2, 3)."""
    light = f"""
def {kind} "Key" (
    {schemas}
)
{{
    {inputs}
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}"""
    return imported(usda(quad() + light, metadata))


def fields(scene: Scene) -> dict[str, Any]:
    (light,) = scene.lights
    assert light.name == "Key"
    assert default_look(scene.materials, scene.lights)["lights"]["Key"]["kind"] == light.fields["kind"]
    return light.fields


SUN = np.pi * np.sin(np.radians(0.53) / 2) ** 2


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ("float inputs:intensity = 1000", 1000 * SUN),
        ("float inputs:intensity = 1000\nfloat inputs:exposure = 2", 4000 * SUN),
        ("float inputs:intensity = 3\nbool inputs:normalize = 1", 3),
        ("float inputs:intensity = 3\nfloat inputs:angle = 0", 3),
        ("float inputs:intensity = 3\nfloat inputs:angle = 180", 3 * np.pi),
    ],
)
def test_distant_lights_have_their_irradiance(inputs: str, expected: float) -> None:
    scene = lit("DistantLight", f"{inputs}\ncolor3f inputs:color = (1, .5, 0)")
    light = fields(scene)
    assert light["kind"] == "directional"
    angle = 0 if "angle = 0" in inputs else 30 if "angle = 180" in inputs else 0.53
    assert light["angle"] == pytest.approx(angle)
    assert any("is 30°, not 180°" in warning for warning in scene.warnings) == (angle == 30)
    np.testing.assert_allclose(light["direction"], [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(light["emission"], np.array([1, 0.5, 0]) * expected, rtol=1e-5)


@pytest.mark.parametrize(("author", "factor"), [("Blender v5.0.1", 4), ("Blender v4.1.0", 1), ("Houdini", 1)])
def test_distant_lights_of_blender_have_their_irradiance(author: str, factor: float) -> None:
    """Blender 5 writes a sun of 3 W/m² as 0.75."""
    scene = lit("DistantLight", "float inputs:intensity = 0.75\nbool inputs:normalize = 1", f'doc = "{author}"')
    assert fields(scene)["emission"] == pytest.approx([0.75 * factor] * 3)
    assert any("4 times as bright as in the file" in warning for warning in scene.warnings) == (factor == 4)


@pytest.mark.parametrize(
    ("normalize", "metadata", "radiance"),
    [(0, "", 5), (1, "", 5 / 6), (0, "metersPerUnit = 0.1", 5), (1, "metersPerUnit = 0.1", 5 / 6)],
)
def test_rectangles_have_radiance_or_power_over_their_area(normalize: int, metadata: str, radiance: float) -> None:
    inputs = f"""float inputs:intensity = 5
    float inputs:width = 2
    float inputs:height = 3
    bool inputs:normalize = {normalize}"""
    light = fields(lit("RectLight", inputs, metadata))
    meters = 0.1 if metadata else 1
    assert light["kind"] == "rectangle"
    np.testing.assert_allclose(light["position"], np.array([1, 2, 3]) * meters)
    np.testing.assert_allclose(light["direction"], [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(light["size"], [2 * meters, 3 * meters], rtol=1e-6)
    np.testing.assert_allclose(light["emission"], radiance, rtol=1e-6)
    assert light["rotation"] == pytest.approx(0)


def test_rotated_rectangles_keep_their_sides() -> None:
    body = """
def RectLight "Key"
{
    float inputs:width = 2
    float inputs:height = 1
    float3 xformOp:rotateZYX = (0, 0, 30)
    uniform token[] xformOpOrder = ["xformOp:rotateZYX"]
}"""
    rotation = imported(usda(quad() + body)).lights[0].fields["rotation"]
    # seen along −Z, a turn by +30° about +Z is one by −30° about the direction
    assert rotation == pytest.approx(-30)


def test_spheres_and_cylinders_have_their_shape_and_radiance() -> None:
    sphere = fields(lit("SphereLight", "float inputs:intensity = 10\nfloat inputs:radius = .2", "metersPerUnit = 0.5"))
    assert sphere["kind"] == "sphere"
    np.testing.assert_allclose(sphere["position"], [0.5, 1, 1.5])
    assert sphere["radius"] == pytest.approx(0.1)
    np.testing.assert_allclose(sphere["emission"], 10, rtol=1e-5)
    power = "float inputs:intensity = 10\nbool inputs:normalize = 1"
    normalized = fields(lit("SphereLight", power, "metersPerUnit = 0.5"))
    np.testing.assert_allclose(normalized["emission"], 10 / (4 * np.pi * 0.5**2), rtol=1e-6)
    inputs = "float inputs:intensity = 4\nfloat inputs:length = 3\nfloat inputs:radius = .5"
    tube = fields(lit("CylinderLight", inputs))
    assert (tube["kind"], tube["radius"], tube["length"]) == ("tube", pytest.approx(0.5), pytest.approx(3))
    np.testing.assert_allclose(tube["direction"], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(tube["emission"], 4, rtol=1e-6)


def test_spheres_treated_as_points_are_points_of_the_same_power() -> None:
    point = "float inputs:intensity = 10\nfloat inputs:radius = .2\nbool treatAsPoint = 1"
    light = fields(lit("SphereLight", point))
    assert light["kind"] == "point"
    np.testing.assert_allclose(light["emission"], 10 * np.pi * 0.2**2, rtol=1e-5)
    normalized = fields(
        lit("SphereLight", "float inputs:intensity = 10\nfloat inputs:radius = 0\nbool inputs:normalize = 1")
    )
    assert normalized["kind"] == "point"
    np.testing.assert_allclose(normalized["emission"], 2.5, rtol=1e-6)


def test_tiny_spheres_keep_their_power() -> None:
    light = fields(lit("SphereLight", "float inputs:intensity = 10\nfloat inputs:radius = 1e-5"))
    assert light["radius"] == pytest.approx(1e-4)
    np.testing.assert_allclose(light["emission"], 0.1, rtol=1e-5)


@pytest.mark.parametrize(("scale", "is_even"), [((2, 2, 7), True), ((1, 4, 1), False)])
def test_disks_are_discs_of_their_area(scale: tuple[float, float, float], is_even: bool) -> None:
    body = f"""
def DiskLight "Key"
{{
    float inputs:intensity = 3
    float inputs:radius = 0.5
    float3 xformOp:scale = {scale}
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}"""
    scene = imported(usda(quad() + body))
    light = scene.lights[0].fields
    assert light["kind"] == "disc"
    assert light["radius"] == pytest.approx(0.5 * 2)
    np.testing.assert_allclose(light["emission"], 3, rtol=1e-6)
    assert any("disc of the same area" in warning for warning in scene.warnings) != is_even


def test_cones_make_spots() -> None:
    inputs = """float inputs:intensity = 2
    float inputs:radius = .5
    float inputs:shaping:cone:angle = 40
    float inputs:shaping:cone:softness = .25"""
    light = fields(lit("SphereLight", inputs, schemas='prepend apiSchemas = ["ShapingAPI"]'))
    assert light["kind"] == "spot"
    np.testing.assert_allclose(light["cone"], [30, 40])
    np.testing.assert_allclose(light["emission"], 2 * np.pi * 0.25, rtol=1e-6)


@pytest.mark.parametrize("kind", ["DistantLight", "RectLight"])
def test_ies_files_of_lights_that_have_none_are_a_warning(kind: str) -> None:
    scene = lit(kind, "asset inputs:shaping:ies:file = @web.ies@", schemas='prepend apiSchemas = ["ShapingAPI"]')
    assert [warning.severity for warning in scene.warnings if "IES file of light" in warning] == ["unsupported"]


def test_color_temperatures_are_those_of_usd() -> None:
    from pxr import UsdLux

    inputs = "float inputs:angle = 0\nfloat inputs:intensity = 1\nbool inputs:enableColorTemperature = 1"
    light = fields(lit("DistantLight", f"{inputs}\nfloat inputs:colorTemperature = 3000"))
    np.testing.assert_allclose(light["emission"], UsdLux.BlackbodyTemperatureAsRgb(3000), rtol=1e-5)


def test_mesh_lights_emit_from_their_material() -> None:
    panel = quad(
        "Panel", "float inputs:light:intensity = 6\nfloat inputs:intensity = 6", 'prepend apiSchemas = ["MeshLightAPI"]'
    )
    scene = imported(usda(panel + quad("Wall")))
    (light,) = scene.lights
    assert light.fields["kind"] == "mesh"
    np.testing.assert_allclose(light.fields["emission"], 6)
    shown = {scene.materials[mesh.material].name for mesh in scene.meshes if mesh.name == "Panel"}
    assert shown == {light.fields["material"]}


def test_invisible_and_dark_lights_are_none() -> None:
    assert lit("DistantLight", 'token visibility = "invisible"').lights == ()
    dark = lit("DistantLight", "float inputs:intensity = 0")
    assert dark.lights == ()
    assert list(dark.warnings) == ["Skipped light “Key”: it emits no light."]


def dome_scene(inputs: str, files: dict[str, bytes], metadata: str = "") -> Scene:
    return imported(usda(quad() + f'def DomeLight "Sky"\n{{\n{inputs}\n}}', metadata), Files(files), environment=None)


def directions(*rows: list[float]) -> np.ndarray:
    return np.array(rows, np.float32)


def panorama(folder: Path) -> bytes:
    """A map of USD: red in the middle, green a quarter to its right, blue above."""
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[:, 14:18, 0] = 1
    pixels[:, 22:26, 1] = 1
    pixels[:3] = [0, 0, 1]
    write_map(folder / "sky.hdr", pixels)
    return (folder / "sky.hdr").read_bytes()


def test_domes_are_environments_whose_center_faces_plus_z(tmp_path: Path) -> None:
    scene = dome_scene(
        "asset inputs:texture:file = @sky.hdr@\nfloat inputs:intensity = 2", {"sky.hdr": panorama(tmp_path)}
    )
    shown = lookup(scene.environment.radiance, directions([0, 0, 1], [-1, 0, 0], [1, 0, 0], [0, 1, 0]))
    np.testing.assert_allclose(shown, [[2, 0, 0], [0, 2, 0], [0, 0, 0], [0, 0, 2]], atol=0.05)


def test_domes_turn_with_their_prim_and_with_the_up_axis(tmp_path: Path) -> None:
    turned = """asset inputs:texture:file = @sky.hdr@
    float3 xformOp:rotateXYZ = (0, 90, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]"""
    scene = dome_scene(turned, {"sky.hdr": panorama(tmp_path)})
    np.testing.assert_allclose(
        lookup(scene.environment.radiance, directions([1, 0, 0], [0, 0, 1])), [[1, 0, 0], [0, 1, 0]], atol=0.05
    )
    upright = """asset inputs:texture:file = @sky.hdr@
    float3 xformOp:rotateXYZ = (90, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]"""
    z_up = dome_scene(upright, {"sky.hdr": panorama(tmp_path)}, 'upAxis = "Z"')
    np.testing.assert_allclose(
        lookup(z_up.environment.radiance, directions([0, 1, 0], [0, 0, 1])), [[0, 0, 1], [1, 0, 0]], atol=0.05
    )


@pytest.mark.parametrize(
    ("projection", "read_as"),
    [("mirroredBall", "a mirror ball"), ("angular", "an angular map"), ("cubeMap", "an angular map")],
)
def test_domes_may_have_the_projection_of_light_probes(tmp_path: Path, projection: str, read_as: str) -> None:
    """A disk that is white around its center and black at its rim."""
    t = (np.arange(64) + 0.5) / 32 - 1
    radius = np.hypot(*np.meshgrid(t, t))
    write_map(tmp_path / "probe.exr", np.repeat((radius < 0.6)[..., None], 3, axis=2).astype(np.float32))
    inputs = f'asset inputs:texture:file = @probe.exr@\ntoken inputs:texture:format = "{projection}"'
    scene = dome_scene(inputs, {"probe.exr": (tmp_path / "probe.exr").read_bytes()})
    white = 2 * np.arcsin(0.6) if projection == "mirroredBall" else 0.6 * np.pi  # angle from the front, +Z
    angles = np.array([0, white - 0.15, white + 0.15, np.pi])
    shown = lookup(scene.environment.radiance, directions(*np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)))
    np.testing.assert_allclose(shown[:, 0], [1, 1, 0, 0], atol=0.05)
    assert any(f"read as {read_as}" in warning for warning in scene.warnings)
    assert any("not as “cubeMap”" in warning for warning in scene.warnings) == (projection == "cubeMap")


def test_domes_without_an_image_are_uniform_and_a_missing_one_is_said() -> None:
    plain = dome_scene("color3f inputs:color = (1, .5, .25)\nfloat inputs:exposure = 1", {})
    np.testing.assert_allclose(plain.environment.radiance, np.broadcast_to([2, 1, 0.5], (2, 4, 3)))
    missing = dome_scene("asset inputs:texture:file = @sky.hdr@", {})
    np.testing.assert_allclose(missing.environment.radiance, 1)
    assert any("Missing image “sky.hdr”" in warning for warning in missing.warnings)
