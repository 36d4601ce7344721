"""Daubechies-4 on bands: PyWavelets' definition, orthonormality, and what keeping few coefficients costs."""

from __future__ import annotations

import itertools

import identity_basis
import numpy as np
import pytest
import pywt

from relume.brdf.curves import generated_bands
from relume.brdf.registry import TERMS
from relume.core.errors import ShapeMismatchError
from relume.math import daubechies

SIZES = [4, 8, 64, 256]
BASES = [daubechies, identity_basis]


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize("num_bands", SIZES)
def test_order_of_coefficients_is_that_of_wavedec(num_bands, rng):
    x = rng.normal(size=(3, num_bands))
    level = pywt.dwt_max_level(num_bands, pywt.Wavelet("db2").dec_len)
    expected = np.concatenate(pywt.wavedec(x, "db2", mode="periodization", level=level, axis=-1), axis=-1)
    np.testing.assert_allclose(daubechies.analysis(x), expected, atol=1e-14)


@pytest.mark.parametrize("basis", BASES, ids=["daubechies", "identity"])
@pytest.mark.parametrize("num_bands", SIZES)
def test_basis_is_orthonormal_and_reconstructs(basis, num_bands, rng):
    x = rng.normal(size=(2, 5, num_bands))
    coefficients = basis.analysis(x)
    np.testing.assert_allclose(basis.synthesis(coefficients), x, atol=1e-13)
    np.testing.assert_allclose(np.sum(coefficients**2, -1), np.sum(x**2, -1), rtol=1e-12)  # Parseval
    m = basis.matrix(num_bands)
    assert m.dtype == np.float32
    np.testing.assert_allclose(m @ m.T, np.eye(num_bands), atol=1e-6)
    np.testing.assert_allclose(x @ m.T, coefficients, atol=3e-6)


@pytest.mark.parametrize("basis", BASES, ids=["daubechies", "identity"])
@pytest.mark.parametrize("num_bands", SIZES)
def test_forward_in_place_equals_analysis_of_each_row(basis, num_bands, rng):
    block = rng.normal(size=(7, num_bands)).astype(np.float32)
    expected = basis.analysis(block.astype(np.float64))
    basis.forward(block)
    np.testing.assert_allclose(block, expected, atol=3e-6)


def test_transport_and_curve_may_both_be_transformed(rng):
    transport, curve = rng.uniform(size=(100, 256)), rng.uniform(size=256)
    block = transport.astype(np.float32)
    daubechies.forward(block)
    np.testing.assert_allclose(block @ daubechies.analysis(curve), transport @ curve, rtol=1e-5)


@pytest.mark.parametrize(
    ("model", "params"),
    [("cook_torrance", {"sigma": 0.2}), ("blinn_phong", {"exponent": 100}), ("ggx", {"roughness": 0.5})],
)
def test_error_falls_with_kept_coefficients_and_is_small_at_thirty(model, params):
    curve = generated_bands({"model": model, "params": params}, TERMS[model].curve("theta_h"))[0]
    coefficients = daubechies.analysis(curve)
    order = np.argsort(-np.abs(coefficients))
    errors = []
    for kept in (1, 3, 10, 30, 100, 256):
        some = np.zeros_like(coefficients)
        some[order[:kept]] = coefficients[order[:kept]]
        errors.append(np.linalg.norm(daubechies.synthesis(some) - curve) / np.linalg.norm(curve))
    assert all(b < a for a, b in itertools.pairwise(errors))
    assert errors[3] < 5e-3  # 30 of 256, the budget of an incremental frame; the periodic seam at the peak costs most
    assert errors[-1] < 1e-14


@pytest.mark.parametrize("num_bands", [0, 1, 2, 3, 6, 100])
def test_bands_that_cannot_be_halved_are_refused(num_bands):
    for transform in (daubechies.analysis, daubechies.synthesis):
        with pytest.raises(ShapeMismatchError, match="power of two"):
            transform(np.zeros(num_bands))
