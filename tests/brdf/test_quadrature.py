"""Terms at fixed pairs of directions, against the whole BRDF in plain NumPy."""

import numpy as np
import pytest
from analytic_terms import ANALYTIC

from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import is_isotropic

RNG = np.random.default_rng(4)


def directions(*shape):
    vectors = RNG.normal(size=(*shape, 3))
    vectors[..., 2] = np.abs(vectors[..., 2])
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


WI, WO = directions(7, 300), directions(7, 1)
PAIRS = Quadrature(WI, WO)


def document(model, **fields):
    return {"model": model, "color": [1.0, 1.0, 1.0], "params": {}, "texture": None} | fields


def check(term, tolerance=1e-5):
    expected = np.moveaxis(eval_brdf(term, WI, WO), -1, 0)
    values = PAIRS.values(term)
    assert values.shape[1:] == WI.shape[:-1]
    assert len(values) in (1, 3)
    np.testing.assert_allclose(np.broadcast_to(values, expected.shape), expected, atol=tolerance * expected.max())


@pytest.mark.parametrize("model", ANALYTIC)
def test_values_equal_the_whole_brdf(model):
    check(document(model))


def test_each_edit_is_evaluated_regardless_of_earlier_calls():
    for exponent in (4.0, 30.0, 4.0, [3.0, 8.0, 20.0]):
        check(document("blinn_phong", params={"exponent": exponent}))
    check(document("ggx", params={"roughness": 0.2, "f0": [0.1, 0.5, 0.9]}))
    check(document("oren_nayar", params={"roughness": 0.2}))
    check(document("oren_nayar", params={"roughness": 0.9}))
    drawn = {"theta_h": {"points": [[0, 1.0], [20, 0.5], [60, 0.0]], "channels": "rg"}}
    check(document("blinn_phong", curves=drawn))


def test_equal_channels_are_evaluated_once():
    assert len(PAIRS.values(document("blinn_phong"))) == 1
    assert len(PAIRS.values(document("blinn_phong", params={"exponent": [3.0, 8.0, 20.0]}))) == 3


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (document("ggx"), True),
        (document("lafortune"), True),
        (document("ward_anisotropic", params={"alpha_x": 0.2, "alpha_y": 0.5}), False),
        (document("ward_anisotropic", params={"alpha_x": 0.3, "alpha_y": 0.3}), True),
    ],
)
def test_isotropic_terms_are_recognized(term, expected):
    rotated = [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]
    same = np.allclose(eval_brdf(term, WI, WO), eval_brdf(term, WI @ rotated, WO @ rotated), rtol=1e-5)
    assert same == expected
    assert is_isotropic(term) == expected
