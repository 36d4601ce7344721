"""Outgoing BRDF coefficients of each basis function, for every term of the library."""

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from hemisphere_quadrature import hemisphere
from probe_shading import rotate_coefficients

from relume.brdf.evaluate import eval_brdf
from relume.live.free_camera.basis import highlight_lobes as lobes_module
from relume.live.free_camera.basis.highlight_lobes import build_lobes, is_narrow
from relume.live.free_camera.basis.material_tables import build_tables
from relume.live.free_camera.basis.outgoing_coefficients import (
    F64,
    NUM_ROWS,
    cosines,
    outgoing_coefficients,
    white_coefficients,
)
from relume.live.free_camera.basis.two_lobes import _INITIAL_OFFSET, _NUM_ITERATIONS, fit_two_lobes
from relume.math.zernike import NUM_FUNCTIONS, basis_functions


def fit_two_lobes_numpy(x: F64, z: F64, area: F64, brdf_cosine: F64) -> F64:
    """Reference of `fit_two_lobes` for one row in plain NumPy.

    Args:
        x, z, area, brdf_cosine: as there. (n,)
    Returns:
        (5,)
    """
    weight, squared_weight = brdf_cosine * area / (brdf_cosine @ area), brdf_cosine**2 * area / (brdf_cosine**2 @ area)
    center = np.array([squared_weight @ x, squared_weight @ z])
    variance = 2 - 2 * np.linalg.norm(center)
    angle, difference = np.arctan2(*center), _INITIAL_OFFSET * np.sqrt(variance)
    towards = np.array([[np.sin(angle + side), np.cos(angle + side)] for side in (difference, -difference)])
    first, width = 0.5, variance / np.array([1.5, 0.75])
    for _ in range(_NUM_ITERATIONS):
        log_density = np.log(np.array([[first], [1 - first]]) / width[:, None] / (1 - np.exp(-2 / width[:, None])))
        log_density = log_density - (1 - towards @ np.array([x, z])) / width[:, None]
        responsibility = weight / (1 + np.exp(np.minimum(log_density[1] - log_density[0], 700)))
        mean = np.array(
            [[responsibility @ x, responsibility @ z], [(weight - responsibility) @ x, (weight - responsibility) @ z]]
        )
        first = float(responsibility.sum())
        length = np.linalg.norm(mean, axis=1)
        towards, r = mean / length[:, None], length / [first, 1 - first]
        width = (1 - r**2) / (r * (3 - r**2))
    cosines = np.where(towards[:, 0] > 0, np.clip(towards[:, 1], 0, 1), 1)
    return np.array([*cosines, first, *np.sqrt(width)])


def document(model, **fields):
    return {"model": model, "color": [1.0, 1.0, 1.0], "params": {}, "texture": None} | fields


def test_a_diffuse_surface_has_one_coefficient():
    coefficients = outgoing_coefficients(document("lambert", color=[0.2, 0.4, 0.8]))
    assert coefficients.table.shape == (NUM_ROWS, 1, 3, NUM_FUNCTIONS)
    np.testing.assert_allclose(
        coefficients.table[:, 0, :, 0], np.tile(np.array([0.2, 0.4, 0.8]) / np.sqrt(np.pi), (32, 1)), rtol=1e-5
    )
    assert np.abs(coefficients.table[..., 1:]).max() < 1e-6
    assert coefficients.residual_energy < 1e-3


@pytest.mark.parametrize("azimuth", [5, 13, 22, 30])  # one azimuth in each quadrant, of which only one is integrated
@pytest.mark.parametrize("model", ANALYTIC)
def test_coefficients_are_the_integrals_of_the_term(model, azimuth):
    """With a finer quadrature than the one under test; highlights that the latter cannot resolve are blurred by the
    same functions.
    """
    term = document(model)
    coefficients = outgoing_coefficients(term)
    wi, weight = hemisphere(96, 192)
    row = 18
    cosine = cosines()[row]
    column = azimuth if coefficients.table.shape[1] > 1 else 0
    phi = 2 * np.pi * column / coefficients.table.shape[1]
    sine = np.sqrt(1 - cosine**2)
    wo = np.array([sine * np.cos(phi), sine * np.sin(phi), cosine])
    value = eval_brdf(term, wi, wo)
    expected = np.einsum("nc,n,nk->ck", value, weight, basis_functions(wi))
    scale = np.sqrt((value**2 * weight[:, None]).sum(axis=0).max())
    assert np.abs(coefficients.table[row, column] - expected).max() < 0.05 * scale


