"""Groups of lights that are completely visible from points, and the remaining single lights."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import studio

from relume.core.bit_matrix import rows_to_words, words_to_rows
from relume.core.color import luminance
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.shading.group_kernel import select_groups


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 600)


@pytest.mark.parametrize("num_points", [1, 48, 64])
@pytest.mark.parametrize("num_lights", [5, 64, 603])
def test_transposing_bits_twice_restores_them(num_points, num_lights):
    visible = np.random.default_rng(1).random((num_points, num_lights)) < 0.5
    rows = np.packbits(visible, axis=1, bitorder="little")
    words = np.empty(num_lights, np.uint64)
    rows_to_words(rows, words)
    expected = [sum(1 << k for k in np.flatnonzero(of_light).tolist()) for of_light in visible.T]
    assert words.tolist() == expected
    back = np.empty_like(rows)
    words_to_rows(words, back)
    np.testing.assert_array_equal(back, rows)


def test_groups_are_lights_of_one_tree_node(lights):
    groups = lights.clusters
    assert len(np.unique(groups.light_index)) == len(groups.light_index) > 0.8 * lights.num_lights
    for first, end in zip(groups.first[:-1], groups.first[1:], strict=True):
        codes = [int(code) for code in lights.codes[groups.light_index[first:end]]]
        assert 2 <= len(codes) <= 12
        above = [{code >> shift for shift in range(0, code.bit_length() - 3, 2)} for code in codes]
        assert set.intersection(*above)


def test_a_group_has_the_irradiance_of_its_lights(lights):
    """Σ E cos θ in luminance, for normals that face all lights: the mean direction equals that of the light."""
    groups, normals = lights.clusters, np.random.default_rng(2).normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    alone = luminance(lights.irradiance)[groups.light_index] * (normals @ lights.direction[groups.light_index].T)
    expected = np.add.reduceat(alone, groups.first[:-1], axis=1)
    brightness = luminance(groups.lights.irradiance) * (normals @ groups.lights.direction.T)
    np.testing.assert_allclose(brightness, expected, atol=1e-5 * np.abs(expected).max())


def test_completely_visible_groups_are_selected(lights):
    groups, rng = lights.clusters, np.random.default_rng(3)
    visible = rng.random((lights.num_lights, 48)) < 0.8
    words = (visible * (np.uint64(1) << np.arange(48, dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
    whole = np.empty(groups.lights.num_lights, np.uint64)
    select_groups(words, groups.first, groups.light_index, whole)
    for g, (first, end) in enumerate(zip(groups.first[:-1], groups.first[1:], strict=True)):
        parts = groups.light_index[first:end]
        is_whole = visible[parts].all(axis=0)
        assert [bool(int(whole[g]) >> k & 1) for k in range(48)] == is_whole.tolist()
        visible[parts] &= ~is_whole
    assert [[bool(int(word) >> k & 1) for k in range(48)] for word in words] == visible.tolist()
    assert whole.any()
