"""Textures as bytes: same values, downsampled as values, stored unchanged."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from texture_values import get_texture_values
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.errors import SceneError
from relume.raytrace.texture import MipMap
from relume.scene.model import Material, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene.texture_encoding import ROWS_PER_BATCH, decode, encode_rows, mean_value


def random_bytes(height: int = 9, width: int = 7, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)


def test_display_values_are_linear_times_a_scale() -> None:
    decoded = decode(np.array([[[0, 188, 255]]], np.uint8), TextureEncoding("srgb", (1.0, 2.0, 0.5)))
    np.testing.assert_allclose(decoded, [[[0, 2 * 0.5029, 0.5]]], atol=1e-4)


def test_normals_are_scaled_rotated_and_normalized() -> None:
    pixels = np.array([[[255, 127, 255], [128, 128, 255], [127, 128, 127]]], np.uint8)
    x, up, none = decode(pixels, TextureEncoding("normal", (0.5, 0.5, 1.0)))[0]
    np.testing.assert_allclose(x, np.array([0.5, 0, 1]) / np.hypot(0.5, 1), atol=5e-3)
    np.testing.assert_allclose(up, [0, 0, 1], atol=5e-3)
    assert np.linalg.norm(none) == pytest.approx(1)
    rotated = decode(pixels, TextureEncoding("normal", (0.5, 0.5, 1.0), np.pi / 2))[0, 0]
    np.testing.assert_allclose(rotated[:2], [x[1], -x[0]], atol=1e-6)


def test_pixels_without_an_encoding_are_values() -> None:
    pixels = np.random.default_rng(2).random((3, 4, 3), np.float32)
    np.testing.assert_array_equal(decode(pixels, None), pixels)


def test_means_and_derived_textures_cover_all_rows() -> None:
    height = 2 * ROWS_PER_BATCH + 3
    values = np.random.default_rng(3).random((height, 5, 3), np.float32) * np.float32([1, 4, 0.25])
    max_values = values.max(axis=(0, 1)).astype(np.float64)
    made = encode_rows(lambda rows: values[rows], (height, 5), max_values, ("clamp", "repeat"))
    assert made.pixels.dtype == np.uint8
    assert made.wrap == ("clamp", "repeat")
    display = np.round(255 * (get_texture_values(made) / max_values) ** (1 / 2.2))
    np.testing.assert_allclose(display, 255 * (values / max_values) ** (1 / 2.2), atol=4)
    np.testing.assert_allclose(mean_value(made), values.mean(axis=(0, 1)), rtol=2e-3)


@pytest.mark.parametrize("size", [(9, 7), (ROWS_PER_BATCH + 3, 6), (1, 8), (1, 1)])
def test_mip_maps_of_bytes_equal_those_of_their_values(size: tuple[int, int]) -> None:
    coded = Texture(random_bytes(*size), encoding=TextureEncoding("srgb", (1.0, 0.5, 2.0)))
    plain = Texture(get_texture_values(coded))
    of_bytes, of_values = MipMap(coded), MipMap(plain)
    assert [level.shape for level in of_bytes.levels] == [level.shape for level in of_values.levels]
    uv = np.random.default_rng(4).uniform(-2, 2, (500, 2)).astype(np.float32)
    for footprint in (0.0, 0.1, 0.4, 3.0):
        actual, expected = (
            pyramid.sample(uv, np.full(500, footprint, np.float32)) for pyramid in (of_bytes, of_values)
        )
        np.testing.assert_allclose(actual, expected, rtol=1e-3, atol=1e-4)


def scene_with(texture: Texture) -> Scene:
    material = Material("M", ({"model": "lambert", "color": [1, 1, 1], "texture": "diffuse"},), {"diffuse": texture})
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    return make_tiny_scene(floor, camera=make_camera("front", (0, 2, 2), (0, 0, 0), 0.8), materials=[material])


def test_bytes_and_encodings_are_stored(tmp_path: Path) -> None:
    coded = Texture(random_bytes(), ("mirror", "clamp"), TextureEncoding("srgb", (0.5, 1.0, 2.0)))
    scene = scene_with(coded)
    save_scene(scene, tmp_path)
    loaded = load_scene(tmp_path).materials[0].textures["diffuse"]
    np.testing.assert_array_equal(loaded.pixels, coded.pixels)
    assert (loaded.wrap, loaded.encoding) == (coded.wrap, coded.encoding)
    other = scene_with(dataclasses.replace(coded, encoding=TextureEncoding("srgb")))
    assert other.id != scene.id


@pytest.mark.parametrize(
    "texture", [Texture(random_bytes()), Texture(np.ones((2, 2, 3), np.float32), encoding=TextureEncoding("srgb"))]
)
def test_pixels_that_do_not_fit_their_encoding_are_rejected(tmp_path: Path, texture: Texture) -> None:
    save_scene(scene_with(texture), tmp_path)
    with pytest.raises(SceneError, match="a texture of the scene"):
        load_scene(tmp_path)
