"""SVD of BRDFs against closed forms: harmonics on the sphere, the whole matrix, white light on a ball."""

import numpy as np
import pytest

from relume_bench import factorization, factorization_measured, factorization_pictures
from relume_bench.brdf_svd import (
    SPHERE,
    angles_between,
    count_terms,
    factorize,
    frequency_content,
    gauss_zenith,
    half_angle_gaussian,
    phong,
    singular_values,
    zonal_coefficients,
)

SIZE = 24


@pytest.mark.parametrize("exponent", [4.0, 8.0])
def test_factors_on_the_sphere_are_harmonics_with_their_multiplicity(exponent):
    zenith = gauss_zenith(SIZE, SPHERE)
    factors = factorize(phong(exponent), zenith)
    expected = zonal_coefficients(lambda x: (exponent + 1) / (2 * np.pi) * x**exponent, 8, 0.0)
    values = singular_values(factors)
    for degree, eigenvalue in enumerate(expected[:6]):
        assert np.sum(np.abs(values - eigenvalue) < 1e-3 * eigenvalue) == 2 * degree + 1
    for each in factors[:4]:
        for k in range(3):
            harmonic = factorization.harmonic(each.m + k, each.m, zenith.cosine)
            assert abs(np.sum(zenith.weight * each.incident[:, k] * harmonic)) == pytest.approx(1, abs=1e-3)
            sign = np.sign(np.sum(zenith.weight * each.incident[:, k] * each.outgoing[:, k]))
            assert sign == (-1) ** each.m  # h_k = (−1)^m Y_lm


def test_factors_by_frequency_are_those_of_the_whole_matrix():
    size, brdf = 8, half_angle_gaussian(0.6)
    zenith = gauss_zenith(size)
    azimuth = np.pi * np.arange(2 * size) / size
    wi = zenith.cosine[:, None, None, None]
    wo = zenith.cosine[None, None, :, None]
    difference = azimuth[None, :, None, None] - azimuth[None, None, None, :] + np.pi / (2 * size)  # midpoints
    matrix = np.broadcast_to(brdf(angles_between(wi, wo, difference)), (size, 2 * size, size, 2 * size))
    root = np.sqrt(zenith.weight * np.pi / size)
    weighted = matrix * root[:, None, None, None] * root[None, None, :, None]
    whole = np.linalg.svd(weighted.reshape(2 * size * size, -1), compute_uv=False)
    np.testing.assert_allclose(singular_values(factorize(brdf, zenith, size))[:20], whole[:20], rtol=1e-2)


def test_the_number_of_terms_follows_the_laws():
    terms = [count_terms(singular_values(factorize(phong(s), gauss_zenith(32)))) for s in (5.0, 10.0)]
    assert terms[1] / 10 == pytest.approx(2.7, abs=0.3)
    assert terms[1] == pytest.approx(2 * terms[0], rel=0.2)
    assert factorization.count_on_paper_grid(half_angle_gaussian(0.2)) == 64


@pytest.mark.parametrize("sigma", [0.1, 0.2])
def test_the_frequency_content_of_a_gaussian_is_three_over_its_width(sigma):
    coefficients = zonal_coefficients(lambda x: np.exp(-((np.arccos(x) / sigma) ** 2)), 120, 0.0)
    expected = np.sqrt(2 * np.log(100)) / sigma
    assert frequency_content(coefficients) == pytest.approx(expected, rel=0.05)
    assert factorization_measured.content(half_angle_gaussian(sigma)) == pytest.approx(expected, rel=0.15)


def test_pictures_converge_to_the_exact_one_and_keep_white_light():
    exact, _, zernike = factorization_pictures.pictures(np.ones((8, 16, 3), np.float32), 24, 6)
    _, cosine = factorization_pictures.ball_normals(6)
    zenith, azimuth = gauss_zenith(100), 2 * np.pi * (np.arange(200) + 0.5) / 200
    for value, cos_o in zip(exact, cosine, strict=True):
        brdf = phong(30.0)(angles_between(zenith.cosine[:, None], np.array(cos_o), azimuth))
        albedo = 2 * np.pi / 200 * ((zenith.weight * zenith.cosine)[:, None] * brdf).sum()
        np.testing.assert_allclose(value, albedo, rtol=1e-3)
    np.testing.assert_allclose(zernike[0], exact, rtol=1e-6)  # one constant function is enough for white light
    radiance = np.random.default_rng(5).random((8, 16, 3), np.float32) ** 4
    exact, svd, zernike = factorization_pictures.pictures(radiance, 24, 6)
    for images in (svd, zernike):
        errors = [np.linalg.norm(image - exact) for image in images]
        assert errors[-1] < 0.05 * np.linalg.norm(exact)
        assert errors[-1] < 0.2 * errors[0]
    zenith = gauss_zenith(24)
    for count, bases in factorization_pictures._zernike_bases(zenith).items():
        assert sum(basis.shape[1] * (1 if m == 0 else 2) for m, basis in enumerate(bases)) == count
        for basis in bases:
            gram = basis.T * (zenith.weight * zenith.cosine) @ basis
            np.testing.assert_allclose(gram, np.eye(basis.shape[1]), atol=1e-9)
