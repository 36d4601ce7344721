"""What goes to a shader: how many functions a table needs, light vectors in half precision, textures that fit."""

import numpy as np
import pytest

from relume.basis.zernike import DEGREE, NUM_FUNCTIONS, QUICK_DEGREE, ladder, num_functions
from relume.moving.arriving import Arriving
from relume.moving.evaluate import tables_of
from relume.moving.points.surface import Textures
from relume.moving.shader import geometry, tables

SEED = 11
LAMBERT = {"model": "lambert", "color": [0.5, 0.4, 0.3], "params": {}, "curves": {}, "texture": None}
GLOSSY = {**LAMBERT, "model": "blinn_phong", "params": {"exponent": 20.0}}


def degrees_of(term: dict[str, object]) -> int:
    even = tables_of([[term]]).even
    of_function = np.repeat(np.arange(DEGREE + 1), np.arange(DEGREE + 1) + 1)
    (degree,) = tables._degrees(even, of_function[ladder().cosine])
    return int(degree)


def test_a_diffuse_table_needs_one_function_and_a_shiny_one_all() -> None:
    assert degrees_of(LAMBERT) == 0
    assert degrees_of(GLOSSY) == DEGREE


def test_a_degree_below_the_bound_is_left_out() -> None:
    of_function = np.repeat(np.arange(DEGREE + 1), np.arange(DEGREE + 1) + 1)
    table = np.zeros((2, 4, 3, NUM_FUNCTIONS), np.float32)
    table[:, ..., 0] = 1
    table[0, ..., NUM_FUNCTIONS - 1] = 0.5e-3
    table[1, ..., NUM_FUNCTIONS - 1] = 2e-3
    assert tables._degrees(table, of_function).tolist() == [0, DEGREE]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e9])
def test_light_vectors_survive_half_precision_whatever_their_size(size: float) -> None:
    vectors = np.random.default_rng(SEED).normal(0, size, (50, 3, NUM_FUNCTIONS)).astype(np.float32)
    sent = tables._light(Arriving(vectors, -vectors), has_narrow=True, is_rough=False)
    for name, truth in (("vectors", vectors), ("others", -vectors)):
        scale, texels = sent[f"{name}_scale"][0]
        assert texels == NUM_FUNCTIONS / 4
        found = sent[name].astype(np.float64).reshape(vectors.shape) * float(scale)
        assert np.abs(found - truth).max() <= 1e-3 * np.abs(truth).max()
    assert "others" not in tables._light(Arriving(vectors, vectors), has_narrow=False, is_rough=False)


def test_what_was_found_quickly_is_sent_up_to_its_degree() -> None:
    vectors = np.zeros((5, 3, NUM_FUNCTIONS), np.float32)
    num = num_functions(QUICK_DEGREE)
    vectors[:, :, :num] = 1
    sent = tables._light(Arriving(vectors, vectors), has_narrow=False, is_rough=True)
    assert sent["vectors"].reshape(5, 3, -1).shape == (5, 3, 16)  # as much as holds all of them
    assert (sent["vectors"].reshape(5, 3, -1) > 0).sum() == 5 * 3 * num
    assert sent["vectors_scale"][0, 1] == 4


def test_the_finest_level_of_the_largest_texture_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    sides = [(8, 4, 2, 1), (4, 2, 1)]
    levels, first, end = [], [0], 0
    for texture in sides:
        for side in texture:
            levels.append((end, side, side))
            end += side * side
        first.append(len(levels))
    texels = np.zeros((end, 3), np.float32)
    textures = Textures(
        texels, np.array(levels), np.array(first), np.zeros((2, 2), np.int64), np.zeros((1, 3), np.int64)
    )
    kept, begins = geometry._kept_levels(textures)
    assert kept.tolist() == [0, 1, 2, 3, 4, 5, 6]
    monkeypatch.setattr(geometry, "MOST_TEXELS", 50)
    kept, begins = geometry._kept_levels(textures)
    assert (kept.tolist(), begins.tolist()) == ([1, 2, 3, 4, 5, 6], [0, 3, 6])
