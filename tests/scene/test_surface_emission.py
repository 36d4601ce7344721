"""Emission images: means over surfaces, triangle by triangle."""

from __future__ import annotations

import numpy as np
import pytest
from texture_values import get_texture_values
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.scene.emission import average_over_faces, has_emission_images, normalize_emission, relative_emission
from relume.scene.model import Material, Texture, TextureEncoding

FLOOR = quad("floor", [[0, 0, 1], [2, 0, 1], [2, 0, 0], [0, 0, 0]], 0)


def image(pixels):
    return Texture(np.array(pixels, np.uint8), encoding=TextureEncoding("srgb"))


def test_the_image_is_normalized_by_the_mean_over_surfaces() -> None:
    red_left = image([[[255, 0, 0], [0, 0, 0]]])
    material, emission = normalize_emission(Material("m", (), {"emission": red_left}), np.array([4.0, 4, 4]), [FLOOR])
    assert emission.tolist() == [2.0, 0, 0]
    np.testing.assert_allclose(get_texture_values(material.textures["emission"])[0, 0, 0], 2)


@pytest.mark.parametrize("pixels", [[[[255, 128, 0]]], [[[200, 200, 200], [201, 200, 199]]]])
def test_an_image_of_one_color_is_dropped(pixels) -> None:
    material, emission = normalize_emission(
        Material("m", (), {"emission": image(pixels)}), np.array([2.0, 2, 2]), [FLOOR]
    )
    assert not material.textures
    assert emission[0] > 1


def test_triangles_emit_the_mean_of_their_part_of_the_image() -> None:
    below = image([[[0, 0, 0]] * 4] * 2 + [[[255, 255, 255]] * 4] * 2)
    fractions = average_over_faces(
        below, FLOOR
    )  # three quarters of the first triangle lie below, one quarter of the other
    np.testing.assert_allclose(fractions, [[0.75] * 3, [0.25] * 3], atol=0.13)
    assert fractions.mean() == pytest.approx(0.5)


def test_faces_are_in_scene_order_and_others_emit_uniformly() -> None:
    wall = quad("wall", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], 1)
    lit = Material(
        "lit", (), {"emission": Texture(np.full((1, 2, 3), 128, np.uint8), encoding=TextureEncoding("srgb"))}
    )
    plain = Material("plain", ())
    scene = make_tiny_scene(wall, FLOOR, camera=make_camera("v", (0, 1, 2), (0, 0, 0), 0.7), materials=[lit, plain])
    assert has_emission_images(scene)
    fractions = relative_emission(scene)
    assert fractions.tolist()[:2] == [1, 1]
    assert fractions[2] == pytest.approx(0.2158, abs=1e-3)
