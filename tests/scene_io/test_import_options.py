"""Up axis, unit and origin, of scenes of every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from glb_builder import Glb
from pydantic import ValidationError

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene.shadow_catcher_ground import with_ground
from relume.scene_io.gltf.cameras import framing_camera
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.import_scene import import_scene
from relume.scene_io.placement import area

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
BOX = np.array([[2, 3, 5], [4, 3, 5], [2, 4, 5], [2, 3, 9]], np.float64)
FACES = "f 1 2 3\nf 1 2 4\n"


def imported(positions: np.ndarray = BOX, **options: str) -> Scene:
    lines = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in positions.tolist())
    return import_scene((lines + FACES).encode(), "test", LIGHT, options=ImportOptions.model_validate(options))


def corners(scene: Scene) -> np.ndarray:
    """Positions of the four vertices."""
    return scene.meshes[0].positions[[0, 1, 2, 5]].astype(np.float64)


@pytest.mark.parametrize(
    ("up", "expected"),
    [("file", [0, 1, 2]), ("y", [0, 1, 2]), ("z", [0, 2, 1]), ("-z", [0, 2, 1])],
)
def test_the_up_axis_becomes_plus_y_without_mirroring(up: str, expected: list[int]) -> None:
    signs = {"z": [1, 1, -1], "-z": [1, -1, 1]}.get(up, [1, 1, 1])
    scene = imported(up=up)
    np.testing.assert_allclose(corners(scene), BOX[:, expected] * signs, atol=1e-6)
    normal = imported().meshes[0].normals[:, expected] * signs
    np.testing.assert_allclose(scene.meshes[0].normals, normal, atol=1e-6)
    a, b, c = scene.meshes[0].positions[scene.meshes[0].faces[0]]
    assert np.cross(b - a, c - a) @ scene.meshes[0].normals[0] > 0
    np.testing.assert_array_equal(scene.cameras[0].to_world, framing_camera(scene.meshes, "").to_world)


@pytest.mark.parametrize(
    ("unit", "meters"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048), ("file", 1)]
)
def test_units_become_meters(unit: str, meters: float) -> None:
    scene = imported(unit=unit)
    np.testing.assert_allclose(corners(scene), BOX * meters, rtol=1e-6)
    assert area(scene) == pytest.approx(5 * meters**2, rel=1e-5)


@pytest.mark.parametrize(("size", "unit", "meters"), [(4, "m", 1), (4_000, "cm", 0.01), (40_000, "mm", 0.001)])
def test_a_guessed_unit_is_named(size: float, unit: str, meters: float) -> None:
    scene = imported(BOX * size / 4, unit="auto")
    np.testing.assert_allclose(corners(scene), BOX * size / 4 * meters, rtol=1e-6)
    (warning,) = scene.warnings
    assert f"guessed as {unit}" in warning
    assert warning.severity == "approximated"


def test_the_middle_becomes_the_origin_and_the_offset_is_stored(tmp_path: Path) -> None:
    scene = imported(recenter="always", up="z", unit="cm")
    middle = np.array([3, 3.5, 7])
    np.testing.assert_allclose(corners(scene), (BOX - middle)[:, [0, 2, 1]] * [0.01, 0.01, -0.01], atol=1e-8)
    np.testing.assert_allclose(corners(scene) + scene.offset, BOX[:, [0, 2, 1]] * [0.01, 0.01, -0.01], atol=1e-8)
    save_scene(scene, tmp_path)
    loaded = load_scene(tmp_path)
    assert loaded.offset == scene.offset
    assert loaded.import_options == {"up": "z", "unit": "cm", "recenter": "always"}
    assert with_ground(loaded).offset == scene.offset
    assert with_ground(loaded).import_options == scene.import_options


def test_far_scenes_are_recentered_unless_forbidden() -> None:
    moved = BOX + np.array([1e6, 0, 0.25])
    np.testing.assert_allclose(corners(imported(moved)) + imported(moved).offset, moved, atol=1e-6)
    fixed = imported(moved, recenter="never")
    np.testing.assert_array_equal(corners(fixed), moved.astype(np.float32))
    assert fixed.offset == (0, 0, 0)
    assert imported().offset == (0, 0, 0)


def test_options_without_effect_leave_the_id() -> None:
    assert imported(up="y", unit="m").id == imported().id
    assert imported(unit="cm").id != imported().id


def test_cameras_and_lights_of_a_file_move_with_it() -> None:
    glb = Glb().quad()
    glb.document["nodes"] += [
        {"camera": 0, "translation": [1, 2, 3]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [1, 2, 3]},
    ]
    glb.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}]
    glb.document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 683}]}}
    glb.document["extensionsUsed"] = ["KHR_lights_punctual"]
    glb.document.setdefault("scenes", [{"nodes": [0]}])[0]["nodes"] = list(range(len(glb.document["nodes"])))
    scene = import_scene(glb.bytes(), "test", LIGHT, options=ImportOptions(up="z", unit="cm"))
    moved, looking = [0.01, 0.03, -0.02], [0, -1, 0]  # along -Z of the file
    np.testing.assert_allclose(scene.cameras[0].to_world[:3, 3], moved, atol=1e-7)
    np.testing.assert_allclose(-scene.cameras[0].to_world[:3, 2], looking, atol=1e-7)
    (light,) = scene.lights
    np.testing.assert_allclose(light.fields["position"], moved, atol=1e-7)
    np.testing.assert_allclose(light.fields["direction"], looking, atol=1e-7)
    np.testing.assert_allclose(light.fields["emission"], [1, 1, 1], rtol=1e-6)


def test_unknown_options_are_rejected() -> None:
    with pytest.raises(ValidationError):
        imported(up="x")
