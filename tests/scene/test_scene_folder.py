"""Scene folders: saved scenes are loaded unchanged with the same id, invalid ones are rejected."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.core.import_warnings import approximated
from relume.scene.model import Camera, Glass, Light, Material, Mesh, Opacity, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import load_cameras, load_scene, make_scene, save_scene


def test_another_scene_with_the_same_id_does_not_overwrite_the_first(tmp_path: Path) -> None:
    scene = small_scene()
    save_scene(scene, tmp_path)
    save_scene(scene, tmp_path)
    white = Environment("sky", np.ones((2, 4, 3), np.float32))
    other = dataclasses.replace(small_scene(environment=white), id=scene.id)
    with pytest.raises(SceneError, match=f"another scene with the id {scene.id} exists; delete it first"):
        save_scene(other, tmp_path)
    assert load_scene(tmp_path).id == scene.id
    document = json.loads((tmp_path / "scene.json").read_text())
    assert document.pop("sha256")[:16] == scene.id
    (tmp_path / "scene.json").write_text(json.dumps(document))  # as older versions saved it
    save_scene(scene, tmp_path)
    load_scene(tmp_path)


def small_scene(**changes: object) -> Scene:
    rng = np.random.default_rng(5)
    mesh = Mesh(
        "triangle",
        rng.random((3, 3), np.float32),
        np.repeat(np.array([[0, 0, 1]], np.float32), 3, axis=0),
        np.zeros((3, 4), np.float32),
        rng.random((3, 2), np.float32),
        np.array([[0, 1, 2]], np.uint32),
        0,
    )
    texture = Texture(rng.random((2, 3, 3), np.float32), ("clamp", "mirror"))
    normal_map = Texture(rng.random((4, 4, 3), np.float32))
    lambert = {"model": "lambert", "color": [0.25, 0.5, 0.125], "texture": "diffuse"}
    material = Material("Clay / grün", (lambert,), {"diffuse": texture}, normal_map, double_sided=False)
    parts: dict[str, object] = {
        "name": "small",
        "meshes": [mesh],
        "materials": [material],
        "cameras": [Camera("front", np.eye(4), 0.5)],
        "environment": Environment("sky", rng.random((2, 4, 3), np.float32)),
        "warnings": [approximated("one thing")],
        "lights": [Light("Key", {"kind": "spot", "position": [0.1, 2.0, -3.5]})],
    }
    return make_scene(**(parts | changes))  # type: ignore[arg-type]


def test_saving_and_loading_keeps_everything(tmp_path: Path) -> None:
    scene = small_scene()
    save_scene(scene, tmp_path / "scene")
    loaded = load_scene(tmp_path / "scene")
    assert (loaded.id, loaded.name, loaded.warnings) == (scene.id, scene.name, scene.warnings)
    assert [warning.severity for warning in loaded.warnings] == ["approximated"]
    for field in ("positions", "normals", "tangents", "uvs", "faces"):
        before, after = getattr(scene.meshes[0], field), getattr(loaded.meshes[0], field)
        assert before.dtype == after.dtype
        np.testing.assert_array_equal(before, after)
    before, after = scene.materials[0], loaded.materials[0]
    assert (after.name, after.terms, after.double_sided) == (before.name, before.terms, before.double_sided)
    assert after.textures["diffuse"].wrap == ("clamp", "mirror")
    np.testing.assert_array_equal(after.textures["diffuse"].pixels, before.textures["diffuse"].pixels)
    assert after.normal_map is not None
    assert before.normal_map is not None
    np.testing.assert_array_equal(after.normal_map.pixels, before.normal_map.pixels)
    np.testing.assert_array_equal(loaded.cameras[0].to_world, scene.cameras[0].to_world)
    assert loaded.lights == scene.lights
    np.testing.assert_array_equal(loaded.environment.radiance, scene.environment.radiance)


def test_id_is_hexadecimal_and_repeatable() -> None:
    identity = small_scene().id
    assert len(identity) == 16
    assert int(identity, 16) >= 0
    assert small_scene().id == identity


def test_id_changes_with_content_but_not_with_warnings() -> None:
    scene = small_scene()
    brighter = Environment("sky", scene.environment.radiance * np.float32(1.5))
    moved = dataclasses.replace(scene.meshes[0], positions=scene.meshes[0].positions + np.float32(1e-6))
    matte = dataclasses.replace(scene.materials[0], terms=({"model": "lambert", "color": [0.25, 0.5, 0.126]},))
    wider = Camera("front", np.eye(4), 0.6)
    others = [
        small_scene(name="other"),
        small_scene(lights=[]),
        small_scene(environment=brighter),
        small_scene(meshes=[moved]),
        small_scene(materials=[matte]),
        small_scene(cameras=[wider]),
    ]
    assert len({scene.id, *(other.id for other in others)}) == 7
    assert small_scene(warnings=[]).id == scene.id


def test_camera_aspects_are_stored_and_not_part_of_the_id(tmp_path: Path) -> None:
    """Ids of older scenes do not change."""
    camera = Camera("front", np.eye(4), 0.5, 16 / 9)
    wide, plain = small_scene(cameras=[camera]), small_scene(cameras=[dataclasses.replace(camera, aspect=None)])
    assert wide.id == plain.id
    for scene, aspect in ((wide, 16 / 9), (plain, None)):
        save_scene(scene, tmp_path)
        assert load_scene(tmp_path).cameras[0].aspect == load_cameras(tmp_path)[0].aspect == aspect


def test_saving_again_replaces_the_files_and_leaves_nothing_else(tmp_path: Path) -> None:
    save_scene(small_scene(), tmp_path)
    save_scene(small_scene(name="other"), tmp_path)
    assert load_scene(tmp_path).name == "other"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arrays.npz", "scene.json"]


def test_load_refuses_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no scene"):
        load_scene(tmp_path / "none")


@pytest.mark.parametrize("name", ["scene.json", "arrays.npz"])
@pytest.mark.parametrize("keep", [0.0, 0.5, 0.99])
def test_load_refuses_truncated_files(tmp_path: Path, name: str, keep: float) -> None:
    save_scene(small_scene(), tmp_path)
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: int(keep * len(data))])
    with pytest.raises(SceneError, match="import the scene again"):
        load_scene(tmp_path)


def test_load_refuses_changed_content(tmp_path: Path) -> None:
    save_scene(small_scene(), tmp_path)
    document = json.loads((tmp_path / "scene.json").read_text())
    document["cameras"][0]["yfov"] = 0.7
    (tmp_path / "scene.json").write_text(json.dumps(document))
    with pytest.raises(SceneError, match="was modified after it was saved"):
        load_scene(tmp_path)


def test_load_refuses_pickles_and_compressed_members(tmp_path: Path) -> None:
    save_scene(small_scene(), tmp_path)
    np.savez(tmp_path / "arrays.npz", environment=np.array([{"a": 1}], object))
    with pytest.raises(SceneError):
        load_scene(tmp_path)
    with zipfile.ZipFile(tmp_path / "arrays.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("environment.npy", b"\0" * 10_000_000)
    with pytest.raises(SceneError, match="not written by relume"):
        load_scene(tmp_path)


@pytest.mark.parametrize(
    "document", [b"[]", b"{}", b'{"format": 2}', b'{"format": 1, "meshes": 3}', b"\xff", b"[" * 100_000]
)
def test_load_refuses_documents_of_another_kind(tmp_path: Path, document: bytes) -> None:
    save_scene(small_scene(), tmp_path)
    (tmp_path / "scene.json").write_bytes(document)
    with pytest.raises(SceneError, match="import the scene again"):
        load_scene(tmp_path)


def test_make_scene_refuses_parts_that_do_not_fit() -> None:
    mesh = small_scene().meshes[0]
    broken_meshes = [
        dataclasses.replace(mesh, faces=np.array([[0, 1, 3]], np.uint32)),
        dataclasses.replace(mesh, faces=np.zeros((0, 3), np.uint32)),
        dataclasses.replace(mesh, positions=np.full((3, 3), np.nan, np.float32)),
        dataclasses.replace(mesh, normals=np.zeros((2, 3), np.float32)),
        dataclasses.replace(mesh, material=1),
    ]
    changes: list[dict[str, object]] = [{"meshes": [broken]} for broken in broken_meshes]
    changes += [{"meshes": []}, {"cameras": []}, {"cameras": [Camera("front", np.eye(4) * 2, 0.5)]}]
    changes += [{"cameras": [Camera("front", np.eye(4), 0.5)] * 2}, {"cameras": [Camera("front", np.eye(4), 4.0)]}]
    changes += [{"environment": Environment("sky", np.full((2, 4, 3), value, np.float32))} for value in (-1.0, np.inf)]
    for change in changes:
        with pytest.raises(SceneError):
            small_scene(**change)


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        ([Light(f"L{k}", {"kind": "point"}) for k in range(65)], "65 lights, the limit is 64"),
        ([Light("A", {"kind": "point"}), Light("A", {"kind": "spot"})], "must be unique"),
        ([Light("", {"kind": "point"})], "1 to 80"),
        ([Light("x" * 81, {"kind": "point"})], "1 to 80"),
    ],
)
def test_invalid_names_or_numbers_of_lights_are_rejected(lights: list[Light], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        small_scene(lights=lights)


def test_opacity_is_stored_and_changes_the_id(tmp_path: Path) -> None:
    alpha = np.arange(12, dtype=np.uint8).reshape(3, 4)
    ids = {small_scene().id}
    for cutoff in (None, 0.5, 0.25):
        material = dataclasses.replace(small_scene().materials[0], opacity=Opacity(alpha, ("clamp", "mirror"), cutoff))
        scene = small_scene(materials=[material])
        save_scene(scene, tmp_path)
        loaded = load_scene(tmp_path).materials[0].opacity
        assert loaded is not None
        np.testing.assert_array_equal(loaded.alpha, alpha)
        assert (loaded.wrap, loaded.cutoff) == (("clamp", "mirror"), cutoff)
        ids.add(scene.id)
    assert len(ids) == 4


@pytest.mark.parametrize(
    "opacity",
    [
        Opacity(np.zeros((0, 4), np.uint8)),
        Opacity(np.zeros((2, 2), np.float32)),
        Opacity(np.zeros((2, 2, 1), np.uint8)),
        Opacity(np.zeros((2, 2), np.uint8), ("repeat", "never")),
        Opacity(np.zeros((2, 2), np.uint8), cutoff=0.0),
        Opacity(np.zeros((2, 2), np.uint8), cutoff=float("nan")),
    ],
)
def test_opacity_must_be_an_8_bit_image(opacity: Opacity) -> None:
    with pytest.raises(SceneError, match=r"alpha texture|alphaCutoff"):
        small_scene(materials=[dataclasses.replace(small_scene().materials[0], opacity=opacity)])


def test_glass_is_stored_and_changes_the_id(tmp_path: Path) -> None:
    clear = small_scene()
    glass = Glass((0.5, 0.25, 1.0), 1.4, 0.125, (3.0, 0.0, 0.5))
    scene = small_scene(materials=[dataclasses.replace(clear.materials[0], glass=glass)])
    save_scene(scene, tmp_path)
    assert load_scene(tmp_path).materials[0].glass == glass
    assert scene.id != clear.id


@pytest.mark.parametrize(
    "fields",
    [{"ior": 0.5}, {"ior": 100.0}, {"ior": float("nan")}, {"tint": (2.0, 0.0, 0.0)}, {"absorbed": (-1.0, 0.0, 0.0)},
     {"thickness": float("inf")}, {"tint": (0.5, 0.5)}],
)  # fmt: skip
def test_unphysical_glass_is_rejected(fields: dict[str, object]) -> None:
    glass = dataclasses.replace(Glass(), **fields)
    with pytest.raises(SceneError, match="glass parameters of material"):
        small_scene(materials=[dataclasses.replace(small_scene().materials[0], glass=glass)])


def test_roughness_maps_are_stored(tmp_path: Path) -> None:
    pixels = np.arange(12, dtype=np.uint8).reshape(3, 4, 1)
    texture = Texture(pixels, ("clamp", "mirror"), TextureEncoding("share", (2.0, 2.0, 2.0)))
    material = dataclasses.replace(small_scene().materials[0], textures={"roughness": texture})
    save_scene(small_scene(materials=[material]), tmp_path)
    loaded = load_scene(tmp_path).materials[0].textures["roughness"]
    np.testing.assert_array_equal(loaded.pixels, pixels)
    assert (loaded.wrap, loaded.encoding) == (texture.wrap, texture.encoding)


@pytest.mark.parametrize(
    ("channel", "texture"),
    [
        ("roughness", Texture(np.zeros((2, 2, 3), np.float32))),
        ("roughness", Texture(np.zeros((2, 2, 3), np.uint8), encoding=TextureEncoding("srgb"))),
        ("roughness", Texture(np.zeros((2, 2, 1), np.uint8), encoding=TextureEncoding("share", (float("nan"),) * 3))),
        ("diffuse", Texture(np.zeros((2, 2, 1), np.uint8), encoding=TextureEncoding("share"))),
        (
            "emission",
            Texture(np.zeros((2, 2, 3), np.uint8), encoding=TextureEncoding("srgb", (1.0, float("inf"), 1.0))),
        ),
    ],
)
def test_textures_unsuitable_for_their_channel_are_rejected(channel: str, texture: Texture) -> None:
    material = dataclasses.replace(small_scene().materials[0], textures={channel: texture})
    with pytest.raises(SceneError, match=channel):
        small_scene(materials=[material])
