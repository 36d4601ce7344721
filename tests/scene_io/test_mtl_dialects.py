"""Interpretation of Ks in .mtl files of several programs, and of bump maps."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from relume.assets.environments.environment import Environment
from relume.scene.model import Material, Scene, TextureEncoding
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
TRIANGLE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl M\nf 1/1 2/2 3/3\n"

BLENDER_4 = """# Blender 4.0.2 MTL File: 'None'
# www.blender.org

newmtl M
Ns 250.000000
Ka 1.000000 1.000000 1.000000
Kd 0.250000 0.120000 0.050000
Ks 0.500000 0.500000 0.500000
Ke 0.000000 0.000000 0.000000
Ni 1.500000
d 1.000000
illum 2
"""
BLENDER_2_8 = """# Blender MTL File: 'room.blend'
# Material Count: 1

newmtl M
Ns 323.999994
Ka 1.000000 1.000000 1.000000
Kd 0.800000 0.800000 0.800000
Ks 0.500000 0.500000 0.500000
Ke 0.000000 0.000000 0.000000
Ni 1.450000
d 1.000000
illum 2
"""
BLENDER_METAL = BLENDER_4.replace("illum 2", "illum 3").replace("Ns 250.000000", "Ns 640.000000")
BLENDER_PBR = """# Blender 4.2.1 LTS MTL File: 'cup.blend'
# www.blender.org

newmtl M
Kd 0.800000 0.100000 0.100000
Ks 0.250000 0.250000 0.250000
Ke 0.000000 0.000000 0.000000
Ni 1.500000
d 1.000000
illum 2
Pr 0.300000
Pm 0.000000
Ps 0.000000
Pc 0.500000
Pcr 0.030000
aniso 0.000000
anisor 0.000000
"""
MAYA = (
    "newmtl M\nillum 4\nKd 0.50 0.00 0.00\nKa 0.00 0.00 0.00\nTf 1.00 1.00 1.00\nNi 1.00\nKs 0.50 0.50 0.50\nNs 18.00\n"
)
SKETCHUP = """## Alias OBJ Material File
# Exported from SketchUp, (c) 2000-2012 Trimble Navigation Limited

newmtl M
Ka 0.000000 0.000000 0.000000
Kd 0.545098 0.270588 0.074510
Ks 0.330000 0.330000 0.330000
"""
MESHLAB = """#
# Wavefront material file
# Converted by Meshlab Group
#

newmtl M
Ka 0.2 0.2 0.2
Kd 0.75 0.75 0.75
Ks 1.0 1.0 1.0
Tr 0.0
illum 2
Ns 0.0
"""
MAX = """# 3ds Max Wavefront OBJ Exporter v0.97b - (c)2007 guruware
# File Created: 10.01.2012 12:09:34

