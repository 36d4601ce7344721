"""Vertex colors as an image, within one byte, for glTF and PLY; uniform colors give no image."""

from __future__ import annotations

import numpy as np
import pytest
from glb_builder import Glb

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_decode
from relume.raytrace.texture import MipMap
from relume.scene.model import Scene, Texture, TextureEncoding
from relume.scene.textured_vertex_colors import draw_textured_colors
from relume.scene.vertex_colors import WRAP, draw_color_image
from relume.scene_io.gltf import import_gltf
from relume.scene_io.obj_ply import import_obj, import_ply
from relume.scene_io.referenced_files import NoFiles

LIGHT = Environment("grey", np.ones((2, 4, 3), np.float32))


def test_lookups_interpolate_between_vertex_colors() -> None:
    rng = np.random.default_rng(3)
    calm = 0.5 + 0.15 * rng.random((50, 3, 4))
    gaudy = rng.random((50, 3, 4))
    for corners, max_error in ((calm, 0.006), (gaudy, 0.1)):
        image, places, white = draw_color_image(corners.astype(np.float32))
        pyramid = MipMap(Texture(np.ascontiguousarray(image[..., :3]), WRAP, TextureEncoding("srgb")))
        fraction = rng.dirichlet([1, 1, 1], (50, 40))
        uv = np.einsum("nkc,ncd->nkd", fraction, places).reshape(-1, 2).astype(np.float32)
        sampled = pyramid.sample(uv, np.zeros(len(uv), np.float32))
        expected = np.einsum("nkc,ncd->nkd", fraction, corners[..., :3]).reshape(-1, 3)
        assert np.abs(sampled - expected).max() < max_error
        assert np.sqrt(np.mean((sampled - expected) ** 2)) < 0.012
        np.testing.assert_array_equal(pyramid.sample(white[None], np.zeros(1, np.float32)), [[1, 1, 1]])


def quad(colors: np.ndarray, **pbr: object) -> Scene:
    glb = Glb().quad({"name": "Paint", "pbrMetallicRoughness": pbr}, COLOR_0=colors.astype(np.float32))
    return import_gltf(glb.bytes(), "quad", LIGHT)


COLORS = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 0.5]], np.float32)


def test_vertex_colors_give_the_diffuse_image_and_opacity() -> None:
    scene = quad(COLORS, metallicFactor=0)
    (material,), (mesh,) = scene.materials, scene.meshes
    assert scene.warnings == ()
    assert material.terms[0]["texture"] == "diffuse"
    assert mesh.positions.shape == (6, 3)
    shown = MipMap(material.textures["diffuse"]).sample(mesh.uvs, np.zeros(6, np.float32))
    expected = {tuple(position): color for position, color in zip(quad_corners(), COLORS[:, :3], strict=True)}
    for position, color in zip(mesh.positions, shown, strict=True):
        np.testing.assert_allclose(color, expected[tuple(position)], atol=0.005)


def quad_corners() -> np.ndarray:
    glb = Glb().quad({"name": "Plain"})
    return import_gltf(glb.bytes(), "quad", LIGHT).meshes[0].positions


@pytest.mark.parametrize("alpha", [1.0, 0.5])
def test_uniform_vertex_colors_multiply_the_material_color(alpha: float) -> None:
    scene = quad(np.tile([0.25, 0.5, 1.0, alpha], (4, 1)), metallicFactor=0)
    (material,) = scene.materials
    assert not material.textures
    color = np.array(material.terms[0]["color"])
    np.testing.assert_allclose(color / color[2], [0.25, 0.5, 1], atol=1e-4)


def shown_at(scene: Scene, name: str, fraction: np.ndarray) -> np.ndarray:
    """Values of a texture at barycentric coordinates (n, 3) of each triangle. (triangles, n, channels)"""
    (material,), (mesh,) = scene.materials, scene.meshes
    texture = material.normal_map if name == "normal" else material.textures[name]
    assert texture is not None
    uvs = np.einsum("nk,tkc->tnc", fraction, mesh.uvs[mesh.faces]).reshape(-1, 2).astype(np.float32)
    values = MipMap(texture).sample(uvs, np.zeros(len(uvs), np.float32))
    return values.reshape(len(mesh.faces), len(fraction), -1)


def inner_points(num: int) -> np.ndarray:
    """Barycentric coordinates away from the sides, where texels of two triangles are mixed."""
    return 0.1 / 3 + 0.9 * np.random.default_rng(5).dirichlet([1, 1, 1], num)


def textured_quad(repeats: float, colors: np.ndarray = COLORS, **more: object) -> tuple[Scene, np.ndarray]:
    """A quad whose image repeats so often, and its linear image."""
    glb = Glb()
    # smooth, so that texels of blocks, which lie between the image's, show the same
    x, y = np.meshgrid(*[(np.arange(64) + 0.5) / 32 * np.pi] * 2)
    pixels = np.round(160 + 60 * np.stack([np.sin(x), np.cos(y), np.sin(x + y)], axis=-1)).astype(np.uint8)
    bumps = np.full((8, 8, 3), [200, 90, 220], np.uint8)
    material = {
        "name": "Wood",
        "pbrMetallicRoughness": {"baseColorTexture": {"index": glb.texture(pixels)}, "metallicFactor": 0},
        "normalTexture": {"index": glb.texture(bumps)},
        **more,
    }
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32) * np.float32(repeats)
    glb.quad(material, COLOR_0=colors, TEXCOORD_0=uvs)
    return import_gltf(glb.bytes(), "quad", LIGHT), srgb_decode((pixels / 255).astype(np.float32))