def test_coefficients_rotate_with_the_view_direction():
    term, wi_weights = document("blinn_phong", params={"exponent": 20.0}), hemisphere(48, 96)
    coefficients, (wi, weight) = outgoing_coefficients(term), wi_weights
    row, phi = 14, 1.1
    cosine = cosines()[row]
    sine = np.sqrt(1 - cosine**2)
    wo = np.array([sine * np.cos(phi), sine * np.sin(phi), cosine])
    expected = np.einsum("nc,n,nk->ck", eval_brdf(term, wi, wo), weight, basis_functions(wi))
    np.testing.assert_allclose(
        rotate_coefficients(coefficients.table[row, 0], phi), expected, atol=2e-3 * np.abs(expected).max()
    )


def test_the_residual_grows_with_the_exponent():
    missed = [
        outgoing_coefficients(document("blinn_phong", params={"exponent": e})).residual_energy
        for e in (5.0, 20.0, 80.0, 300.0)
    ]
    assert missed == sorted(missed)
    assert missed[0] < 0.05
    assert missed[-1] > 0.5


def test_terms_with_a_highlight_along_the_tangent_have_tables_over_both_angles():
    uneven = {model for model in ANALYTIC if outgoing_coefficients(document(model)).table.shape[1] > 1}
    assert "ward_anisotropic" in uneven
    assert not uneven & {"lambert", "oren_nayar", "blinn_phong", "cook_torrance", "ggx"}


def test_terms_of_one_texture_are_summed():
    terms = [
        document("lambert"),
        document("lambert", texture="diffuse"),
        document("lambert", texture="diffuse", color=[0, 0, 1.0]),
        document("ward_anisotropic", params={"alpha_x": 0.9, "alpha_y": 0.5}),
    ]
    assert not is_narrow(white_coefficients(terms[-1]))
    tables = build_tables([terms, []])
    texture_slots = [[0, 0, -1, -1, -1, -1], [1, -1, -1, -1, -1, -1], [-1] * 6]
    assert tables.table_index.tolist() == [texture_slots, [[-1] * 6] * 3]
    np.testing.assert_allclose(tables.isotropic[1, 0, :, 0], np.array([1, 1, 2]) / np.sqrt(np.pi), rtol=1e-5)


@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.3])
def test_a_lobe_has_the_albedo_of_its_term(roughness):
    """The integral of the term, with a quadrature over half vectors: dωi = 4 cos θd dωh."""
    term = document("ggx", params={"roughness": roughness, "f0": 0.5}, color=[1.0, 0.5, 0.25], texture="specular")
    lobes = build_lobes([[document("lambert")], [term]])
    assert lobes.lobe_index.tolist() == [-1, 0]
    nodes, weights = np.polynomial.legendre.leggauss(400)
    alpha = roughness**2
    u, phi = np.repeat((nodes + 1) / 2, 64), np.tile((np.arange(64) + 0.5) * (2 * np.pi / 64), 400)
    tan2 = alpha**2 * u / (1 - u)  # of θh, distributed like GGX facets
    cos_h = 1 / np.sqrt(1 + tan2)
    sin_h = np.sqrt(1 - cos_h**2)
    half = np.stack([sin_h * np.cos(phi), sin_h * np.sin(phi), cos_h], axis=-1)
    density = alpha**2 / (np.pi * cos_h**3 * (alpha**2 + tan2) ** 2)
    for row in (2, 12, 22):
        cosine = cosines()[row]
        wo = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        cos_d = half @ wo
        wi = 2 * cos_d[:, None] * half - wo
        measure = np.repeat(weights / 2, 64) / 64 / density * 4 * np.maximum(cos_d, 0)
        value = eval_brdf(term, wi, wo) * (np.maximum(wi[:, 2], 0) * measure)[:, None]
        np.testing.assert_allclose(lobes.albedo[0, row, 2], value.sum(axis=0), rtol=0.03)
        assert not lobes.albedo[0, row, :2].any()


def test_sharp_lobes_point_to_the_mirror_direction_and_grow_with_roughness():
    lobes = [build_lobes([[document("ggx", params={"roughness": r, "f0": 0.5})]]) for r in (0.05, 0.2, 0.35)]
    np.testing.assert_allclose(lobes[0].cosine[0, :24].mean(axis=1), cosines()[:24], atol=0.02)
    widths = [lobe.single_sigma[0, 8] for lobe in lobes]
    assert widths == sorted(widths)
    assert all((lobe.sigma[0, :24, 1] > 2 * lobe.sigma[0, :24, 0]).all() for lobe in lobes)  # core and tail
    assert all(lobe.is_two.all() for lobe in lobes)


