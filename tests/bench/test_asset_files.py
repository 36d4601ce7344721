"""Files for `assets.*`: which are measured, and readers of the peer against what the files say."""

from pathlib import Path

import numpy as np
import pytest

from relume_bench.asset_files import asset_files
from relume_bench.mesh_plain import read_obj, read_ply

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def grid(num: int) -> str:
    points = [f"v {x} {y} 0" for y in range(num + 1) for x in range(num + 1)]
    first = [1 + x + (num + 1) * y for y in range(num) for x in range(num)]
    return "\n".join([*points, *(f"f {k} {k + 1} {k + num + 2} {k + num + 1}" for k in first)])


def test_files_are_chosen_by_rule(tmp_path: Path) -> None:
    texts = {
        "a/grid.obj": grid(4), "b/grid.obj": grid(5), "series/plane_00.obj": grid(4), "series/plane_01.obj": grid(5),
        "small.obj": SQUARE, "bad-inputs/other.obj": grid(4), "broken.obj": "v 0 0 0\nf 1 2 3\n", "notes.txt": "none",
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    assert [name for name, _ in asset_files(tmp_path)] == ["a/grid.obj", "series/plane_01.obj"]


def test_obj_has_its_uvs_normals_and_materials(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 0.8 0.1 0.1\nPr 0.3\nPm 1\n")
    (tmp_path / "a.obj").write_text("mtllib m.mtl\nusemtl red\n" + SQUARE)
    file = read_obj(tmp_path / "a.obj")
    (shape,) = file.shapes
    np.testing.assert_array_equal(shape.attributes["TEXCOORD_0"][:3], [[0, 1], [1, 1], [1, 0]])
    np.testing.assert_allclose(shape.attributes["NORMAL"], [[0, 0, 1]] * 6)
    pbr = file.json["materials"][shape.material]["pbrMetallicRoughness"]
    assert pbr == {"metallicFactor": 1, "roughnessFactor": 0.3, "baseColorFactor": [0.8, 0.1, 0.1, 1]}


@pytest.mark.parametrize("degrees", [40.0, 80.0])
def test_normals_are_smooth_up_to_the_crease(tmp_path: Path, degrees: float) -> None:
    """Two squares that meet at an angle."""
    x, z = 1 + np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (x, 0, z), (x, 1, z)]
    text = "".join(f"v {a} {b} {c}\n" for a, b, c in points) + "f 1 2 3 4\nf 2 5 6 3\n"
    (tmp_path / "a.obj").write_text(text)
    (shape,) = read_obj(tmp_path / "a.obj").shapes
    at_edge = shape.attributes["NORMAL"][np.isclose(shape.attributes["POSITION"][:, 0], 1)]
    assert (np.abs(at_edge[:, 2] - 1) < 1e-6).any() == (degrees > 60)


@pytest.mark.parametrize("order", ["ascii", "little", "big"])
def test_ply_in_text_and_binary(tmp_path: Path, order: str) -> None:
    name = "ascii" if order == "ascii" else f"binary_{order}_endian"
    header = f"ply\nformat {name} 1.0\nelement vertex 4\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    header += "".join(f"property uchar {color}\n" for color in ("red", "green", "blue"))
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    if order == "ascii":
        body = "".join(f"{x} {y} {z} 255 128 0\n" for x, y, z in corners).encode() + b"4 0 1 2 3\n"
    else:
        sign = "<" if order == "little" else ">"
        body = b"".join(np.array(c, f"{sign}f4").tobytes() + bytes([255, 128, 0]) for c in corners)
        body += b"\4" + np.array([0, 1, 2, 3], f"{sign}i4").tobytes()
    (tmp_path / "a.ply").write_bytes(header.encode() + body)
    (shape,) = read_ply(tmp_path / "a.ply").shapes
    np.testing.assert_array_equal(shape.attributes["POSITION"], np.array(corners)[[0, 1, 2, 0, 2, 3]])
    np.testing.assert_allclose(shape.attributes["COLOR_0"][0], [1, 0.2158605, 0], rtol=1e-4)