@pytest.mark.parametrize("repeats", [1.0, 3.0])
def test_vertex_colors_multiply_textures_at_each_point(repeats: float) -> None:
    scene, image = textured_quad(repeats)
    assert scene.warnings == ()
    fraction = inner_points(200)
    plain = Texture(image.astype(np.float32))
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]]) * repeats
    points = np.einsum("nk,tkc->tnc", fraction, uvs[corners]).reshape(-1, 2).astype(np.float32)
    colors = np.einsum("nk,tkc->tnc", fraction, COLORS[corners][..., :3])
    expected = MipMap(plain).sample(points, np.zeros(len(points), np.float32)).reshape(colors.shape) * colors
    shown = shown_at(scene, "diffuse", fraction)
    np.testing.assert_allclose(shown, expected, atol=0.02)
    assert np.sqrt(np.mean((shown - expected) ** 2)) < 0.006


def test_blocks_keep_normal_maps_and_their_tangents() -> None:
    (once, _), (tiled, _) = textured_quad(1.0), textured_quad(3.0)
    assert tiled.meshes[0].positions.shape == (6, 3)
    fraction = inner_points(20)
    np.testing.assert_allclose(shown_at(tiled, "normal", fraction), shown_at(once, "normal", fraction), atol=1e-6)
    np.testing.assert_allclose(tiled.meshes[0].tangents, np.tile(once.meshes[0].tangents[:1], (6, 1)), atol=1e-6)


@pytest.mark.parametrize("repeats", [1.0, 3.0])
def test_alpha_of_vertex_colors_multiplies_that_of_textures(repeats: float) -> None:
    scene, _ = textured_quad(repeats, alphaMode="BLEND")
    (material,), (mesh,) = scene.materials, scene.meshes
    assert material.opacity is not None
    alpha = Texture(np.repeat(material.opacity.alpha[..., None] / np.float32(255), 3, axis=2), material.opacity.wrap)
    fraction = inner_points(100)
    uvs = np.einsum("nk,tkc->tnc", fraction, mesh.uvs[mesh.faces]).reshape(-1, 2).astype(np.float32)
    expected = np.concatenate([np.ones(100), 1 - 0.5 * fraction[:, 2]])
    np.testing.assert_allclose(MipMap(alpha).sample(uvs, np.zeros(200, np.float32))[:, 0], expected, atol=0.01)


def test_triangles_that_share_texels_have_their_own_colors() -> None:
    glb = Glb()
    material = {"name": "Palette", "pbrMetallicRoughness": {"metallicFactor": 0}}
    material["pbrMetallicRoughness"] |= {"baseColorTexture": {"index": glb.texture([[[255, 188, 255], [9, 9, 9]]])}}
    colors = np.array([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], np.float32)
    glb.quad(material, COLOR_0=colors, TEXCOORD_0=np.full((4, 2), 0.25, np.float32))
    scene = import_gltf(glb.bytes(), "quad", LIGHT)
    half = float(srgb_decode(np.float32(188 / 255)))
    expected = np.array([[[1, 0, 0], [1, 0, 0], [0, half, 0]], [[1, 0, 0], [0, half, 0], [0, half, 0]]])
    np.testing.assert_allclose(shown_at(scene, "diffuse", np.eye(3)), expected, atol=0.01)


def test_textures_that_would_be_too_large_use_the_mean_vertex_color_with_a_warning() -> None:
    scene, _ = textured_quad(5000.0)
    assert len([warning for warning in scene.warnings if "replaced by their average" in warning]) == 1


def test_vertex_colors_of_ply_files_are_used() -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    header += "".join(f"property float {name}\n" for name in ("x", "y", "z"))
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    header += "element face 1\nproperty list uchar uint vertex_index\nend_header\n"
    scene = import_ply((header + "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n").encode(), "x", LIGHT)
    (material,), (mesh,) = scene.materials, scene.meshes
    shown = MipMap(material.textures["diffuse"]).sample(mesh.uvs, np.zeros(3, np.float32))
    np.testing.assert_allclose(shown, np.eye(3), atol=0.005)
    assert scene.warnings == ()


@pytest.mark.parametrize("objects", [1, 2])
def test_vertex_colors_of_obj_files_are_used_for_all_objects(objects: int) -> None:
    lines = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n" + "".join(f"o {k}\nf 1 2 3\n" for k in range(objects))
    scene = import_obj(lines.encode(), "x", LIGHT, NoFiles())
    assert len(scene.meshes) == objects
    for mesh in scene.meshes:
        texture = scene.materials[mesh.material].textures["diffuse"]
        shown = MipMap(texture).sample(mesh.uvs, np.zeros(3, np.float32))
        np.testing.assert_allclose(shown, np.eye(3), atol=0.005)
    assert scene.warnings == ()


def test_thousands_of_triangles_over_a_whole_image_are_refused_at_once() -> None:
    rng = np.random.default_rng(5)
    uvs = np.tile(np.array([[[0, 0], [1, 0], [0, 1]]], np.float32), (20_000, 1, 1))
    colors = rng.random((20_000, 3, 4)).astype(np.float32)
    assert draw_textured_colors(uvs, colors, (2048, 2048), ("repeat", "repeat")) is None


def test_blocks_of_extreme_shapes_are_refused_before_their_image_is_allocated() -> None:
    wide, tall = np.array([[0, 0], [900, 0], [0, 0.05]]), np.array([[0, 0], [0.05, 0], [0, 900]])
    colors = np.random.default_rng(6).random((2, 3, 4)).astype(np.float32)
    assert draw_textured_colors(np.array([wide, tall], np.float32), colors, (64, 64), ("repeat", "repeat")) is None