@pytest.mark.parametrize("row", [10, 16, 20])
@pytest.mark.parametrize("exponent", [60.0, 200.0])
def test_two_lobes_are_as_wide_as_the_highlight_along_it_and_across(row, exponent):
    """Mean and variances over all directions, with another quadrature."""
    term = document("blinn_phong", params={"exponent": exponent})
    lobes = build_lobes([[term]])
    assert not lobes.is_two.any()
    cosine = cosines()[row]
    theta_o = np.arccos(cosine)
    nodes, weights = np.polynomial.legendre.leggauss(600)
    cos_i, phi = np.repeat((nodes + 1) / 2, 360), np.tile((np.arange(360) + 0.5) * (2 * np.pi / 360), 600)
    sin_i = np.sqrt(1 - cos_i**2)
    wi = np.stack([sin_i * np.cos(phi), sin_i * np.sin(phi), cos_i], axis=-1)
    weight = eval_brdf(term, wi, np.array([-np.sin(theta_o), 0, cosine]))[:, 0] * cos_i * np.repeat(weights, 360)
    weight /= weight.sum()
    mean = weight @ wi
    angle, length = np.arctan2(mean[0], mean[2]), np.linalg.norm(mean)
    u, v = wi @ [np.cos(angle), 0, -np.sin(angle)], wi[:, 1]
    difference = np.sin(np.arccos(lobes.cosine[0, row]) - angle)
    fraction = np.array([lobes.first[0, row], 1 - lobes.first[0, row]])
    variance = float(fraction @ lobes.sigma[0, row] ** 2)
    # at grazing angles a highlight is longer than two round lobes: the best fit is wider across
    assert (weight @ v**2) / length == pytest.approx(variance, rel=0.2)
    assert (weight @ u**2) / length == pytest.approx(variance + fraction @ difference**2, rel=0.1)
    assert fraction @ difference == pytest.approx(0, abs=0.03 * np.sqrt(variance))


@pytest.mark.parametrize(
    ("model", "params"),
    [("ggx", {"roughness": 0.3, "f0": 0.9}), ("cook_torrance", {}), ("blinn_phong", {"exponent": 3000.0})],
)
def test_two_lobes_equal_their_reference_and_fit_better_than_one(model, params):
    even = lobes_module._isotropic_grid()
    value = even.quadrature.values(document(model, params=params))
    outgoing = np.maximum(value.mean(axis=0) * even.z, 0).astype(np.float32)
    fits = fit_two_lobes(even.x, even.z, even.area, outgoing)
    for row in (12, 24):
        x, z, area, of_row = (
            np.asarray(core_weight, np.float64) for core_weight in (even.x[row], even.z[row], even.area, outgoing[row])
        )
        np.testing.assert_allclose(fits[row], fit_two_lobes_numpy(x, z, area, of_row), rtol=2e-3, atol=2e-4)
        weight = of_row * area / (of_row @ area)
        towards = np.array([weight @ x, weight @ z])
        length = np.linalg.norm(towards)

        def density(cosine, sigma, x=x, z=z):
            difference = 1 - np.sqrt(1 - cosine**2) * x - cosine * z
            return np.exp(-difference / sigma**2) / (2 * np.pi * sigma**2 * (1 - np.exp(-2 / sigma**2)))

        core_weight, tail_weight, first, narrow, wide = map(float, fits[row])
        two = first * density(core_weight, narrow) + (1 - first) * density(tail_weight, wide)
        alone = density(towards[1] / length, np.sqrt(1 - length))
        assert weight @ np.log(two + 1e-30) > weight @ np.log(alone + 1e-30)


def test_black_terms_have_finite_lobes():
    nothing = np.zeros((2, 8), np.float32)
    fits = fit_two_lobes(nothing, nothing + 1, nothing[0] + 1, nothing)
    np.testing.assert_array_equal(fits, [[1, 1, 0.5, 1, 1]] * 2)


def test_terms_along_the_tangent_have_one_lobe_of_the_mean_width():
    term = document("ward_anisotropic", params={"alpha_x": 0.4, "alpha_y": 0.1})
    lobes = build_lobes([[term]])
    assert lobes.lobe_index.tolist() == [0]
    np.testing.assert_array_equal(lobes.cosine[0, :, 0], lobes.cosine[0, :, 1])


def test_max_ratio_follows_the_residual_of_the_basis():
    max_ratios = [
        build_lobes([[document("blinn_phong", params={"exponent": e})]]).max_ratio[0] for e in (20.0, 30.0, 300.0)
    ]
    assert max_ratios[0] > max_ratios[1] > max_ratios[2] == 1
    assert max_ratios[0] > 5