newmtl M
\tNs 30.0000
\tNi 1.5000
\td 1.0000
\tTr 0.0000
\tTf 1.0000 1.0000 1.0000
\tillum 2
\tKa 0.5880 0.5880 0.5880
\tKd 0.5880 0.5880 0.5880
\tKs 0.3600 0.3600 0.3600
"""
GOLD_OF_OPENGL = (
    "newmtl M\nKa 0.24725 0.1995 0.0745\nKd 0.75164 0.60648 0.22648\nKs 0.628281 0.555802 0.366065\nNs 51.2\n"
)
MIRROR = "newmtl M\nKd 0 0 0\nKs 0.8 0.8 0.8\nNs 900\nillum 2\n"
REFLECTING = "newmtl M\nKd 0.4 0.4 0.4\nKs 0.6 0.6 0.6\nNs 76.8\nillum 3\n"


def scene_of(folder: Path, library: str) -> Scene:
    (folder / "m.mtl").write_text(library)
    (folder / "thing.obj").write_text(TRIANGLE)
    return import_scene(folder / "thing.obj", "thing", LIGHT)


def material_of(folder: Path, library: str) -> Material:
    (material,) = scene_of(folder, library).materials
    return material


def params_of(material: Material) -> dict[str, Any]:
    params: dict[str, Any] = material.terms[1]["params"]
    return params


@pytest.mark.parametrize(
    ("library", "f0", "roughness"),
    [
        (BLENDER_4, 0.04, 0.5),
        (BLENDER_4.replace("Ks 0.500000 0.500000 0.500000", "Ks 1 1 1"), 0.08, 0.5),
        (BLENDER_2_8, 0.04, 0.4),
        (BLENDER_2_8.replace("Ns 323.999994", "Ns 900"), 0.04, 0.01),
        (BLENDER_PBR, 0.02, 0.3),
        (MAYA, 0.04, 0.1**0.25),
        (SKETCHUP, 0.04, (2 / 52) ** 0.25),
        (MESHLAB, 0.04, 1.0),
        (MAX, 0.04, 0.5),
    ],
)
def test_plastic_of_every_program_reflects_as_a_dielectric(
    tmp_path: Path, library: str, f0: float, roughness: float
) -> None:
    scene = scene_of(tmp_path, library)
    material = scene.materials[0]
    assert [term["model"] for term in material.terms[:2]] == ["lambert", "ggx"]
    assert params_of(material)["f0"] == pytest.approx([f0] * 3, abs=1e-6)
    assert params_of(material)["roughness"] == pytest.approx(roughness, abs=1e-3)
    (import_warning,) = scene.warnings
    assert import_warning.startswith("Ks of material “M” was read as ")
    assert "4 % (F0 0.04)" in import_warning
    assert ("Blender" in import_warning) == library.startswith("# Blender")
    assert import_warning.severity == "approximated"


def test_a_coat_of_the_pbr_extension_is_a_coat(tmp_path: Path) -> None:
    coat = material_of(tmp_path, BLENDER_PBR).terms[2]
    assert (coat["model"], coat["color"], coat["params"]["f0"]) == ("ggx", [0.5] * 3, pytest.approx(0.04))
    assert len(material_of(tmp_path, BLENDER_PBR.replace("Pc 0.5", "Pc 0.0")).terms) == 2


def test_a_metal_of_blender_has_the_color_of_its_base(tmp_path: Path) -> None:
    metal = material_of(tmp_path, BLENDER_METAL)
    assert metal.terms[0]["color"] == [0, 0, 0]
    assert params_of(metal)["f0"] == [0.25, 0.12, 0.05]
    assert params_of(metal)["roughness"] == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(
    ("library", "color"),
    [(GOLD_OF_OPENGL, [0.628281, 0.555802, 0.366065]), (MIRROR, [0.8] * 3), (REFLECTING, [0.6] * 3)],
)
def test_unambiguous_metals_are_read_literally(tmp_path: Path, library: str, color: list[float]) -> None:
    scene = scene_of(tmp_path, library)
    assert scene.materials[0].terms[1]["model"] == "blinn_phong"
    assert scene.materials[0].terms[1]["color"] == color
    assert scene.warnings == ()


def test_a_gray_below_that_of_plastic_is_read_literally(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, MAYA.replace("Ks 0.50 0.50 0.50", "Ks 0.02 0.02 0.02"))
    assert params_of(scene.materials[0])["f0"] == [0.02] * 3
    assert scene.warnings == ()


def test_materials_without_ks_are_diffuse(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BLENDER_4.replace("Ks 0.500000 0.500000 0.500000", "Ks 0 0 0"))
    assert [term["model"] for term in scene.materials[0].terms] == ["lambert"]
    assert scene.warnings == ()


def test_images_without_colors_are_not_attenuated(tmp_path: Path) -> None:
    PIL.Image.new("RGB", (2, 2), (128, 128, 128)).save(tmp_path / "x.png")
    without = "\n".join(line for line in BLENDER_4.splitlines() if not line.startswith(("Kd", "Ks", "Ns")))
    material = material_of(tmp_path, without + "\nmap_Kd x.png\nmap_Ks x.png\n")
    assert material.terms[0]["color"] == pytest.approx([1.0] * 3, abs=0.09)  # except by the reflection above it
    assert material.terms[0]["texture"] == "diffuse"
    assert material.terms[1]["texture"] == "specular"
    assert params_of(material) == {"roughness": 0.5, "f0": [0.08] * 3}


def test_one_warning_covers_all_materials(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(MAYA + MAYA.replace("newmtl M", "newmtl N"))
    (tmp_path / "thing.obj").write_text(TRIANGLE + "usemtl N\nf 3/3 2/2 1/1\n")
    (import_warning,) = import_scene(tmp_path / "thing.obj", "thing", LIGHT).warnings
    assert "“M” and 1 more" in import_warning


@pytest.mark.parametrize("line", ["Ka spectral x.rfl", "illum on", "Pc -1", "aniso nan"])
def test_invalid_optional_statements_are_ignored(tmp_path: Path, line: str) -> None:
    assert len(material_of(tmp_path, f"{MIRROR}{line}\n").terms) == 2


def image(kind: str) -> bytes:
    """A tangent-space normal map of a ripple, or its heights in gray."""
    x = np.linspace(0, 4 * np.pi, 64)
    slope = np.broadcast_to(0.4 * np.cos(x), (64, 64))
    normals = np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = np.broadcast_to((127.5 + 120 * np.sin(x))[:, None], (64, 64, 3))
    pixels = 127.5 * (normals + 1) if kind == "normals" else heights
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.round(pixels).astype(np.uint8)).save(encoded, "PNG")
    return encoded.getvalue()


@pytest.mark.parametrize("keyword", ["map_Bump -bm 1.000000", "map_bump", "bump", "norm"])
def test_a_bump_map_of_normals_is_a_normal_map(tmp_path: Path, keyword: str) -> None:
    (tmp_path / "tiles.png").write_bytes(image("normals"))
    scene = scene_of(tmp_path, f"newmtl M\nKd 1 1 1\n{keyword} tiles.png\n")
    assert scene.materials[0].normal_map is not None
    assert scene.warnings == ()


@pytest.mark.parametrize(("option", "strength"), [("", 1.0), ("-bm 0.5", 0.5), ("-bm strong", 1.0)])
def test_a_normal_map_has_the_strength_in_the_file(tmp_path: Path, option: str, strength: float) -> None:
    (tmp_path / "tiles.png").write_bytes(image("normals"))
    material = material_of(tmp_path, f"newmtl M\nKd 1 1 1\nmap_Bump {option} tiles.png\n")
    assert material.normal_map is not None
    assert material.normal_map.encoding == TextureEncoding("normal", (strength, strength, 1.0))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("map_Bump heights.png", ("“heights.png”", "height map")),
        ("map_Bump C:\\art\\tiles_nrm.png", ("tiles_nrm.png", "Skipped")),
        ("bump /home/ann/tiles_nrm.png", ("tiles_nrm.png", "Skipped")),
        ("map_Bump tiles_nrm.png", ("“tiles_nrm.png”", "Missing")),
        ("map_Bump broken.png", ("map_Bump", "Skipped")),
        ("disp tiles_disp.png", ("“tiles_disp.png”", "not supported")),
        ("map_Pm tiles_metal.png", ("“tiles_metal.png”", "not supported")),
        (f"map_Ns {'deep/' * 40}gloss.png", ("gloss.png”", "not supported")),
    ],
)
def test_a_missing_map_is_a_named_error(tmp_path: Path, line: str, message: tuple[str, ...]) -> None:
    (tmp_path / "heights.png").write_bytes(image("heights"))
    (tmp_path / "broken.png").write_bytes(b"no image")
    scene = scene_of(tmp_path, f"newmtl M\nKd 1 1 1\n{line}\n")
    assert scene.materials[0].normal_map is None
    (import_warning,) = scene.warnings
    assert import_warning.severity == "unsupported"
    assert all(word in import_warning for word in message)


def test_an_ambient_map_is_ignored(tmp_path: Path) -> None:
    (import_warning,) = scene_of(tmp_path, "newmtl M\nKd 1 1 1\nmap_Ka x.png\n").warnings
    assert import_warning.severity == "ignored"


GLASS = "newmtl M\nKd 0.2 0.2 0.2\nKs 0.5 0.5 0.5\nTf 0.9 0.5 1\nNi 1.5\nd 1\nNs 300\nillum 7\n"


def test_refracting_models_are_glass(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, GLASS)
    material = scene.materials[0]
    assert material.glass is not None
    assert (material.glass.tint, material.glass.ior) == ((0.9, 0.5, 1.0), 1.5)
    assert material.glass.thickness > 0  # refracts
    assert material.glass.absorbed == (0, 0, 0)
    assert params_of(material)["f0"] == pytest.approx([0.04] * 3)
    diffuse = np.array(material.terms[0]["color"])  # what does not pass, below the reflection
    np.testing.assert_allclose(diffuse / diffuse[1], [0.2, 1, 0], atol=1e-4)
    assert scene.warnings == ("Illumination model 7 of material “M” was read as solid glass.",)


@pytest.mark.parametrize(
    ("written", "instead"),
    [
        ("illum 7", "illum 2"),
        ("Ni 1.5", "Ni 1"),
        ("Tf 0.9 0.5 1", "Tf 0 0 0"),
        ("\nd 1", "\nd 0.5"),
        ("Ni 1.5", "Ni 9"),
    ],
)
def test_surfaces_that_do_not_refract_are_no_glass(tmp_path: Path, written: str, instead: str) -> None:
    material = material_of(tmp_path, GLASS.replace(written, instead))
    assert material.glass is None
    assert (material.opacity is not None) == ("0.5" in instead)
