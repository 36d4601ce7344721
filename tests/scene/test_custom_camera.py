"""Custom cameras: validation, and stable text after normalization."""

import json
import math

import numpy as np
import pytest

from relume.core.errors import ParameterError
from relume.scene.custom_camera import make_custom_camera, read_custom_camera, with_cameras
from relume.scene.examples.catalog import built_in
from relume.scene.lens import Lens
from relume.scene.validate import MAX_METERS

POSE = [1, 0, 0, 3, 0, 1, 0, 2, 0, 0, 1, 9, 0, 0, 0, 1]


def rotated(degrees: float, scale: float = 1.0) -> list[float]:
    """Rotated about +Y, then scaled."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    frame = np.array([[c, 0, s, 3], [0, 1, 0, 2], [-s, 0, c, 9], [0, 0, 0, 1]])
    frame[:3, :3] *= scale
    return frame.ravel().tolist()


def changed(index: int, value: float) -> list[float]:
    return [*POSE[:index], value, *POSE[index + 1 :]]


def test_a_scene_camera_keeps_its_pose_and_angle() -> None:
    camera = make_custom_camera("Hero", POSE, 40).camera
    assert camera.name == "Hero"
    assert camera.to_world[:3, 3].tolist() == [3, 2, 9]
    assert camera.yfov == pytest.approx(math.radians(40))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 7.5])
def test_scale_is_removed_and_the_text_is_stable(scale: float) -> None:
    placed = make_custom_camera("Hero", rotated(33.3, scale), 40)
    np.testing.assert_allclose(placed.camera.to_world, np.array(rotated(33.3)).reshape(4, 4), atol=1e-12)
    text = json.dumps(placed.document())
    assert read_custom_camera(json.loads(text)) == placed
    assert json.dumps(read_custom_camera(json.loads(text)).document()) == text


@pytest.mark.parametrize(
    ("to_world", "message"),
    [
        (POSE[:15], "16 finite numbers"),
        (changed(3, math.nan), "16 finite numbers"),
        (changed(3, math.inf), "16 finite numbers"),
        (changed(15, 2.0), "the last four"),
        (changed(12, 0.1), "the last four"),
        (changed(3, 2 * MAX_METERS), "from the origin"),
        (changed(5, 0.0), "with a length"),
        (changed(5, 1e308), "with a length"),
        (changed(1, 0.5), "right angles"),
        (changed(0, -1.0), "not mirrored"),
    ],
)
def test_invalid_poses_are_rejected(to_world: list[float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        make_custom_camera("Hero", to_world, 40)


@pytest.mark.parametrize("yfov", [0.0, -40.0, 180.0, math.nan, math.inf])
def test_invalid_angles_are_rejected(yfov: float) -> None:
    with pytest.raises(ParameterError, match="degrees"):
        make_custom_camera("Hero", POSE, yfov)


@pytest.mark.parametrize("name", ["", " Hero", "a/b", "a\\b", "..", "x" * 81, "line\nbreak"])
def test_names_that_are_invalid_in_urls_are_rejected(name: str) -> None:
    with pytest.raises(ParameterError, match="printable characters"):
        make_custom_camera(name, POSE, 40)


@pytest.mark.parametrize(
    "document",
    [
        None,
        [],
        {"name": "Hero", "to_world": POSE},
        {"name": "Hero", "to_world": POSE, "yfov": 40, "znear": 1},
        {"name": 7, "to_world": POSE, "yfov": 40},
        {"name": "Hero", "to_world": "1000", "yfov": 40},
        {"name": "Hero", "to_world": [*POSE[:15], True], "yfov": 40},
        {"name": "Hero", "to_world": POSE, "yfov": "40"},
    ],
)
def test_invalid_camera_documents_are_rejected(document: object) -> None:
    with pytest.raises(ParameterError):
        read_custom_camera(document)


def test_additional_cameras_do_not_change_the_scene_id() -> None:
    scene = built_in("cornell_box")
    own = scene.cameras[0].name
    more = with_cameras(scene, [make_custom_camera("Hero", POSE, 40).camera, make_custom_camera(own, POSE, 50).camera])
    assert more.id == scene.id
    assert {camera.name for camera in more.cameras} == {*(camera.name for camera in scene.cameras), "Hero"}
    assert next(camera for camera in more.cameras if camera.name == own).yfov == pytest.approx(math.radians(50))


def test_a_lens_is_part_of_the_recipe_and_read_again() -> None:
    document = {"name": "Hero", "to_world": POSE, "yfov": 40, "lens": {"radius": 0.02, "focus_distance": 1.5}}
    camera = read_custom_camera(document)
    assert camera.camera.lens == Lens(0.02, 1.5)
    assert camera.document()["lens"] == document["lens"]  # type: ignore[index]
    hexagon = {**document, "lens": {"radius": 0.02, "focus_distance": 1.5, "blades": 6}}
    assert read_custom_camera(read_custom_camera(hexagon).document()).lens == Lens(0.02, 1.5, 6)
    assert "lens" not in make_custom_camera("Hero", POSE, 40).document()  # recipes without one keep their identity


@pytest.mark.parametrize(
    ("lens", "text"),
    [
        ({"radius": 0, "focus_distance": 1}, "radius is 0"),
        ({"radius": 11, "focus_distance": 1}, "at most 10 m"),
        ({"radius": math.nan, "focus_distance": 1}, "radius is nan"),
        ({"radius": 10**400, "focus_distance": 1}, "at most 10 m"),
        ({"radius": 0.1, "focus_distance": 0}, "focus_distance is 0"),
        ({"radius": 0.1, "focus_distance": "near"}, "a number of meters"),
        ({"radius": 0.1, "focus_distance": 1, "blades": 2}, "3 to 16 blades"),
        ({"radius": 0.1, "focus_distance": 1, "blades": 5.5}, "a whole number"),
        ({"radius": 0.1}, "focus_distance"),
        (["radius"], "an object"),
    ],
)
def test_impossible_lenses_are_rejected(lens: object, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        read_custom_camera({"name": "Hero", "to_world": POSE, "yfov": 40, "lens": lens})
