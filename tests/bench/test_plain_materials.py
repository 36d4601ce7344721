"""Glass of glTF files as the peer's own plugins, and triangles of all kinds of primitives."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from relume_bench.gltf_plain import _TRIANGLES, File, Shape, _complete_normals
from relume_bench.plain_job import make_job
from relume_bench.plain_materials import Materials


def glass(pbr: dict | None = None, **extensions: dict) -> tuple[dict, dict]:
    named = {f"KHR_materials_{name}": value for name, value in extensions.items()}
    file = File({"materials": [{"pbrMetallicRoughness": pbr or {}, "extensions": named}]}, Path())
    materials = Materials(file)
    return materials.bsdf(0, {}), materials.arrays


def test_thin_glass_has_an_index_that_is_a_float() -> None:
    """Mitsuba refuses an integer."""
    bsdf, arrays = glass({"baseColorFactor": [0.5, 1, 1, 1]}, transmission={"transmissionFactor": 1}, ior={"ior": 2})
    assert bsdf["type"] == "thindielectric"
    assert isinstance(bsdf["int_ior"], float)
    np.testing.assert_allclose(arrays[bsdf["specular_transmittance"]["array"]], [[[0.5, 1, 1]]])


def test_clear_solids_have_no_medium() -> None:
    """Free paths in a medium that absorbs nothing are NaN."""
    transmission = {"transmissionFactor": 1}
    clear, _ = glass({"roughnessFactor": 0}, transmission=transmission, volume={"thicknessFactor": 1})
    assert clear["type"] == "dielectric"
    assert "interior" not in clear
    volume = {"thicknessFactor": 1, "attenuationColor": [0.5, 1, 0.25], "attenuationDistance": 2}
    tinted, _ = glass({"roughnessFactor": 0}, transmission=transmission, volume=volume)
    absorbed = np.array(tinted["interior"]["sigma_t"]["value"]) * tinted["interior"]["scale"]
    np.testing.assert_allclose(np.exp(-2 * absorbed), [0.5, 1, 0.25])


@pytest.mark.parametrize(("ior", "expected"), [(1.5, 1.5), (1, 1.01)])
def test_frosted_glass_has_half_vectors(ior: float, expected: float) -> None:
    volume = {"thicknessFactor": 1}
    bsdf, arrays = glass(
        {"roughnessFactor": 0.5}, transmission={"transmissionFactor": 1}, volume=volume, ior={"ior": ior}
    )
    assert bsdf["type"] == "roughdielectric"
    assert bsdf["int_ior"] == expected
    np.testing.assert_allclose(arrays[bsdf["alpha"]["array"]], 0.25)


def test_partial_transmission_is_a_blend() -> None:
    bsdf, arrays = glass(transmission={"transmissionFactor": 0.25})
    assert bsdf["type"] == "blendbsdf"
    assert [bsdf[key]["type"] for key in ("opaque", "other")] == ["gltf", "thindielectric"]
    np.testing.assert_allclose(arrays[bsdf["weight"]["array"]], 0.25)


@pytest.mark.parametrize(
    ("mode", "num", "triangles"),
    [(4, 7, [(0, 1, 2), (3, 4, 5)]), (5, 5, [(0, 1, 2), (2, 1, 3), (2, 3, 4)]), (6, 4, [(0, 1, 2), (0, 2, 3)])],
)
def test_primitives_are_triangles(mode: int, num: int, triangles: list) -> None:
    np.testing.assert_array_equal(_TRIANGLES[mode](np.arange(num, dtype=np.uint32)), triangles)


@pytest.mark.parametrize(("two_sided", "glow", "num"), [(True, 1, 2), (False, 1, 1), (True, 0, 1)])
def test_surfaces_that_shine_on_both_sides_are_two(two_sided: bool, glow: float, num: int) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    shape = Shape({"POSITION": corners, "NORMAL": np.tile(np.float32([0, 0, 1]), (3, 1))}, np.uint32([[0, 1, 2]]), 0)
    material = {"doubleSided": two_sided, "emissiveFactor": [glow] * 3}
    arrays, job = make_job(File({"materials": [material]}, Path(), [shape]))
    assert len(job["bsdfs"]) == num
    normals = [arrays[f"normals_{k}"][0, 2] for k in range(num)]
    assert normals == [1, -1][:num]
    for k, normal in enumerate(normals):
        a, b, c = arrays[f"positions_{k}"][arrays[f"faces_{k}"][0]]
        assert np.sign(np.cross(b - a, c - a)[2]) == normal
        assert num == 1 or np.sign(a[2]) == normal


def triangle(**attributes: np.ndarray) -> Shape:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    return Shape(
        {"POSITION": corners, "NORMAL": np.tile(np.float32([0, 0, 1]), (3, 1)), **attributes}, np.uint32([[0, 1, 2]]), 0
    )


def test_alpha_of_vertex_colors_multiplies_opacity() -> None:
    file = File({"materials": [{"alphaMode": "BLEND"}]}, Path(), [triangle(COLOR_0=np.full((3, 4), 0.5, np.float32))])
    arrays, job = make_job(file)
    (bsdf,) = job["bsdfs"]
    assert bsdf["opacity"] == {"type": "mesh_attribute", "name": "vertex_alpha"}
    assert bsdf["content"]["type"] == "mask"
    np.testing.assert_array_equal(arrays["alpha_of_0"], np.full((3, 1), 0.5))


def test_texture_coordinates_are_the_set_that_textures_name() -> None:
    sets = {f"TEXCOORD_{k}": np.full((3, 2), k, np.float32) for k in range(2)}
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}
    material["occlusionTexture"] = {"index": 0}
    assert Materials(File({"materials": [material]}, Path())).uv_set(0) == 1
    transform = {"KHR_texture_transform": {"texCoord": 0}}
    material["normalTexture"] = {"index": 0, "texCoord": 1, "extensions": transform}
    with pytest.raises(ValueError, match="several sets"):
        Materials(File({"materials": [material]}, Path())).uv_set(0)
    arrays, _ = make_job(File({"materials": [{}]}, Path(), [triangle(**sets)]))
    np.testing.assert_array_equal(arrays["uvs_0"], np.zeros((3, 2)))


def test_normals_without_length_are_those_of_the_triangles() -> None:
    """The format forbids them, and Mitsuba renders them black."""
    normals = np.array([[0, 0, 0], [0, 0, 0], [0, 3, 4]], np.float32)
    attributes = triangle().attributes
    completed = _complete_normals(normals, attributes, np.uint32([[0, 1, 2]]))
    np.testing.assert_allclose(completed, [[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8]])


def test_holes_of_a_mask_do_not_shine(tmp_path: Path) -> None:
    Image.fromarray(np.uint8([[[255, 255, 255, 255], [255, 255, 255, 0]]])).save(tmp_path / "mask.png")
    material = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "alphaMode": "MASK",
        "emissiveFactor": [1, 0.5, 0],
        "emissiveTexture": {"index": 0},
    }
    document = {"materials": [material], "textures": [{"source": 0}], "images": [{"uri": "mask.png"}]}
    materials = Materials(File(document, tmp_path))
    bsdf = materials.bsdf(0, {})
    shining = materials.arrays[bsdf["emitter"]["radiance"]["array"]]
    opaque = materials.arrays[bsdf["opacity"]["array"]]
    np.testing.assert_array_equal((shining > 0).any(axis=2), opaque[..., 0] > 0)
    assert 0 < opaque.mean() < 1
    assert shining[0, 1] == pytest.approx([1, 0.5, 0])
