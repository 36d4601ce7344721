"""The import option `time`: a moment of a glTF animation, by the specification's formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import QUAD, Glb

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_options import ImportOptions

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
TIMES = [1.0, 2.0, 4.0]
HALF = np.sqrt(0.5)


def at(glb: Glb, time: float | None) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT, options=ImportOptions(time=time))


def animated(path: str, values: Any, interpolation: str = "LINEAR", times: Any = TIMES, **node: Any) -> Glb:
    """A quad whose node has one animated property."""
    glb = Glb().quad()
    glb.document["nodes"][0] |= node
    return with_animation(glb, path, values, interpolation, times)


def with_animation(glb: Glb, path: str, values: Any, interpolation: str, times: Any = TIMES, **animation: Any) -> Glb:
    output = np.asarray(values)
    output = output if output.dtype == np.int16 else output.astype(np.float32)
    sampler = {
        "input": glb.accessor(np.array(times, np.float32)),
        "output": glb.accessor(output, **({"normalized": True} if output.dtype == np.int16 else {})),
        "interpolation": interpolation,
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": path}}
    glb.document.setdefault("animations", []).append({"channels": [channel], "samplers": [sampler], **animation})
    return glb


def offset(scene: Scene) -> Any:
    return (scene.meshes[0].positions - QUAD).mean(axis=0)


@pytest.mark.parametrize(
    ("time", "step", "linear"),
    [(0.0, 1, 1), (1.0, 1, 1), (1.25, 1, 1.5), (2.0, 3, 3), (3.0, 3, 2.5), (4.0, 2, 2), (9.0, 2, 2)],
)
def test_translations_by_step_and_linear(time: float, step: float, linear: float) -> None:
    values = [[0, 0, 1], [0, 0, 3], [0, 0, 2]]
    np.testing.assert_allclose(offset(at(animated("translation", values, "STEP"), time)), [0, 0, step], atol=1e-6)
    np.testing.assert_allclose(offset(at(animated("translation", values), time)), [0, 0, linear], atol=1e-6)


def test_a_cubic_spline_has_tangents_per_second() -> None:
    """A cubic polynomial is its own Hermite spline: z(t) = t³ − 2 t, over intervals of 1 and 2 seconds."""
    times = np.array(TIMES)
    tangents, values = np.zeros((3, 3)), np.zeros((3, 3))
    tangents[:, 2], values[:, 2] = 3 * times**2 - 2, times**3 - 2 * times
    rows = np.stack([tangents, values, tangents], axis=1).reshape(-1, 3)
    for time in (1.0, 1.3, 2.0, 2.5, 3.7, 4.0):
        scene = at(animated("translation", rows, "CUBICSPLINE"), time)
        np.testing.assert_allclose(offset(scene), [0, 0, time**3 - 2 * time], rtol=1e-5)
    assert offset(at(animated("translation", rows, "CUBICSPLINE"), 0.5))[2] == pytest.approx(-1)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", ["float", "short"])
def test_rotations_take_the_shorter_arc(sign: int, kind: str) -> None:
    """A quarter turn about z in one second; after a third of it 30°, by slerp."""
    quaternions = np.array([[0, 0, 0, 1], [0, 0, sign * HALF, sign * HALF]])
    values: Any = quaternions if kind == "float" else np.round(quaternions * 32767).astype(np.int16)
    scene = at(animated("rotation", values, times=[0, 1]), 1 / 3)
    turn = np.array([[np.cos(np.pi / 6), -0.5, 0], [0.5, np.cos(np.pi / 6), 0], [0, 0, 1]])
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD @ turn.T, atol=1e-4)


def test_rotations_of_a_cubic_spline_are_normalized() -> None:
    zero = [0, 0, 0, 0]
    rows = [zero, [0, 0, 0, 1], zero, zero, [0, 0, HALF, HALF], zero]
    scene = at(animated("rotation", rows, "CUBICSPLINE", times=[0, 1]), 0.5)
    angle = np.pi / 8 * 2  # in the middle the mean of both quaternions, normalized
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD @ turn.T, atol=1e-6)


def test_scales_and_the_other_properties_at_rest() -> None:
    scene = at(animated("scale", [[1, 1, 1], [3, 1, 1]], times=[0, 1], translation=[5, 0, 0]), 0.5)
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD * [2, 1, 1] + [5, 0, 0], atol=1e-6)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBICSPLINE"])
def test_weights_of_morph_targets(interpolation: str) -> None:
    glb = Glb().quad()
    primitive = glb.document["meshes"][0]["primitives"][0]
    shifts = [np.tile(np.array([axis], np.float32), (4, 1)) for axis in ([0, 0, 1], [0, 1, 0])]
    primitive["targets"] = [{"POSITION": glb.accessor(shift)} for shift in shifts]
    glb.document["meshes"][0]["weights"] = [7, 7]
    rows = [[0, 1], [4, 2]] if interpolation == "LINEAR" else [[0, 0], [0, 1], [0, 0], [0, 0], [4, 2], [0, 0]]
    with_animation(glb, "weights", np.ravel(rows), interpolation, [0, 1])
    np.testing.assert_allclose(offset(at(glb, 0.5)), [0, 1.5, 2], atol=1e-6)
    np.testing.assert_allclose(offset(at(glb, 0.0)), [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(offset(at(glb, None)), [0, 7, 7], atol=1e-6)


def test_joints_move_their_vertices() -> None:
    indices, first = np.zeros((4, 4), np.uint8), np.tile(np.array([[1, 0, 0, 0]], np.float32), (4, 1))
    glb = Glb().quad(JOINTS_0=indices, WEIGHTS_0=first)
    glb.document["nodes"] = [{"translation": [0, 0, 9]}, {"mesh": 0, "skin": 0}]
    glb.document |= {"skins": [{"joints": [0]}], "scenes": [{"nodes": [0, 1]}]}
    with_animation(glb, "translation", [[0, 0, 0], [0, 4, 0]], "LINEAR", [0, 1])
    np.testing.assert_allclose(offset(at(glb, 0.25)), [0, 1, 0], atol=1e-6)


def test_the_first_animation_of_a_property_is_shown_and_others_are_named() -> None:
    glb = animated("translation", [[0, 0, 1]], times=[0])
    glb.document["animations"][0]["name"] = "Walk"
    with_animation(glb, "translation", [[0, 0, 5]], "STEP", [0], name="Run")
    scene = at(glb, 2)
    assert offset(scene)[2] == 1
    assert [str(warning) for warning in scene.warnings] == [
        "Objects aren't moved by animation “Run”: animation “Walk” moves the same ones.",
        "Objects are shown at 2 s of animation “Walk”, which lasts from 0 to 0 s.",
    ]
    (warning,) = at(glb, None).warnings
    assert warning == "2 animations were ignored: objects are shown in their rest pose."


def test_animations_of_different_objects_apply_together() -> None:
    """One animation for each object, as Blender writes them; one with nothing new, of both, is left out as a whole."""
    glb = animated("translation", [[0, 0, 0], [0, 0, 2]], times=[0, 1])
    glb.document["nodes"].append({"mesh": 0})
    glb.document["scenes"][0]["nodes"] = [0, 1]
    with_animation(glb, "translation", [[0, 0, 0], [0, 4, 0]], "LINEAR", [0, 2])
    glb.document["animations"][1]["channels"][0]["target"]["node"] = 1
    with_animation(glb, "scale", [[1, 1, 1], [3, 3, 3]], "LINEAR", [0, 1])
    with_animation(glb, "scale", [[9, 9, 9]], "STEP", [0])
    glb.document["animations"][3]["channels"].append({"sampler": 0, "target": {"node": 1, "path": "scale"}})
    first, second = at(glb, 0.5).meshes
    np.testing.assert_allclose(first.positions, 2 * QUAD + [0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(second.positions, np.add(QUAD, [0, 1, 0]), atol=1e-6)
    assert [str(warning) for warning in at(glb, 5).warnings] == [
        "Objects aren't moved by animation 3: animation 2 moves the same ones.",
        "Objects are shown at 5 s of animation 0, animation 1, animation 2, which lasts from 0 to 2 s.",
    ]


def test_a_time_without_an_animation_is_said() -> None:
    (warning,) = at(Glb().quad(), 1.5).warnings
    assert warning == "The file has no animation; its time of 1.5 s has no effect."
    assert warning.severity == "ignored"


def test_pointers_and_faulty_channels_cost_only_themselves() -> None:
    glb = animated("translation", [[0, 0, 1], [0, 0, 3], [0, 0, 2]])
    (animation,) = glb.document["animations"]
    pointer = {"KHR_animation_pointer": {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}}
    animation["samplers"].append({"input": glb.accessor(np.array([2, 1, 3], np.float32)), "output": 0})
    animation["channels"] += [
        {"sampler": 0, "target": {"path": "pointer", "extensions": pointer}},
        {"sampler": 7, "target": {"node": 0, "path": "scale"}},
        {"sampler": 0, "target": {"node": 0, "path": "rotation"}},
        {"sampler": 1, "target": {"node": 0, "path": "scale"}},
        {"sampler": 0, "target": {"node": 4, "path": "scale"}},
        {"sampler": 0, "target": {"node": 0, "path": "color"}},
    ]
    glb.document["extensionsUsed"] = ["KHR_animation_pointer"]
    scene = at(glb, 2)
    np.testing.assert_allclose(offset(scene), [0, 0, 3], atol=1e-6)
    texts = "\n".join(scene.warnings)
    assert "Values that animation 0 changes by KHR_animation_pointer were ignored (1): not supported." in texts
    assert (
        "A channel of animation 0 was left out: it refers to sampler 7 of 2; export the scene again (4 more)" in texts
    )
    assert len(scene.warnings) == 3


def test_a_node_with_a_matrix_is_not_animated() -> None:
    scene = at(animated("translation", [[0, 0, 1]], times=[0], matrix=np.eye(4).ravel().tolist()), 0)
    np.testing.assert_allclose(offset(scene), 0, atol=1e-6)
    assert any("has a matrix" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    "animation",
    [
        {"channels": 3},
        {"channels": [{"target": {}}]},
        {"samplers": [{"input": 0}]},
        {"samplers": [{"interpolation": 2}]},
    ],
)
def test_invalid_animations_leave_the_rest_pose(animation: dict[str, Any]) -> None:
    glb = Glb().quad()
    glb.document["animations"] = [animation]
    scene = at(glb, 1)
    np.testing.assert_allclose(offset(scene), 0, atol=1e-6)
    assert scene.warnings
