"""Band values of generated and drawn curves, against slow integration of the same function."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from scipy.interpolate import PchipInterpolator

from relume.brdf.curves import channel_params, curve_bands, curve_values, generated_bands
from relume.brdf.registry import TERMS
from relume.brdf.term import Angle
from relume.math.angle_bands import band_averages, band_edges

CURVES = [(t.model, c.name) for t in ANALYTIC.values() for c in t.curves]


def slow_averages(function, curve, panels=512):
    """Reference: a 4-point rule on 512 panels in each band, without midpoints; weighted by the angle around a pole."""
    fine = np.linspace(0, np.pi / 2, curve.num_bands * panels + 1)
    x, w = np.polynomial.legendre.leggauss(4)
    nodes = fine[:-1, None] + 0.5 * np.diff(fine)[:, None] * (1 + x)
    weights = nodes if curve.angle in (Angle.THETA_H, Angle.THETA_R, Angle.LOBE) else np.ones_like(nodes)
    values, total = (function(nodes) * weights) @ w, weights @ w
    return values.reshape(-1, panels).sum(axis=1) / total.reshape(-1, panels).sum(axis=1)


def sweep(model):
    """Parameter values over the whole range, including the hardest widths."""
    parameters = TERMS[model].parameters
    for t in (0.0, 0.02, 0.1, 0.3, 0.7, 1.0):
        params = {}
        for p in parameters:
            log = p.scale == "log"
            params[p.name] = (
                p.minimum * (p.maximum / p.minimum) ** t if log else p.minimum + t * (p.maximum - p.minimum)
            )
        yield params


@pytest.mark.parametrize(("model", "name"), CURVES)
def test_generated_bands_are_averages_over_the_bands(model, name):
    curve = TERMS[model].curve(name)
    for params in sweep(model):
        bands = generated_bands({"model": model, "params": params}, curve)
        assert bands.shape == (3, curve.num_bands)
        assert bands.dtype == np.float64
        assert (bands >= 0).all()
        expected = slow_averages(lambda gamma, p=params: curve.generator(gamma, p), curve)
        np.testing.assert_allclose(bands[0], expected, rtol=1e-6, atol=1e-9 * expected.max())


@pytest.mark.parametrize("sigma", [0.005, 0.02, 0.2])
def test_narrow_highlights_keep_their_light(sigma):
    # σ = 0.005: the highlight lies within the first band; a mean over angles would be 1.6 times as bright
    curve = TERMS["cook_torrance"].curve("theta_h")
    bands = generated_bands({"model": "cook_torrance", "params": {"sigma": sigma}}, curve)[0]
    total = (bands * np.diff(np.square(band_edges(256)) / 2)).sum()
    gamma = np.concatenate([np.linspace(0, 20 * sigma, 400_001)[:-1], np.linspace(20 * sigma, np.pi / 2, 1001)[:-1]])
    gamma = np.unique(np.minimum(gamma, np.pi / 2 - 1e-3))
    values = curve.generator(gamma, {"sigma": sigma}) * gamma
    assert total == pytest.approx(np.trapezoid(values, gamma), rel=1e-3)


@pytest.mark.parametrize("num_bands", [1, 4, 64, 256])
def test_band_averages_are_exact_for_polynomials(num_bands):
    edges = band_edges(num_bands)
    expected = np.diff(edges**6 / 6) / np.diff(edges)
    np.testing.assert_allclose(band_averages(lambda x: x**5, num_bands), expected, rtol=1e-12, atol=1e-15)
    weighed = np.diff(edges**7 / 7) / np.diff(edges**2 / 2)
    np.testing.assert_allclose(
        band_averages(lambda x: x**5, num_bands, solid_angle_weighted=True), weighed, rtol=1e-12, atol=1e-15
    )


def test_parameters_may_differ_by_channel():
    term = {"model": "ggx", "params": {"f0": [1.0, 0.78, 0.34], "roughness": 0.3}}
    curve = TERMS["ggx"].curve("theta_d")
    assert [p["f0"] for p in channel_params(term, curve)] == [1.0, 0.78, 0.34]
    bands = generated_bands(term, curve)
    for k, f0 in enumerate((1.0, 0.78, 0.34)):
        alone = generated_bands({"model": "ggx", "params": {"f0": f0}}, curve)
        np.testing.assert_array_equal(bands[k], alone[0])
    np.testing.assert_allclose(curve_values(term, curve, np.array(0.0)), [1.0, 0.78, 0.34], rtol=1e-15)


def test_missing_parameters_have_the_declared_default():
    curve = TERMS["cook_torrance"].curve("theta_h")
    full = generated_bands({"model": "cook_torrance", "params": {"sigma": 0.2}}, curve)
    np.testing.assert_array_equal(generated_bands({"model": "cook_torrance"}, curve), full)


def test_returned_bands_may_be_changed_without_harm():
    curve = TERMS["lambert"].curve("theta_i")
    curve_bands({"model": "lambert"}, curve)[:] = 7
    np.testing.assert_allclose(curve_bands({"model": "lambert"}, curve), 1.0)


POINTS = [[5.0, 4.0], [12.0, 1.5], [12.5, 1.4], [60.0, 0.0], [85.0, 0.2]]


def drawn(document, model="cook_torrance", name="theta_h"):
    return {"model": model, "curves": {name: document}}, TERMS[model].curve(name)


def test_points_are_averaged_exactly_and_continue_constantly():
    term, curve = drawn({"points": POINTS})
    x, y = np.array(POINTS).T
    spline = PchipInterpolator(np.radians(x), y)

    def displayed(gamma):
        return spline(np.clip(gamma, np.radians(x[0]), np.radians(x[-1])))

    bands = curve_bands(term, curve)
    np.testing.assert_allclose(bands[0], slow_averages(displayed, curve), atol=1e-6)
    np.testing.assert_allclose(bands[:, :14], 4.0, rtol=1e-12)  # up to 4.9°
    np.testing.assert_allclose(bands[:, 242:], 0.2, rtol=1e-9)  # from 85.1°
    gamma = np.linspace(0, np.pi / 2, 500)
    np.testing.assert_allclose(curve_values(term, curve, gamma)[1], displayed(gamma), atol=1e-12)


def test_two_points_make_a_straight_line():
    term, curve = drawn({"points": [[0, 0], [90, 9]]})
    edges = np.linspace(0, 9, 257)
    centers = np.diff(edges**3 / 3) / np.diff(edges**2 / 2)  # nearly the band centers
    np.testing.assert_allclose(curve_bands(term, curve)[2], centers, rtol=1e-9)
    term, curve = drawn({"points": [[0, 0], [90, 9]]}, name="theta_d")
    np.testing.assert_allclose(curve_bands(term, curve)[2], 9 * (np.arange(64) + 0.5) / 64, rtol=1e-9)


def test_channels_without_drawn_values_are_generated():
    term, curve = drawn([{"points": [[0, 3], [90, 3]], "channels": "g"}, {"bands": list(range(256)), "channels": "b"}])
    bands = curve_bands(term, curve)
    np.testing.assert_array_equal(bands[0], generated_bands(term, curve)[0])
    np.testing.assert_allclose(bands[1], 3.0)
    np.testing.assert_array_equal(bands[2], np.arange(256))
    gamma = (np.arange(256) + 0.5) * (np.pi / 512)
    values = curve_values(term, curve, gamma)
    np.testing.assert_array_equal(values[2], np.arange(256))
    np.testing.assert_array_equal(values[0], curve.generator(gamma, {"sigma": 0.2}))


@pytest.mark.parametrize("flat", [True, False])
def test_bands_per_channel_come_flat_or_as_lists(flat):
    values = np.random.default_rng(1).uniform(size=(3, 64))
    term, curve = drawn({"bands": (values.ravel() if flat else values).tolist()}, name="theta_d")
    np.testing.assert_array_equal(curve_bands(term, curve), values)


def test_bands_of_one_curve_serve_all_channels_it_names():
    term, curve = drawn({"bands": [2.0] * 64, "channels": "rb"}, name="theta_d")
    bands = curve_bands(term, curve)
    np.testing.assert_array_equal(bands[[0, 2]], 2.0)
    np.testing.assert_array_equal(bands[1], generated_bands(term, curve)[1])


def test_curves_are_clamped_at_zero():
    term, curve = drawn({"bands": [-1.0] * 64}, name="theta_d")
    np.testing.assert_array_equal(curve_bands(term, curve), 0.0)
    np.testing.assert_array_equal(curve_values(term, curve, np.array([0.3])), 0.0)
