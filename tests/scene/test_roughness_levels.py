"""Roughness levels: few, within the range of the map, and in proportion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.roughness_levels import MAX_LEVELS, levels_of_material, select_level


def material_of(pixels: object, max_value: float = 1.0) -> Material:
    texture = Texture(
        np.array(pixels, np.uint8)[..., None], encoding=TextureEncoding("share", (max_value, max_value, max_value))
    )
    return Material("rough", (), {"roughness": texture})


@pytest.mark.parametrize("pixels", [[[0]], [[200]], [[0, 0], [0, 0]], [[200, 201], [201, 200]], [[255] * 4] * 2])
def test_constant_maps_have_no_levels(pixels: list[list[int]]) -> None:
    assert levels_of_material(material_of(pixels)).pairs == ()


def test_a_material_without_a_map_has_no_levels() -> None:
    assert levels_of_material(Material("plain", ())).pairs == ()


def test_levels_lie_within_the_range_of_the_map() -> None:
    ratios, _ = levels_of_material(material_of(np.arange(256).reshape(16, 16), max_value=2.0))
    assert len(ratios) == MAX_LEVELS
    assert np.all(np.diff(ratios) > 0)
    assert ratios[0] < 0.01
    assert ratios[-1] == pytest.approx(2.0, rel=0.01)


def test_a_few_outlier_texels_get_no_level() -> None:
    pixels = np.full((100, 100), 100)
    pixels[:50] = 120
    pixels[0, :5] = 255
    ratios, _ = levels_of_material(material_of(pixels))
    assert pytest.approx(ratios[0], rel=0.01) == 100 / 255
    assert pytest.approx(ratios[-1], rel=0.01) == 120 / 255


@given(st.floats(0, 3, width=32), st.floats(0.001, 0.999))
def test_the_level_is_one_of_the_two_nearest(ratio: float, threshold: float) -> None:
    ratios = 0.25, 0.5, 1.0, 2.0
    level = int(select_level(ratios, np.array([ratio], np.float32), threshold)[0])
    assert 0 <= level < len(ratios)
    lower, upper = ratios[max(level - 1, 0)], ratios[min(level + 1, 3)]
    assert lower <= np.clip(ratio, 0.25, 2.0) <= upper


def test_levels_are_dithered_in_proportion() -> None:
    threshold = ((np.arange(1000) + 0.5) / 1000).astype(np.float32)
    level = select_level((0.25, 1.0), np.full(1000, 0.36, np.float32), threshold)  # roots 0.5, 0.6, 1
    assert level.mean() == pytest.approx(0.2, abs=2e-3)
