"""Published USD files: numbers of triangles, bounds in meters, names of materials, cameras and lights."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from usd_text import WHITE

from relume.scene_io.import_scene import import_scene
from relume.scene_io.placement import bounds

pytest.importorskip("pxr.Usd")

FILES = {
    "Teapot/Teapot.usd": (39_552, [-0.15, 0, -0.26], [0.15, 0.229, 0.228], ["Ceramic"]),
    "SubdivisionSurfaces/Pyramid/payload.usda": (
        384, [-0.583, 0, -0.505], [0.406, 0.952, 0.505], ["PyramidMaterial"],
    ),
    "test_assets/MaterialXTest/basic.usda": (3_968, [-0.01] * 3, [0.01] * 3, ["USD_Plastic"]),
    "test_assets/NormalsTextureBiasAndScale/NormalsTextureBiasAndScale.usdz": (
        36, [-0.11, 0, -0.11], [0.21, 0.1, 0.21],
        ["RNormals", "RNormalsReversedX0BiasZ", "RNormalsReversedY"],
    ),
    "test_assets/USDZ/AnimatedTriangle/AnimatedTriangle.usdz": (1, [0, 0, 0], [1, 1, 0], ["defaultMaterial"]),
    "test_assets/schemaTests/usdGeom/primitives/all_primitives.usda": (
        8_460, [-0.005, -0.01, -0.01], [0.09, 0.01, 0.01], ["Capsule"],
    ),
}  # fmt: skip


def layers_of(folder: Path) -> bytes:
    """An archive of all layers in a folder, without their images."""
    if not folder.is_dir():
        pytest.skip(f"the shared data have no {folder.name}")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file in sorted(folder.rglob("*.usd*")):
            archive.write(file, str(file.relative_to(folder)))
    return packed.getvalue()


@pytest.mark.parametrize("name", FILES)
def test_published_files_have_their_shape_and_materials(name: str, shared_data: Path) -> None:
    path = shared_data / "usd" / name
    if not path.is_file():
        pytest.skip(f"the shared data have no {name}")
    num_triangles, low, high, materials = FILES[name]
    scene = import_scene(path, "test", WHITE)
    assert sum(len(mesh.faces) for mesh in scene.meshes) == num_triangles
    np.testing.assert_allclose(bounds(scene), [low, high], atol=1e-3)
    assert sorted(material.name for material in scene.materials) == materials
    assert not [warning for warning in scene.warnings if warning.severity == "unsupported"]


def test_a_kit_of_layers_is_one_scene(shared_data: Path) -> None:
    scene = import_scene(layers_of(shared_data / "usd" / "Vehicles"), "test", WHITE)
    assert sum(len(mesh.faces) for mesh in scene.meshes) == 1_973
    assert sorted(material.name for material in scene.materials) == [
        "backLightMaterial",
        "frontLightMaterial",
        "greyLightMaterial",
        "greyMediumMaterial",
        "redMaterial",
        "windowMaterial",
    ]


def test_the_shader_ball_has_its_camera_and_lights(shared_data: Path) -> None:
    scene = import_scene(layers_of(shared_data / "usd" / "StandardShaderBall"), "test", WHITE)
    (camera,) = scene.cameras
    assert camera.yfov == pytest.approx(2 * np.arctan(20.955 / 100))
    np.testing.assert_allclose(camera.to_world[:3, 3], [0.0653154, 0.195, 0.179485], atol=1e-6)
    assert [light.fields["kind"] for light in scene.lights] == ["rectangle"] * 5
    np.testing.assert_allclose(scene.lights[0].fields["size"], [0.1496, 0.1496], atol=1e-6)
    np.testing.assert_allclose(scene.lights[0].fields["emission"], 9)
