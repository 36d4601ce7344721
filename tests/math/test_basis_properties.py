"""Properties of every basis: synthesis inverts analysis, energy is kept, and errors are bounded by what is left out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from bit_packer import pack
from for_all import for_all
from hemisphere_quadrature import hemisphere
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from relume.assets.btf.bit_packing import max_code, packed_bytes, unpack
from relume.math import daubechies
from relume.math.haar import haar, padded_length
from relume.math.pca import decompose
from relume.math.spherical_harmonics import NUM_HARMONICS, harmonics
from relume.math.zernike import NUM_FUNCTIONS, basis_functions, num_functions

NUMBERS = st.floats(-100.0, 100.0, allow_subnormal=False)
SIZES = st.sampled_from([4, 8, 64, 256])
ROWS = SIZES.flatmap(lambda size: arrays(np.float64, (2, size), elements=NUMBERS))
WI, COSINE_WEIGHTS = hemisphere()
ZERNIKE = basis_functions(WI)


@for_all(40, bands=ROWS)
def test_wavelets_reconstruct_bands_and_keep_their_energy(bands):
    coefficients = daubechies.analysis(bands)
    np.testing.assert_allclose(daubechies.synthesis(coefficients), bands, atol=1e-11)
    np.testing.assert_allclose((coefficients**2).sum(axis=1), (bands**2).sum(axis=1), rtol=1e-11, atol=1e-20)
    np.testing.assert_allclose(daubechies.analysis(daubechies.synthesis(bands)), bands, atol=1e-11)


@for_all(40, bands=ROWS, fraction=st.floats(0.0, 1.0))
def test_the_error_of_few_wavelets_is_the_energy_of_the_others(bands, fraction):
    coefficients = daubechies.analysis(bands)
    num_retained = round(fraction * bands.shape[1])
    left_out = np.argsort(-np.abs(coefficients), axis=1)[:, num_retained:]
    some = coefficients.copy()
    np.put_along_axis(some, left_out, 0.0, axis=1)
    error = np.linalg.norm(daubechies.synthesis(some) - bands, axis=1)
    np.testing.assert_allclose(error, np.linalg.norm(coefficients - some, axis=1), rtol=1e-9, atol=1e-10)
    # the largest have at least the mean energy
    assert (error <= np.linalg.norm(bands, axis=1) * np.sqrt(1 - num_retained / bands.shape[1]) + 1e-10).all()


@for_all(40, bands=ROWS)
def test_the_kernel_of_transport_vectors_equals_the_analysis(bands):
    rows = bands.astype(np.float32)
    daubechies.forward(rows)
    np.testing.assert_allclose(rows, daubechies.analysis(bands), atol=3e-6 * max(np.abs(bands).max(), 1e-30) * 16)


@for_all(40, values=st.integers(1, 70).flatmap(lambda n: arrays(np.float64, (n, 2), elements=NUMBERS)), scale=NUMBERS)
def test_haar_is_linear_and_keeps_energy(values, scale):
    coefficients = haar(values)
    assert len(coefficients) == padded_length(len(values))
    np.testing.assert_allclose((coefficients**2).sum(axis=0), (values**2).sum(axis=0), rtol=1e-11, atol=1e-20)
    np.testing.assert_allclose(haar(scale * values), scale * coefficients, rtol=1e-11, atol=1e-9)
    mean = values.sum(axis=0) / np.sqrt(len(coefficients))
    np.testing.assert_allclose(coefficients[0], mean, rtol=1e-11, atol=1e-9)


@for_all(40, coefficients=arrays(np.float64, NUM_FUNCTIONS, elements=NUMBERS))
def test_functions_of_the_hemispherical_basis_are_projected_onto_themselves(coefficients):
    light = ZERNIKE @ coefficients
    projected = np.einsum("n,nk,n->k", light, ZERNIKE, COSINE_WEIGHTS)
    np.testing.assert_allclose(projected, coefficients, atol=1e-5 * np.abs(coefficients).max() + 1e-9)


@for_all(40, axis=arrays(np.float64, 3, elements=st.floats(-1, 1)), sharpness=st.floats(0.0, 50.0))
def test_light_in_the_hemispherical_basis_has_no_more_energy_and_a_better_fit_by_degree(axis, sharpness):
    """Bessel's inequality, for a smooth lobe about any direction."""
    axis = axis / max(np.linalg.norm(axis), 1e-3)
    light = np.exp(sharpness * (WI @ axis - 1))
    projected = np.einsum("n,nk,n->k", light, ZERNIKE, COSINE_WEIGHTS)
    energy = light**2 @ COSINE_WEIGHTS
    assert (projected**2).sum() <= energy * (1 + 1e-6)
    errors = [
        (light - ZERNIKE[:, :num] @ projected[:num]) ** 2 @ COSINE_WEIGHTS for num in map(num_functions, range(8))
    ]
    assert all(b <= a + 1e-6 * energy for a, b in itertools.pairwise(errors))
    np.testing.assert_allclose(errors[-1], energy - (projected**2).sum(), atol=1e-5 * energy)


