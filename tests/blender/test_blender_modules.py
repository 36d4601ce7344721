"""Lights, names, files and records of the Blender add-on, without Blender."""

from __future__ import annotations

import asyncio
import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relume.lights.local_lights import rectangle
from relume.look.model import LightGeometry
from relume.scene.unique_names import unique_name
from relume.scene_io.gltf.cameras import make_slug
from relume.scene_io.import_scene import import_scene
from relume_blender.background_task import BackgroundTask
from relume_blender.glb import Glb, add_lights, material_swatches, scene_key, slugs, unique_names
from relume_blender.lights import BlenderLight, changed_fields, from_look, to_look
from relume_blender.snapshot import Sent, make_snapshot
from relume_blender.surfaces import fit_sentences, principled_values

NAMES = ["Key", "Key", "", "  ", "a/b~c", 'say "hi" \\', "灯 😀", "x" * 300, "x" * 299, "tab\there", "\ud800", "Key 2"]


def turned(*columns: list[float]) -> np.ndarray:
    """A rigid transform of these axes and position."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack(columns)
    return matrix


TILTED = turned([0.6, 0.0, -0.8], [0.0, 1.0, 0.0], [0.8, 0.0, 0.6], [1.0, 2.0, 3.0])
LIGHTS = {
    "point": BlenderLight("POINT", 60.0, (1.0, 0.8, 0.6), turned([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 2, 3])),
    "spot": BlenderLight("SPOT", 80.0, (1.0, 0.5, 0.2), TILTED, spot_size=0.8, spot_blend=0.3),
    "sun": BlenderLight("SUN", 3.0, (0.9, 1.0, 0.9), TILTED),
    "area": BlenderLight("AREA", 40.0, (1.0, 1.0, 0.5), TILTED, size=(1.0, 0.5)),
    "down": BlenderLight(
        "AREA", 40.0, (1.0, 1.0, 0.5), turned([0, 1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 3]), size=(2.0, 1.0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_come_back(name: str) -> None:
    light = LIGHTS[name]
    back = from_look(to_look(light))
    ignored = {"to_world"} if light.type in ("POINT", "SUN", "SPOT") else set()
    assert changed_fields(light, back) - ignored == set()
    np.testing.assert_allclose(
        back.to_world[:3, 2],
        light.to_world[:3, 2] * (light.type != "POINT") + [0, 0, light.type == "POINT"],
        atol=1e-12,
    )
    assert light.type == "SUN" or np.allclose(back.to_world[:3, 3], light.to_world[:3, 3])


@pytest.mark.parametrize(
    ("shape", "power"),
    [
        ({"kind": "disc", "direction": [0.0, -1.0, 0.0], "radius": 0.5}, 8 * np.pi * np.pi * 0.25),
        ({"kind": "sphere", "radius": 0.5}, 8 * np.pi * 4 * np.pi * 0.25),
        ({"kind": "tube", "direction": [1.0, 0.0, 0.0], "radius": 0.1, "length": 2.0}, 8 * np.pi * 0.4 * np.pi),
    ],
)
def test_shapes_that_blender_lacks_keep_their_power(shape: dict[str, Any], power: float) -> None:
    common = {"intensity": 2.0, "color": [1.0, 0.5, 0.25], "emission": [4.0] * 3, "position": [1.0, 2.0, 3.0]}
    light = from_look({**common, **shape})
    assert light.power == pytest.approx(power)
    assert light.type == ("AREA" if shape["kind"] == "disc" else "POINT")
    assert light.color == (1.0, 0.5, 0.25)


def test_strengths_are_radiometric() -> None:
    point, spot, sun, area = (to_look(LIGHTS[name]) for name in ("point", "spot", "sun", "area"))
    assert point["emission"] == pytest.approx([60 / (4 * np.pi)] * 3)
    assert spot["emission"] == pytest.approx([80 / (4 * np.pi)] * 3)
    assert sun["emission"] == [3.0] * 3
    assert area["emission"] == pytest.approx([40 / (np.pi * 0.5)] * 3)
    assert point["position"] == pytest.approx([1, 3, -2])
    assert sun["direction"] == pytest.approx([-0.8, -0.6, 0.0])


def test_spot_has_the_flux_of_blender() -> None:
    """Means over the cone of the square of relume and of the smoothstep of Cycles."""
    inner, outer = np.cos(np.radians(to_look(LIGHTS["spot"])["cone"]))
    cosine = np.linspace(outer, 1, 100_001)
    square = np.clip((cosine - outer) / (inner - outer), 0, 1) ** 2
    step = np.clip((cosine - outer) / (0.3 * (1 - outer)), 0, 1)
    assert square.mean() == pytest.approx((step**2 * (3 - 2 * step)).mean(), rel=1e-4)


@pytest.mark.parametrize("name", ["area", "down"])
def test_rectangles_have_the_edges_of_blender(name: str) -> None:
    light, look = LIGHTS[name], to_look(LIGHTS[name])
    fields = {name: look[name] for name in ("position", "direction", "rotation", "size")}
    geometry = LightGeometry("rectangle", **fields)
    _, edges = rectangle(geometry)
    x, y, z = light.to_world[:3, 1]
    height_axis = np.array([x, z, -y])
    np.testing.assert_allclose(edges[1], look["size"][1] * height_axis, atol=1e-9)
    assert np.linalg.norm(edges[0]) == pytest.approx(look["size"][0])


def test_disk_has_its_area() -> None:
    disk = BlenderLight("AREA", 10.0, (1.0, 1.0, 1.0), TILTED, size=(2.0, 1.0), is_round=True)
    look = to_look(disk)
    assert np.prod(look["size"]) == pytest.approx(np.pi / 4 * 2)
    assert look["emission"][0] == pytest.approx(10 / (np.pi * np.pi / 2))


def test_server_keeps_names() -> None:
    unique = unique_names(NAMES)
    assert len(set(unique)) == len(NAMES)
    used: dict[str, int] = {}
    assert [unique_name(name, used) for name in unique] == unique
    views = slugs(NAMES)
    used_slugs: dict[str, int] = {}
    assert [make_slug(name, used_slugs) for name in views] == views


def triangle(*materials: dict[str, Any]) -> Glb:
    swatches = material_swatches(Glb({"materials": [*materials]}, b""))
    return Glb.from_bytes(swatches.to_bytes())


def test_file_has_the_lights_of_the_look(tmp_path: Path) -> None:
    glb = triangle({"name": "Gray"})
    looks = {name: to_look(light) for name, light in LIGHTS.items()}
    add_lights(glb.document, looks)
    (tmp_path / "a.glb").write_bytes(glb.to_bytes())
    scene = import_scene(tmp_path / "a.glb", "a")
    by_name = {light.name: light.fields for light in scene.lights}
    assert set(by_name) == {"point", "spot", "sun"}
    for name, fields in by_name.items():
        strength = np.multiply(looks[name]["emission"], looks[name]["color"])
        np.testing.assert_allclose(fields["emission"], strength, rtol=1e-6)
        for field in ("position", "direction", "cone"):
            np.testing.assert_allclose(fields.get(field, []), looks[name].get(field, []), atol=1e-6)


def test_key_is_of_what_a_look_cannot_change() -> None:
    def key(**changes: Any) -> str:
        pbr = {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "roughnessFactor": 0.5} | changes.pop("pbr", {})
        return scene_key(triangle({"name": "A", "pbrMetallicRoughness": pbr, **changes}))

    original = key()
    assert key(pbr={"baseColorFactor": [1.0, 0.5, 0.5, 1.0], "roughnessFactor": 0.1, "metallicFactor": 0.5}) == original
    assert key(emissiveFactor=[1, 1, 1], extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 1}}) == original
    assert key(pbr={"baseColorFactor": [0.5, 0.5, 0.5, 0.9]}) != original
    assert key(alphaMode="BLEND") != original
    assert key(extensions={"KHR_materials_transmission": {"transmissionFactor": 1}}) != original
    textured = {"baseColorTexture": {"index": 0}}
    assert key(pbr=textured) != original
    assert key(pbr={**textured, "metallicFactor": 0.5}) != key(pbr=textured)
    assert scene_key(Glb(triangle({"name": "A"}).document, b"x")) != scene_key(triangle({"name": "A"}))


def test_values_of_the_principled_bsdf() -> None:
    material = {
        "name": "Paint",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 0.125, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.3,
        },
        "emissiveFactor": [1.0, 0.5, 0.0],
        "extensions": {
            "KHR_materials_ior": {"ior": 1.45},
            "KHR_materials_specular": {"specularFactor": 0.6, "specularColorFactor": [1.0, 0.9, 0.8]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.1},
            "KHR_materials_sheen": {"sheenColorFactor": [0.2, 0.1, 0.0], "sheenRoughnessFactor": 0.4},
            "KHR_materials_emissive_strength": {"emissiveStrength": 5.0},
        },
        "extras": {"relume": {"error": 0.16, "omitted": ["The BTF is exported as its mean."]}},
    }
    values = principled_values(material)
    assert values == {
        "Base Color": (0.5, 0.25, 0.125), "Metallic": 0.0, "Roughness": 0.3, "IOR": 1.45, "Specular IOR Level": 0.3,
        "Specular Tint": (1.0, 0.9, 0.8), "Coat Weight": 0.7, "Coat Roughness": 0.1, "Sheen Weight": 0.2,
        "Sheen Tint": (1.0, 0.5, 0.0), "Sheen Roughness": 0.4, "Emission Color": (1.0, 0.5, 0.0),
        "Emission Strength": 5.0, "Anisotropic": 0.0, "Transmission Weight": 0.0,
    }  # fmt: skip
    assert fit_sentences(material) == [
        "Material “Paint” is the nearest Principled BSDF, 16% off.", "The BTF is exported as its mean.",
    ]  # fmt: skip
    metal = principled_values({"name": "Gold", "pbrMetallicRoughness": {"metallicFactor": 1.0}})
    assert {"IOR", "Specular IOR Level", "Emission Color"} & metal.keys() == set()
    assert metal["Emission Strength"] == 0.0


def test_snapshot_names_materials_and_cameras(tmp_path: Path) -> None:
    glb = triangle({"name": "a/b"}, {}, {"name": "Key"})
    glb.document["cameras"] = [{"name": "Küche 1", "type": "perspective"}, {"name": "Top", "type": "orthographic"}]

    def snapshot(camera: str | None) -> Any:
        lights = {"Key": to_look(LIGHTS["point"])}
        return make_snapshot("\n", glb.to_bytes(), (tmp_path / "w.exr", "key"), lights, {}, camera, ())

    made = snapshot("Küche 1")
    assert (made.name, made.views) == ("Scene", ("kuche-1",))
    assert made.materials == {"a-b": "a/b", "unnamed": "", "Key": "Key"}
    assert made.lights == {"Key 2": "Key"}
    assert [snapshot(name).views for name in ("Top", "gone", None)] == [(), (), ()]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"url": 1}', "nonsense", "null"])
def test_damaged_record_is_none(text: str) -> None:
    assert Sent.from_text(text) is None


def test_record_comes_back() -> None:
    sent = Sent(
        "http://a", "1", "2", "http://a/?share=x", {"lights": {}}, "k", "e", {"A": "a"}, {}, {"A": {"name": "A"}}
    )
    assert Sent.from_text(sent.to_text()) == sent
    assert json.loads(sent.to_text())["scene"] == "1"


@pytest.mark.parametrize("data", [b"", b"glTF", b"glTF" + bytes(16), b"PK" + bytes(30)])
def test_other_files_are_not_glb(data: bytes) -> None:
    with pytest.raises(ValueError, match="not GLB"):
        Glb.from_bytes(data)


def test_task_reports_and_can_be_canceled() -> None:
    started, cleaned = threading.Event(), threading.Event()

    async def work(report: Any) -> None:
        report("Baking", 0.5)
        started.set()
        try:
            await asyncio.sleep(60)
        finally:
            cleaned.set()

    task = BackgroundTask(work)
    assert started.wait(10)
    assert (task.text, task.progress, task.is_done) == ("Baking", 0.5, False)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        task.result()
    assert cleaned.is_set()
    task.cancel()  # after its end: nothing happens


def test_task_has_its_result_and_its_error() -> None:
    async def fail(report: Any) -> None:
        raise ValueError("no")

    async def answer(report: Any) -> int:
        return 42

    assert BackgroundTask(answer).result() == 42
    with pytest.raises(ValueError, match="no"):
        BackgroundTask(fail).result()
