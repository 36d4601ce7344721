"""OBJ and MTL: faces, normals, materials, and referenced files."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Light, Mesh, Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.obj_ply.weld import creased_normals

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
COORDINATES = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def imported(text: str) -> Scene:
    return import_scene(text.encode(), "test", LIGHT)


def only_mesh(text: str) -> Mesh:
    (mesh,) = imported(text).meshes
    return mesh


def png(*color: int) -> bytes:
    encoded = io.BytesIO()
    PIL.Image.new("RGB", (2, 2), color).save(encoded, "PNG")
    return encoded.getvalue()


def test_polygons_become_fans_with_the_same_orientation() -> None:
    mesh = only_mesh(SQUARE + "f 1 2 3 4\n")
    np.testing.assert_array_equal(
        mesh.positions[mesh.faces][:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    )
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 6, atol=1e-6)


def test_uvs_start_at_the_top_and_normals_are_kept() -> None:
    mesh = only_mesh(SQUARE + COORDINATES + "vn 0 0 2\nvn 0 3 4\nf 1/1/1 2/2/1 3/3/2\n")
    np.testing.assert_array_equal(mesh.uvs, [[0, 1], [1, 1], [1, 0]])
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8]], atol=1e-6)


def test_negative_indices_count_back() -> None:
    first = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"
    second = "v 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    mesh = only_mesh(first + second)
    np.testing.assert_array_equal(mesh.positions[:, 0], [0, 1, 0, 5, 6, 5])


def test_continued_lines_and_all_line_endings_are_read() -> None:
    mesh = only_mesh("# made by hand\r\n" + SQUARE + "s off\r\nf 1 2 \\\r\n 3 4\r\n")
    assert len(mesh.faces) == 2


def test_a_cube_is_flat_and_a_fine_ball_is_round() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    faces = np.array([[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1], [0, 2, 6], [0, 6, 4]])
    normals = creased_normals(corners[faces], faces).reshape(-1, 3, 3)
    cross = np.cross(corners[faces][:, 1] - corners[faces][:, 0], corners[faces][:, 2] - corners[faces][:, 0])
    np.testing.assert_allclose(normals, np.repeat(cross[:, None], 3, axis=1), atol=1e-12)
    points, ball = _ball(24)
    normals = creased_normals(points[ball], ball)
    # facets of 15 by 7.5 degrees: the mean normal at a vertex lies within half a facet of the radius
    assert (normals * points[ball].reshape(-1, 3)).sum(1).min() > np.cos(np.radians(7.5))


@pytest.mark.parametrize("height", [0.05, 0.4, 2.0])
def test_normals_average_the_triangles_within_the_crease_angle(height: float) -> None:
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    points = np.stack([x, y, height * np.random.default_rng(0).random((6, 6))], axis=-1).reshape(-1, 3)
    first = (np.arange(5)[:, None] * 6 + np.arange(5)).reshape(-1, 1)
    faces = np.concatenate([first + np.array([0, 1, 7]), first + np.array([0, 7, 6])])
    cross = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    unit = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    for row, normal in enumerate(creased_normals(points[faces], faces)):
        neighbors = (faces == faces[row // 3, row % 3]).any(axis=1) & (unit @ unit[row // 3] > 0.5)
        total = cross[neighbors].sum(axis=0)
        np.testing.assert_allclose(normal, total / np.linalg.norm(total), atol=1e-12)


def _ball(steps: int) -> tuple[np.ndarray, np.ndarray]:
    theta, phi = np.linspace(0.05, np.pi - 0.05, steps), np.arange(steps) * 2 * np.pi / steps
    sin, cos = np.sin(theta)[:, None], np.cos(theta)[:, None]
    points = np.stack([sin * np.cos(phi), np.broadcast_to(cos, (steps, steps)), sin * np.sin(phi)], -1).reshape(-1, 3)
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(steps - 1), np.arange(steps), indexing="ij"))
    a, b, c, d = i * steps + j, i * steps + (j + 1) % steps, (i + 1) * steps + j, (i + 1) * steps + (j + 1) % steps
    return points, np.concatenate([np.stack([a, b, c], -1), np.stack([b, d, c], -1)])


def test_objects_and_materials_are_separate_meshes(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(
        "newmtl red\nKd 1 0 0\nKs .2 0 0\nNs 90\n\nnewmtl metal\nKd .9 .8 .7\nPm 1\nPr .3\n"
    )
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + "mtllib m.mtl\no Box\nusemtl red\nf 1 2 3\nusemtl metal\nf 1 3 4\no Lid\nf 2 3 4\n")
    scene = import_scene(path, "thing", LIGHT)
    assert [mesh.name for mesh in scene.meshes] == ["Box", "Box 2", "Lid"]
    assert [mesh.material for mesh in scene.meshes] == [0, 1, 1]
    red, metal = scene.materials
    assert [term["model"] for term in red.terms] == ["lambert", "blinn_phong"]
    assert red.terms[1]["color"] == [0.2, 0.0, 0.0]
    assert red.terms[1]["params"] == {"exponent": 90.0}
    assert metal.terms[0]["color"] == [0, 0, 0]
    assert metal.terms[1]["params"] == {"roughness": 0.3, "f0": [0.9, 0.8, 0.7]}
    assert scene.warnings == ()


def test_images_next_to_the_material_file_are_read(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "old wood.png").write_bytes(png(255, 0, 0))
    (tmp_path / "m.mtl").write_text(
        "newmtl a\nKd 0 0 0\nmap_Kd -s 2 2 1 maps\\old wood.png\nmap_d holes.png\nd 0.5\nKe 1\n"
    )
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + COORDINATES + "mtllib m.mtl\nusemtl a\nf 1/1 2/2 3/3\n")
    scene = import_scene(path, "thing", LIGHT)
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["diffuse"])[0, 0], [1, 0, 0])
    assert scene.materials[0].terms[0] == {"model": "lambert", "color": [1.0, 1.0, 1.0], "texture": "diffuse"}
    assert scene.lights == (Light("a", {"kind": "mesh", "material": "a", "emission": [1.0, 1.0, 1.0]}),)
    opacity = scene.materials[0].opacity
    assert opacity is not None
    assert opacity.alpha.tolist() == [[128]]
    assert len(scene.warnings) == 1


def test_a_roughness_map_scales_the_width_and_terms_have_its_mean(tmp_path: Path) -> None:
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.array([[51, 153]], np.uint8)).save(encoded, "PNG")
    (tmp_path / "rough.png").write_bytes(encoded.getvalue())
    (tmp_path / "m.mtl").write_text("newmtl a\nPr 0.5\nmap_Pr rough.png\nnewmtl b\nPr 0\nmap_Pr rough.png\n")
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + COORDINATES + "mtllib m.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n")
    half, whole = import_scene(path, "thing", LIGHT).materials
    assert half.terms[1]["params"]["roughness"] == pytest.approx(0.2)
    assert whole.terms[1]["params"]["roughness"] == pytest.approx(0.4)
    assert half.terms[1]["roughness_map"] == "roughness"
    np.testing.assert_allclose(get_texture_values(half.textures["roughness"]), [[[0.5], [1.5]]], rtol=1e-6)


def emissions_of(tmp_path: Path, library: str, faces: str) -> Scene:
    (tmp_path / "m.mtl").write_text(library)
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + COORDINATES + "mtllib m.mtl\n" + faces)
    return import_scene(path, "thing", LIGHT)


def test_emission_is_radiance_times_image_mean(tmp_path: Path) -> None:
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.array([[[255, 255, 0], [0, 255, 0]]], np.uint8)).save(encoded, "PNG")
    (tmp_path / "glow.png").write_bytes(encoded.getvalue())
    library = "newmtl number\nKe 4 2 0\nnewmtl both\nKe 4 2 6\nmap_Ke glow.png\nnewmtl image\nKe 0\nmap_Ke glow.png\n"
    faces = "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in ("number", "both", "image"))
    emissions = {light.name: light.fields["emission"] for light in emissions_of(tmp_path, library, faces).lights}
    assert emissions == {"number": [4, 2, 0], "both": [1, 2, 0], "image": [0.25, 1, 0]}  # a quarter lies on the left


def test_an_emissive_material_without_surface_is_no_light(tmp_path: Path) -> None:
    scene = emissions_of(tmp_path, "newmtl bulb\nKe 1\n", "f 1 2 3\nusemtl bulb\nf 1 1 2\n")
    assert scene.lights == ()
    assert any("“bulb” emits no light: no surface" in warning for warning in scene.warnings)


def test_the_least_powerful_emissive_materials_beyond_the_limit_are_one_light(tmp_path: Path) -> None:
    library = "".join(f"newmtl m{k}\nKe {k + 1}\n" for k in range(65))
    faces = "".join(f"usemtl m{k}\nf 1 2 3\n" for k in range(65))
    (tmp_path / "a.mtl").write_text(library)
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{SQUARE}{faces}")
    scene = import_scene(tmp_path / "a.obj", "lights", LIGHT)
    *single, merged = scene.lights
    assert [light.name for light in single] == [f"m{k}" for k in range(2, 65)]
    emissions = {name: np.multiply(share, merged.fields["emission"]) for name, share in merged.fields["materials"]}
    assert emissions == {"m0": pytest.approx([1.0] * 3), "m1": pytest.approx([2.0] * 3)}
    assert any("2 of 65 lights were merged into 1 source" in warning for warning in scene.warnings)


def test_missing_files_give_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + "mtllib none.mtl\nusemtl a\nf 1 2 3\nl 1 2\n")
    words = ["none.mtl", "lines", "missing from the .mtl file"]
    warnings = import_scene(path, "thing", LIGHT).warnings
    assert all(any(word in warning for warning in warnings) for word in words)
    assert len(warnings) == len(words)


@pytest.mark.parametrize(
    ("line", "names"), [("my mats.mtl", ["my mats.mtl"]), ("a.mtl b.mtl", ["a.mtl", "b.mtl"]), ("mats", ["mats"])]
)
def test_a_missing_material_file_is_named_as_it_was_meant(tmp_path: Path, line: str, names: list[str]) -> None:
    path = tmp_path / "thing.obj"
    path.write_text(SQUARE + f"mtllib {line}\nf 1 2 3\n")
    warnings = import_scene(path, "thing", LIGHT).warnings
    assert len(warnings) == len(names)
    assert all(name in warning for name, warning in zip(names, warnings, strict=True))


def test_an_archive_contains_the_scene_with_its_files() -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("__MACOSX/._thing.obj", b"litter")
        archive.writestr("model/thing.obj", SQUARE + COORDINATES + "mtllib M.MTL\nusemtl a\nf 1/1 2/2 3/3\n")
        archive.writestr("model/m.mtl", "newmtl a\nmap_Kd ../maps/Wood.png\n")
        archive.writestr("maps/wood.png", png(0, 255, 0))
    scene = import_scene(packed.getvalue(), "test", LIGHT)
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["diffuse"])[0, 0], [0, 1, 0])
    assert scene.warnings == ()


def test_real_objects_are_imported(shared_data: Path) -> None:
    files = sorted((shared_data / "scenes").rglob("*.obj"))
    assert len(files) > 5
    for path in files:
        scene = import_scene(path, path.stem, LIGHT)
        np.testing.assert_allclose(np.linalg.norm(scene.meshes[0].normals, axis=1), 1, atol=1e-4)


def test_a_gltf_file_may_reference_other_files(tmp_path: Path) -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    (tmp_path / "a mesh.bin").write_bytes(positions.tobytes())
    text = """{"asset":{"version":"2.0"},"buffers":[{"uri":"a%20mesh.bin","byteLength":36}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}]}"""
    (tmp_path / "scene.gltf").write_text(text)
    np.testing.assert_array_equal(import_scene(tmp_path / "scene.gltf", "test", LIGHT).meshes[0].positions, positions)
    with pytest.raises(SceneError, match="outside the file"):
        import_scene(text.encode(), "test", LIGHT)
