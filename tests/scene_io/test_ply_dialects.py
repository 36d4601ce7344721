"""PLY as many programs write it: each oddity with its right value, or with one warning."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from ply_builder import POSITIONS, binary, text
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_decode
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def header(faces: str, comment: str = "", vertices: str = "") -> str:
    columns = "".join(f"property float {name}\n" for name in "xyz") + vertices
    return f"ply\nformat ascii 1.0\n{comment}element vertex 4\n{columns}{faces}end_header\n"


FACES = "element face 1\nproperty list uchar int vertex_indices\n"


def imported(ply: str | bytes) -> Scene:
    return import_scene(ply.encode() if isinstance(ply, str) else ply, "test", LIGHT)


def save(path: Path, color: tuple[int, int, int]) -> None:
    PIL.Image.new("RGB", (2, 2), color).save(path)


def test_an_image_and_uv_coordinates_of_corners_are_read(tmp_path: Path) -> None:
    save(tmp_path / "t.png", (255, 0, 0))
    faces = FACES + "property list uchar float texcoord\n"
    body = ROWS + "4 0 1 2 3 8 0.25 0 1 0 1 1 0 1\n"
    (tmp_path / "a.ply").write_text(header(faces, "comment TextureFile t.png\n") + body)
    scene = import_scene(tmp_path / "a.ply", "test", LIGHT)
    np.testing.assert_allclose(scene.meshes[0].uvs[:3], [[0.25, 1], [1, 1], [1, 0]])
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["diffuse"])[0, 0], [1, 0, 0])
    assert scene.warnings == ()


def test_an_image_and_uv_coordinates_of_vertices_are_read(tmp_path: Path) -> None:
    save(tmp_path / "t.png", (0, 255, 0))
    vertices = "property float s\nproperty float t\n"
    body = "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n"
    (tmp_path / "a.ply").write_text(header(FACES, "comment texturefile t.png\n", vertices) + body)
    scene = import_scene(tmp_path / "a.ply", "test", LIGHT)
    np.testing.assert_allclose(scene.meshes[0].uvs[:3], [[0, 1], [1, 1], [1, 0]])
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["diffuse"])[0, 0], [0, 1, 0])


def test_several_images_are_several_materials(tmp_path: Path) -> None:
    save(tmp_path / "a.png", (255, 0, 0))
    save(tmp_path / "b.png", (0, 255, 0))
    faces = FACES.replace("face 1", "face 2") + "property list uchar float texcoord\nproperty int texnumber\n"
    body = ROWS + "3 0 1 2 6 0 0 1 0 1 1 1\n3 0 2 3 6 0 0 1 1 0 1 0\n"
    (tmp_path / "a.ply").write_text(header(faces, "comment TextureFile a.png\ncomment TextureFile b.png\n") + body)
    scene = import_scene(tmp_path / "a.ply", "test", LIGHT)
    assert [(mesh.name, scene.materials[mesh.material].name) for mesh in scene.meshes] == [("a", "a"), ("b", "b")]
    np.testing.assert_array_equal(scene.meshes[1].positions[2], [1, 1, 0])


def test_a_missing_image_is_a_warning() -> None:
    scene = imported(header(FACES, "comment TextureFile none.png\n") + ROWS + "4 0 1 2 3\n")
    assert [warning.severity for warning in scene.warnings] == ["unsupported"]
    assert "none.png" in scene.warnings[0]


@pytest.mark.parametrize("names", ["red green blue", "diffuse_red diffuse_green diffuse_blue"])
def test_face_colors_are_read(names: str) -> None:
    faces = FACES.replace("face 1", "face 2") + "".join(f"property uchar {name}\n" for name in names.split())
    scene = imported(header(faces) + ROWS + "3 0 1 2 255 0 0\n3 0 2 3 0 0 128\n")
    values = get_texture_values(scene.materials[0].textures["diffuse"])
    height, width = values.shape[:2]
    texels = np.floor(scene.meshes[0].uvs * [width, height] * 0.999).astype(int)
    blue = float(srgb_decode(np.array([128 / 255], np.float32))[0])
    expected = [[1, 0, 0]] * 3 + [[0, 0, blue]] * 3
    np.testing.assert_allclose(values[texels[:, 1], texels[:, 0]], expected, atol=0.01)
    assert scene.warnings == ()


def test_colors_in_floating_point_above_one_are_bytes() -> None:
    vertices = "".join(f"property float {name}\n" for name in ("red", "green", "blue"))
    rows = "".join(f"{x} {y} {z} 255 0 0\n" for x, y, z in POSITIONS)
    scene = imported(header(FACES, vertices=vertices) + rows + "4 0 1 2 3\n")
    assert scene.materials[0].terms[0]["color"][1:] == [0, 0]
    assert "0 to 255" in scene.warnings[0]


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_triangle_strips_are_unrolled(form: str) -> None:
    strips = "element tristrips 2\nproperty list int int vertex_indices\n"
    lists = [[0, 1, 3, 2, -1, 0, 1, 2], [3, 0, 1]]
    data = header(strips).replace("ascii", form).encode()
    if form == "ascii":
        data += ROWS.encode() + "".join(f"{len(row)} {' '.join(map(str, row))}\n" for row in lists).encode()
    else:
        order = "<" if "little" in form else ">"
        data += POSITIONS.astype(f"{order}f4").tobytes()
        data += b"".join(np.array([len(row), *row], f"{order}i4").tobytes() for row in lists)
    (mesh,) = imported(data).meshes
    expected = POSITIONS[[[0, 1, 3], [3, 1, 2], [0, 1, 2], [3, 0, 1]]]
    np.testing.assert_array_equal(mesh.positions[mesh.faces], expected)
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 12, atol=1e-6)


def test_a_concave_face_has_its_area() -> None:
    corners = [(4, 0), (4, 1), (1, 1), (1, 4), (0, 4), (0, 0)]
    rows = "".join(f"{x} {y} 0\n" for x, y in corners)
    (mesh,) = imported(header(FACES).replace("vertex 4", "vertex 6") + rows + "6 0 1 2 3 4 5\n").meshes
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(7)


def test_carriage_returns_and_a_byte_order_mark_are_read() -> None:
    for data in (text().replace(b"\n", b"\r"), text().replace(b"\n", b"\r\n"), b"\xef\xbb\xbf" + text()):
        np.testing.assert_array_equal(imported(data).meshes[0].positions, imported(text()).meshes[0].positions)
    head, body = binary("<").split(b"end_header\n")
    data = (head + b"end_header\n").replace(b"\n", b"\r") + body
    np.testing.assert_array_equal(imported(data).meshes[0].positions, imported(text()).meshes[0].positions)


@pytest.mark.parametrize("count", ["char", "short", "uint", "double"])
@pytest.mark.parametrize("index", ["uchar", "ushort", "float", "double"])
def test_lists_of_any_type_are_read(count: str, index: str) -> None:
    types = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "uint": "u4", "float": "f4", "double": "f8"}
    unknown = "element note 2\nproperty list uchar float words\nproperty double number\n"
    faces = f"element face 1\nproperty list {count} {index} vertex_index\n"
    data = header(unknown + faces).replace("ascii", "binary_big_endian").encode() + POSITIONS.astype(">f4").tobytes()
    data += b"\2" + np.array([1, 2], ">f4").tobytes() + np.array([7], ">f8").tobytes() + b"\0" + bytes(8)
    data += np.array([4], f">{types[count]}").tobytes() + np.array([0, 1, 2, 3], f">{types[index]}").tobytes()
    (mesh,) = imported(data).meshes
    np.testing.assert_array_equal(mesh.positions, POSITIONS[[0, 1, 2, 0, 2, 3]])


def test_a_truncated_file_has_its_complete_faces() -> None:
    scene = imported(binary("<", mixed=True)[:-2])
    assert len(scene.meshes[0].faces) == 2
    assert "has 1 of 2 rows of face" in scene.warnings[0]
    assert scene.warnings[0].severity == "unsupported"


def test_faces_out_of_range_are_left_out() -> None:
    scene = imported(header(FACES.replace("face 1", "face 2")) + ROWS + "4 0 1 2 3\n3 0 1 9\n")
    assert len(scene.meshes[0].faces) == 2
    assert "Left out 1 face of" in scene.warnings[0]


def test_texts_for_no_number_in_normals_are_made_anew() -> None:
    vertices = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz"))
    rows = "".join(f"{x} {y} {z} -nan(ind) 1.#QNAN 0\n" for x, y, z in POSITIONS)
    scene = imported(header(FACES, vertices=vertices) + rows + "4 0 1 2 3\n")
    np.testing.assert_allclose(scene.meshes[0].normals, [[0, 0, 1]] * 6, atol=1e-6)
    assert scene.warnings[0].severity == "approximated"


def test_far_coordinates_keep_their_shape() -> None:
    moved = POSITIONS + np.array([6378137.3, 0, 0])
    rows = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in moved.tolist())
    scene = imported(header(FACES).replace("float", "double") + rows + "4 0 1 2 3\n")
    restored = scene.meshes[0].positions + np.array(scene.offset)
    np.testing.assert_allclose(restored, moved[[0, 1, 2, 0, 2, 3]], atol=1e-8)


def test_one_archive_has_a_ply_with_its_image() -> None:
    image, packed = io.BytesIO(), io.BytesIO()
    PIL.Image.new("RGB", (2, 2), (255, 0, 0)).save(image, "PNG")
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("a/a.ply", header(FACES, "comment TextureFile t.png\n") + ROWS + "4 0 1 2 3\n")
        archive.writestr("a/t.png", image.getvalue())
    assert "diffuse" in import_scene(packed.getvalue(), "test", LIGHT).materials[0].textures