@for_all(40, coefficients=arrays(np.float64, NUM_HARMONICS, elements=NUMBERS))
def test_spherical_harmonics_are_projected_onto_themselves(coefficients):
    cosines, weights = np.polynomial.legendre.leggauss(12)
    phi = np.arange(24) * (2 * np.pi / 24)
    z, azimuth = (axis.ravel() for axis in np.meshgrid(cosines, phi, indexing="ij"))
    s = np.sqrt(1 - z * z)
    basis = harmonics(np.stack([s * np.cos(azimuth), s * np.sin(azimuth), z], axis=-1))
    solid_angle = np.repeat(weights, 24) * (2 * np.pi / 24)
    projected = np.einsum("n,nk,n->k", basis @ coefficients, basis, solid_angle)
    np.testing.assert_allclose(projected, coefficients, atol=1e-11 * np.abs(coefficients).max() + 1e-12)


@for_all(40, curves=arrays(np.float64, (6, 16), elements=NUMBERS))
def test_principal_components_reconstruct_their_curves_better_with_each_vector(curves):
    components = decompose(curves)
    scale = max(np.abs(curves).max(), 1e-30)
    np.testing.assert_allclose(components.synthesis(components.analysis(curves)), curves, atol=1e-11 * scale)
    errors = []
    for num in range(len(components.vectors) + 1):
        few = components.first(num)
        coefficients = few.analysis(curves)
        approximation = few.synthesis(coefficients)
        np.testing.assert_allclose(few.analysis(approximation), coefficients, atol=1e-11 * scale)  # a projection
        errors.append(np.linalg.norm(approximation - curves))
    assert all(b <= a + 1e-10 * scale for a, b in itertools.pairwise(errors))


@for_all(40, bits=st.lists(st.integers(1, 8), min_size=1, max_size=9), num=st.integers(1, 20), data=st.data())
def test_packed_rows_are_unpacked_unchanged(bits, num, data):
    widths = np.array(bits, np.uint8)
    largest = max_code(widths)
    rows = (
        np.array(
            [[data.draw(st.integers(-int(code), int(code) + 1)) for code in largest] for _ in range(num)], np.int64
        )
        .clip(-128, 127)
        .astype(np.int8)
    )
    packed = pack(rows, widths)
    assert len(packed) == packed_bytes(num, widths)
    np.testing.assert_array_equal(unpack(packed, widths, num), rows)


@pytest.mark.parametrize("num_bands", [4, 256])
def test_the_matrix_of_the_wavelets_is_their_analysis(num_bands):
    np.testing.assert_allclose(daubechies.matrix(num_bands), daubechies.analysis(np.eye(num_bands)).T, atol=1e-6)
