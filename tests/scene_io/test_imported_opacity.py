"""Opacity of imported materials."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from glb_builder import Glb

from relume.assets.environments.environment import Environment
from relume.scene.model import Opacity, Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
HALVES = np.array([[[9, 9, 9, 0], [9, 9, 9, 200]]], np.uint8)
TRIANGLE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"


def imported(pixels: Any = None, factor: float = 1.0, **material: Any) -> Scene:
    glb = Glb()
    surface: dict[str, Any] = {"baseColorFactor": [1, 1, 1, factor]}
    if pixels is not None:
        surface["baseColorTexture"] = {"index": glb.texture(pixels)}
    return import_gltf(glb.quad({"pbrMetallicRoughness": surface, **material}).bytes(), "test", LIGHT)


def opacity_of(*args: Any, **material: Any) -> Opacity | None:
    scene = imported(*args, **material)
    assert scene.warnings == ()
    return scene.materials[0].opacity


def test_alpha_is_ignored_for_opaque_materials() -> None:
    assert opacity_of(HALVES) is None
    assert opacity_of(HALVES, alphaMode="OPAQUE") is None


@pytest.mark.parametrize(("mode", "cutoff"), [("MASK", 0.5), ("BLEND", None)])
def test_alpha_of_the_base_color_is_opacity(mode: str, cutoff: float | None) -> None:
    opacity = opacity_of(HALVES, 0.9, alphaMode=mode)
    assert opacity is not None
    assert opacity.cutoff == cutoff
    assert opacity.alpha.tolist() == [[0, 180]]


def test_an_opaque_alpha_channel_has_no_holes() -> None:
    assert opacity_of(alphaMode="MASK") is None
    assert opacity_of(alphaMode="BLEND") is None
    assert opacity_of(HALVES + np.uint8([0, 0, 0, 55]), alphaMode="MASK", alphaCutoff=0.2) is None
    assert opacity_of(HALVES, alphaMode="MASK", alphaCutoff=0.0) is None
    almost = np.full((8, 8, 4), 254, np.uint8)
    assert opacity_of(almost, alphaMode="BLEND") is None


def test_constant_opacity_is_stored_as_one_texel() -> None:
    opacity = opacity_of(factor=0.2, alphaMode="BLEND")
    assert opacity is not None
    assert opacity.alpha.tolist() == [[51]]


@pytest.mark.parametrize(
    "material",
    [
        {"alphaMode": "BLEND", "factor": 0.0},
        {"alphaMode": "MASK", "factor": 0.4},
        {"alphaMode": "MASK", "alphaCutoff": 1.5},
        {"alphaMode": "MASK", "pixels": HALVES * np.uint8([1, 1, 1, 0])},
    ],
)
def test_a_fully_transparent_material_gives_a_warning(material: dict[str, Any]) -> None:
    scene = imported(**material)
    assert "fully transparent" in str(scene.warnings[0])
    opacity = scene.materials[0].opacity
    assert opacity is not None
    assert opacity.alpha.max() <= 102


def test_an_invalid_cutoff_is_the_default() -> None:
    opacity = imported(HALVES, alphaMode="MASK", alphaCutoff="half").materials[0].opacity
    assert opacity is not None
    assert opacity.cutoff == 0.5


def test_a_file_with_a_number_that_is_no_json_is_rejected() -> None:
    with pytest.raises(Exception, match="JSON"):
        imported(HALVES, alphaMode="MASK", alphaCutoff=float("inf"))


def png(pixels: Any) -> bytes:
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.asarray(pixels, np.uint8)).save(encoded, "PNG")
    return encoded.getvalue()


def of_library(folder: Path, library: str, image: Any = None) -> Opacity | None:
    (folder / "m.mtl").write_text(f"newmtl a\nKd 1 1 1\n{library}\n")
    if image is not None:
        (folder / "holes.png").write_bytes(png(image))
    (folder / "thing.obj").write_text(TRIANGLE)
    return import_scene(folder / "thing.obj", "thing", LIGHT).materials[0].opacity


def test_obj_libraries_define_opacity_in_three_ways(tmp_path: Path) -> None:
    for library in ("d 0.4", "Tr 0.6"):
        opacity = of_library(tmp_path, library)
        assert opacity is not None
        assert (opacity.alpha.tolist(), opacity.cutoff) == ([[102]], None)
    assert of_library(tmp_path, "d 1") is None
    gray = np.array([[[10, 10, 10], [250, 250, 250]]])
    for library in ("map_d holes.png", "d 0\nmap_d holes.png"):
        of_grey = of_library(tmp_path, library, gray)
        assert of_grey is not None
        assert of_grey.alpha.tolist() == [[10, 250]]
    of_alpha = of_library(tmp_path, "map_d holes.png", HALVES)
    assert of_alpha is not None
    assert of_alpha.alpha.tolist() == [[0, 200]]
