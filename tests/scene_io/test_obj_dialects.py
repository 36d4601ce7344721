"""OBJ and MTL as many programs write them: each oddity with its right value, or with one warning."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO
import PIL.Image
import pytest
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning
from relume.scene.model import Mesh, Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.obj_ply.mtl import parse_map
from relume.scene_io.obj_ply.mtl_dialects import MtlMap
from relume.scene_io.obj_ply.polygons import clip_ears

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UVS = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
TEXTURED = f"mtllib m.mtl\n{SQUARE}{UVS}usemtl a\nf 1/1 2/2 3/3 4/4\n"
RED, GREEN = (255, 0, 0), (0, 255, 0)


def picture(color: tuple[int, ...] = RED, kind: str = "PNG") -> bytes:
    encoded = io.BytesIO()
    PIL.Image.new("RGB" if len(color) == 3 else "RGBA", (2, 2), color).save(encoded, kind)
    return encoded.getvalue()


def imported(obj: str | bytes, folder: Path | None = None, **files: bytes | str) -> Scene:
    """The scene of a file in a folder with others; their names have "__" in place of the dot."""
    with tempfile.TemporaryDirectory() as made:
        path = (folder or Path(made)) / "scene.obj"
        path.write_bytes(obj if isinstance(obj, bytes) else obj.encode())
        for name, content in files.items():
            encoded = content.encode() if isinstance(content, str) else content
            (path.parent / name.replace("__", ".")).write_bytes(encoded)
        return import_scene(path, "test", LIGHT)


def diffuse(scene: Scene, index: int = 0) -> list[float]:
    """Color of the first texel, or of the first term without a texture."""
    material = scene.materials[index]
    if "diffuse" in material.textures:
        return [round(float(value), 3) for value in get_texture_values(material.textures["diffuse"])[0, 0]]
    return [round(float(value), 3) for value in material.terms[0]["color"]]


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def only_warning(scene: Scene) -> ImporterWarning:
    (warning,) = scene.warnings
    return warning


NOTHING_TO_SHOW = {  # no faces, or only of one or two corners or of vertices that do not exist
    "invalid-face-definition.obj",
    "invalid-relative-texture-index.obj",
    "invalid-relative-vertex-index.obj",
    "issue-356-leading-spaces-newmtl.obj",
}
MARK = b"\xef\xbb\xbf"


def test_byte_order_marks_change_nothing() -> None:
    for obj in (TEXTURED, SQUARE + UVS + "mtllib m.mtl\nusemtl a\nf 1/1 2/2 3/3 4/4\n"):
        scene = imported(MARK + obj.encode(), m__mtl=MARK + b"newmtl a\nKd 1 0 0\n")
        assert diffuse(scene) == [1, 0, 0]
        assert area(scene.meshes[0]) == 1
        assert scene.warnings == ()


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_text_of_two_bytes_is_read(encoding: str) -> None:
    mtl = "\ufeffnewmtl Grün\nKd 1 0 0\n".encode(encoding)
    scene = imported(("\ufeff" + TEXTURED.replace("usemtl a", "usemtl Grün")).encode(encoding), m__mtl=mtl)
    assert [material.name for material in scene.materials] == ["Grün"]
    assert diffuse(scene) == [1, 0, 0]
    assert scene.warnings == ()


def test_a_library_with_another_suffix_is_found() -> None:
    scene = imported(TEXTURED.replace("m.mtl", "m.mat"), m__mtl="newmtl a\nKd 1 0 0\n")
    assert diffuse(scene) == [1, 0, 0]
    assert "“m.mat” is missing; “m.mtl” beside it is used" in str(only_warning(scene))


@pytest.mark.parametrize("line", ["a.mtl b.mtl", "none.mtl b.mtl a.mtl", "a.mtl\nmtllib b.mtl"])
def test_several_libraries_are_read(line: str) -> None:
    obj = f"mtllib {line}\n{SQUARE}usemtl one\nf 1 2 3\nusemtl two\nf 1 3 4\n"
    scene = imported(obj, a__mtl="newmtl one\nKd 1 0 0\n", b__mtl="newmtl two\nKd 0 1 0\n")
    assert [diffuse(scene, 0), diffuse(scene, 1)] == [[1, 0, 0], [0, 1, 0]]
    assert len(scene.warnings) == ("none" in line)


@pytest.mark.parametrize("name", ["my lib.mtl", "my\\ lib.mtl"])
def test_the_name_of_a_library_may_have_spaces(name: str, tmp_path: Path) -> None:
    (tmp_path / "my lib.mtl").write_text("newmtl a\nKd 1 0 0\n")
    scene = imported(TEXTURED.replace("m.mtl", name), tmp_path)
    assert diffuse(scene) == [1, 0, 0]
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("-s 2 2 tex.png", MtlMap("tex.png", scale=(2, 2))),
        ("-s 4 4 1 tex.png", MtlMap("tex.png", scale=(4, 4))),
        ("-s 3 tex.png", MtlMap("tex.png", scale=(3, 1))),
        ("-o 0.5 0 0 my tex.png", MtlMap("my tex.png", offset=(0.5, 0))),
        ("tex.png -bm 0.3", MtlMap("tex.png", strength=0.3)),
        ("-bm .5 tex.png -clamp on", MtlMap("tex.png", strength=0.5, clamp=True)),
        ("-imfchan m -s 2 2 2.png", MtlMap("2.png", scale=(2, 2), channel="m")),
        ("-colorspace sRGB tex.png", MtlMap("tex.png")),
        ("-S 2 3 1 -O .5 TEX.png -CLAMP ON", MtlMap("TEX.png", scale=(2, 3), offset=(0.5, 0), clamp=True)),
        ("-blendu on -texres 512 -boost 1.2 -cc off -mm 0 1 -t 0 0 0 tex.png", MtlMap("tex.png")),
        ("-mm 0.1 0.5 -t 1 tex.png", MtlMap("tex.png", ignored_options=("-mm", "-t"))),
        ('"my tex.png"', MtlMap("my tex.png")),
    ],
)
def test_options_have_one_to_three_numbers_before_or_after_the_name(line: str, expected: MtlMap) -> None:
    assert parse_map(line.split()) == expected


def test_scale_and_offset_move_the_uv_coordinates() -> None:
    scene = imported(TEXTURED, m__mtl="newmtl a\nmap_Kd -s 2 4 -o 0.25 0.5 t.png\n", t__png=picture())
    v_from_bottom = scene.meshes[0].uvs * [1, -1] + [0, 1]
    expected = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) * [2, 4] + [0.25, 0.5]
    np.testing.assert_allclose((v_from_bottom - expected + 0.5) % 1 - 0.5, 0, atol=1e-6)
    np.testing.assert_allclose(np.ptp(scene.meshes[0].uvs, axis=0), [2, 4], atol=1e-6)
    assert scene.warnings == ()


def test_images_with_different_scales_are_tiled() -> None:
    library = "newmtl a\nKe 1\nmap_Kd t.png\nmap_Ke -s 2 3 t.png\n"
    encoded = io.BytesIO()
    PIL.Image.fromarray(rows_of_colors()).save(encoded, "PNG")
    scene = imported(TEXTURED, m__mtl=library, t__png=encoded.getvalue())
    textures = scene.materials[0].textures
    np.testing.assert_array_equal(textures["diffuse"].pixels, rows_of_colors())
    np.testing.assert_array_equal(textures["emission"].pixels, np.tile(rows_of_colors(), (3, 2, 1)))
    assert scene.warnings == ()


def test_unsupported_options_are_named_once() -> None:
    scene = imported(TEXTURED, m__mtl="newmtl a\nmap_Kd -mm 0.1 0.5 t.png\n", t__png=picture())
    assert "-mm of map_Kd" in only_warning(scene)
    assert only_warning(scene).severity == "unsupported"


@pytest.mark.parametrize("name", ["C:\\Users\\me\\t.png", "/home/me/t.png", "D:\\a b\\T.PNG", "missing/t.png"])
def test_paths_of_other_computers_are_found_by_their_last_part(name: str) -> None:
    scene = imported(TEXTURED, m__mtl=f"newmtl a\nmap_Kd {name}\n", t__png=picture())
    assert diffuse(scene) == [1, 0, 0]
    assert "next to the scene" in only_warning(scene)


def test_a_missing_image_leaves_a_visible_surface_and_a_warning() -> None:
    scene = imported(TEXTURED, m__mtl="newmtl a\nKd 0 0 0\nmap_Kd none.png\n")
    assert diffuse(scene) == [0.6, 0.6, 0.6]
    assert only_warning(scene).document() == {
        "text": "Missing image “none.png” (map_Kd of material “a”): import it together with the scene.",
        "severity": "unsupported",
        "where": "material “a”",
    }


def test_a_damaged_image_is_left_out() -> None:
    scene = imported(TEXTURED, m__mtl="newmtl a\nKd 1 0 0\nmap_Kd t.png\n", t__png=b"no image")
    assert diffuse(scene) == [1, 0, 0]
    assert "damaged" in only_warning(scene)


def rows_of_colors() -> np.ndarray:
    """Red, green over blue, white: no flip looks the same. (2, 2, 3)"""
    return np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)


@pytest.mark.parametrize("suffix", ["tga", "bmp", "tif", "gif"])
@pytest.mark.parametrize("writer", ["pillow", "openimageio"])
def test_images_of_other_formats_are_read(suffix: str, writer: str, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    if writer == "pillow":
        PIL.Image.fromarray(rows_of_colors()).save(path)
    else:
        spec = OpenImageIO.ImageSpec(2, 2, 3, "uint8")
        output = OpenImageIO.ImageOutput.create(str(path))
        output.open(str(path), spec)
        output.write_image(rows_of_colors())
        output.close()
    (tmp_path / "m.mtl").write_text(f"newmtl a\nmap_Kd t.{suffix}\n")
    scene = imported(TEXTURED, tmp_path)
    np.testing.assert_array_equal(scene.materials[0].textures["diffuse"].pixels, rows_of_colors())
    assert scene.warnings == ()


def test_the_alpha_of_a_targa_is_opacity() -> None:
    encoded = io.BytesIO()
    alpha = np.dstack([rows_of_colors(), np.array([[255, 128], [0, 255]], np.uint8)])
    PIL.Image.fromarray(alpha).save(encoded, "TGA")
    scene = imported(TEXTURED, m__mtl="newmtl a\nmap_Kd t.tga\nmap_d t.tga\n", t__tga=encoded.getvalue())
    opacity = scene.materials[0].opacity
    assert opacity is not None
    assert opacity.alpha.tolist() == [[255, 128], [0, 255]]
    np.testing.assert_array_equal(scene.materials[0].textures["diffuse"].pixels, rows_of_colors())


@pytest.mark.parametrize("text", ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND00", "1.#INF", "nan(snan)"])
def test_texts_for_no_number_in_normals_and_uvs_are_made_anew(text: str) -> None:
    obj = f"{SQUARE}vt {text} 0\nvn {text} {text} {text}\nvn 0 0.6 0.8\nf 1/1/1 2/1/2 3/1/2\n"
    scene = imported(obj)
    mesh = scene.meshes[0]
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1], [0, 0.6, 0.8], [0, 0.6, 0.8]], atol=1e-6)
    np.testing.assert_array_equal(mesh.uvs, np.zeros((3, 2)))
    assert [warning.severity for warning in scene.warnings] == ["unsupported", "approximated"]


def test_faces_without_normals_get_them() -> None:
    scene = imported(SQUARE + "f 1//1 2//2 3//3\n")
    np.testing.assert_allclose(scene.meshes[0].normals, [[0, 0, 1]] * 3, atol=1e-6)
    assert only_warning(scene).severity == "approximated"
    mixed = imported(SQUARE + "vn 0 0.6 0.8\nf 1//1 2//1 3//1\nf 1 3 4\n")
    np.testing.assert_allclose(mixed.meshes[0].normals, [[0, 0.6, 0.8]] * 3 + [[0, 0, 1]] * 3, atol=1e-6)


ARMS = [(4, 0), (4, 1), (1, 1), (1, 4), (0, 4), (0, 0)]  # an L that begins at a tip
CUP = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)]
STAR = [((1, 0.4)[k % 2] * np.sin(k * np.pi / 5), (1, 0.4)[k % 2] * np.cos(k * np.pi / 5)) for k in range(10)]
DART = [(0, 0), (1, 0.2), (2, 0), (1, 3)]


@pytest.mark.parametrize("corners", [ARMS, CUP, STAR, DART], ids=["L", "C", "star", "dart"])
@pytest.mark.parametrize("order", [1, -1])
def test_concave_polygons_have_their_area(corners: list[tuple[float, float]], order: int) -> None:
    points = np.array(corners)[::order]
    x, y = points.T
    signed = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
    tilt = np.array([[1, 0, 0], [0, 0.6, 0.8]])
    for first in range(len(points)):
        rolled = np.roll(points, first, axis=0) @ tilt
        lines = "".join(f"v {a} {b} {c}\n" for a, b, c in rolled)
        scene = imported(lines + "f " + " ".join(map(str, range(1, len(points) + 1))) + "\n")
        (mesh,) = scene.meshes
        assert area(mesh) == pytest.approx(abs(signed), rel=1e-5)
        np.testing.assert_allclose(mesh.normals @ np.cross(*tilt), np.sign(signed), atol=1e-5)
        assert scene.warnings == ()


def test_polygons_that_cross_themselves_are_filled_and_named() -> None:
    bow = imported("v 0 0 0\nv 2 1 0\nv 2 0 0\nv 0 1 0\nf 1 2 3 4\n")
    assert bow.meshes[0].positions.size
    assert "edges cross" in only_warning(bow)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((5, 3)),
        np.arange(6)[:, None] * np.ones(3),
        np.random.default_rng(7).random((300, 3)),
        np.tile([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], (20, 1)),
    ],
    ids=["point", "line", "noise", "repeated"],
)
def test_any_polygon_is_cut_into_at_most_two_triangles_fewer_than_corners(points: np.ndarray) -> None:
    triangles, _ = clip_ears(points.astype(np.float64))
    assert len(triangles) <= len(points) - 2
    assert triangles.size == 0 or (triangles.min() >= 0 and triangles.max() < len(points))


def test_convex_polygons_stay_fans() -> None:
    angle = np.arange(12) * np.pi / 6
    lines = "".join(f"v {x} {y} 0\n" for x, y in zip(np.cos(angle), np.sin(angle), strict=True))
    mesh = imported(lines + "f " + " ".join(map(str, range(1, 13))) + "\n").meshes[0]
    np.testing.assert_allclose(mesh.positions[mesh.faces[:, 0]], [[1, 0, 0]] * 10, atol=1e-6)


def test_materials_without_a_library_are_gray_with_a_warning() -> None:
    scene = imported(SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    assert "names no material file" in only_warning(scene)
    assert "“a”, “b”" in only_warning(scene)
    assert [material.name for material in scene.materials] == ["a", "b"]


def test_tabs_comments_and_case_are_read() -> None:
    obj = "mtllib\tm.mtl # all of them\n\tv\t0 0 0 # first\nv 1 0 0 #second\nv 1 1 0\nusemtl\ta # note\nf 1 2 3 # one\n"
    scene = imported(obj, m__mtl="newmtl\ta # note\n\tkd\t1 0 0 # red\n")
    assert diffuse(scene) == [1, 0, 0]
    assert area(scene.meshes[0]) == 0.5
    assert scene.warnings == ()


def test_names_may_have_a_number_sign() -> None:
    obj = f"mtllib m.mtl\n{SQUARE}usemtl Material #25\nf 1 2 3\nusemtl Material #26\nf 1 3 4\n"
    scene = imported(obj, m__mtl="newmtl Material #25\nKd 1 0 0\nnewmtl Material #26\nKd 0 1 0\n")
    assert [diffuse(scene, 0), diffuse(scene, 1)] == [[1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize("ending", ["\r", "\r\n", "\n"])
def test_all_line_endings_and_continuations_are_read(ending: str) -> None:
    obj = TEXTURED.replace("2/2 3/3", "2/2 \\\n3/3").replace("\n", ending)
    scene = imported(obj, m__mtl="newmtl a\nKd 1 \\\n0 0\n".replace("\n", ending))
    assert diffuse(scene) == [1, 0, 0]
    assert area(scene.meshes[0]) == 1
    assert scene.warnings == ()


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
def test_names_in_latin_1_are_read(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "grün.png").write_bytes(picture())
    (tmp_path / "m.mtl").write_bytes("newmtl Größe\nmap_Kd grün.png\n".encode(encoding))
    scene = imported(TEXTURED.replace("usemtl a", "usemtl Größe").encode(encoding), tmp_path)
    assert diffuse(scene) == [1, 0, 0]
    assert scene.materials[0].name == "Größe"
    assert scene.warnings == ()


def test_vertex_colors_up_to_255_are_scaled() -> None:
    scene = imported("v 0 0 0 255 0 0\nv 1 0 0 255 0 0\nv 0 1 0 255 0 0\nf 1 2 3\n")
    small = imported("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n")
    assert diffuse(scene) == diffuse(small)
    assert "0 to 255" in only_warning(scene)
    assert small.warnings == ()


def test_far_coordinates_keep_their_shape_and_the_offset() -> None:
    corners = np.array([[500000.3, 4500000.3, 10], [500000.4, 4500000.3, 10], [500000.4, 4500000.4, 10]])
    scene = imported("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist()) + "f 1 2 3\n")
    np.testing.assert_allclose(scene.meshes[0].positions + np.array(scene.offset), corners, atol=2e-9)
    assert area(scene.meshes[0]) == pytest.approx(0.005, rel=1e-6)
    assert only_warning(scene).severity == "ignored"


def test_faces_out_of_range_are_left_out() -> None:
    for bad in ("f 1 2 99", "f -99 1 2", "f 0 1 2", "f 1 2 99999999999999999999", "v 0 0 nan\nf 1 2 5"):
        scene = imported(SQUARE + "f 1 2 3\n" + bad + "\n")
        assert len(scene.meshes[0].faces) == 1
        assert "Left out 1 face of" in only_warning(scene)


def test_lines_that_cannot_be_read_are_left_out_and_listed() -> None:
    bad = "v a b c\nf 1 2\nf 1/2/3/4 2 3\nvt\nf 1 2 x\n"
    scene = imported(SQUARE + bad + "v 0 0 1\nf 1 2 3\nf 1 2 6\n")
    assert len(scene.meshes[0].faces) == 2
    assert scene.meshes[0].positions[5].tolist() == [0, 0, 1]
    message = only_warning(scene)
    assert "5 lines" in message
    assert "line 5 (“v a b c”), line 6 (“f 1 2”), line 7 (“f 1/2/3/4 2 3”) and 2 more" in message
    assert message.document()["where"] == "line 5"


def test_numbers_of_materials_that_cannot_be_used_are_listed() -> None:
    scene = imported(TEXTURED, m__mtl="newmtl a\nKd 1 0 0\nNs -1\nKd nan 0 0\nKe 1e300\n")
    assert diffuse(scene) == [1, 0, 0]
    assert "line 3 (“Ns -1”), line 4 (“Kd nan 0 0”), line 5 (“Ke 1e300”)" in only_warning(scene)


def test_a_file_without_anything_to_show_lists_all_its_faults() -> None:
    with pytest.raises(SceneError, match=r"no triangles with an area.*line 1 .*vertices do not exist"):
        imported("v a b c\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def test_empty_objects_and_groups_are_skipped() -> None:
    scene = imported(SQUARE + "o none\ng\ng a b\nusemtl x\no Box\nusemtl y\nf 1 2 3\no last\n")
    assert [mesh.name for mesh in scene.meshes] == ["Box"]
    assert [material.name for material in scene.materials] == ["y"]


def test_files_of_other_readers_tests_are_read(shared_data: Path) -> None:
    folder = shared_data / "conformance" / "tinyobjloader"
    refused = set()
    for path in sorted(folder.glob("*.obj")):
        try:
            import_scene(path, path.stem, LIGHT)
        except SceneError:
            refused.add(path.name)
    assert refused <= NOTHING_TO_SHOW
