"""Terms at roughness levels: the width parameter is scaled within its range; drawn curves do not change."""

from __future__ import annotations

import numpy as np
import pytest

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import (
    NO_LEVELS,
    RoughnessLevels,
    level_bands,
    level_values,
    scaled_roughness,
    uses_roughness_map,
)
from relume.brdf.term_validation import complete_term
from relume.brdf.terms import ggx
from relume.core.errors import ParameterError

WIDE = [term for term in TERMS.values() if term.width is not None and term.model != "ggx_multiple"]  # no highlight
LEVELS = RoughnessLevels(((0.5, 0.0), (1.0, 0.0), (1.5, 0.02)), np.array([0, 0, 1, 2, 2, 2], np.uint8))


def document(model, **more):
    return complete_term(("terms", 0), {"model": model, "roughness_map": "roughness", **more}, None)


def half_width(model, ratio):
    """Angle at half of the highlight's peak."""
    curve = TERMS[model].curves[0]
    gamma = np.linspace(0, 1.2, 20_001)
    values = curve_values(scaled_roughness(document(model), ratio), curve, gamma)[0]
    return gamma[np.argmax(values < values[0] / 2)]


@pytest.mark.parametrize("model", [term.model for term in WIDE])
def test_highlight_width_is_the_square_of_the_roughness(model) -> None:
    """α = roughness² for every width parameter."""
    given = TERMS[model].parameter(TERMS[model].width[0])
    assert given.minimum < scaled_roughness(document(model), 0.7)["params"][given.name] < given.maximum
    assert half_width(model, 0.7) / half_width(model, 1.0) == pytest.approx(0.49, rel=0.08)


def test_parameters_stay_in_their_range() -> None:
    assert scaled_roughness(document("ggx", params={"roughness": [0.2, 0.5, 0.9]}), 2.0)["params"]["roughness"] == [
        0.4,
        1,
        1,
    ]
    assert scaled_roughness(document("ggx"), 0.0)["params"]["roughness"] == 0.01
    assert scaled_roughness(document("phong"), 0.01)["params"]["exponent"] == 1e5


def test_facets_are_convolved_with_the_slopes_of_normals() -> None:
    """Against the sum over many normals; the tail stays that of GGX."""
    alpha, sigma, theta = 0.04, 0.1, np.radians([0.0, 2.0, 8.0, 20.0, 60.0])
    level = scaled_roughness(document("ggx", params={"roughness": alpha**0.5, "f0": 0.5}), 1.0, sigma**2)
    values = curve_values(level, TERMS["ggx"].curve("theta_h"), theta)[0]
    x = np.linspace(-6 * sigma, 6 * sigma, 1201)
    gauss = np.exp(-np.add.outer(x**2, x**2) / (2 * sigma**2))
    for angle, value in zip(theta, values, strict=True):
        squared = np.add.outer((x - np.tan(angle)) ** 2, x**2)
        slopes = alpha**2 / (np.pi * (alpha**2 + squared) ** 2)
        expected = (slopes * gauss).sum() / gauss.sum() / np.cos(angle) ** 4
        assert value == pytest.approx(expected, rel=5e-3)


def shown_by_normals(wi, wo, params, sigma, normals=4000):
    """BRDF times cosine of a flat surface, the mean over normals of its map. (n,)"""
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    theta_d, total = np.arccos(h @ wo), np.zeros(len(wi))
    for slopes in np.random.default_rng(4).normal(size=(normals, 2)) * sigma:
        n = np.array([*slopes, 1.0])
        n /= np.linalg.norm(n)
        if n @ wo < 0.01:  # bent into view
            n += (0.01 - n @ wo) * wo
            n /= np.linalg.norm(n)
        cos_i, cos_h = np.maximum(wi @ n, 0), np.clip(h @ n, 0, 1)
        facets = ggx.ndf(np.arccos(cos_h), params) * ggx.reflectance(theta_d, params)
        masked = ggx.masking(np.arccos(cos_i), params) * ggx.masking(np.arccos(n @ wo), params)
        total += np.where(cos_i > 0, facets * masked / (4 * (n @ wo)), 0)
    return total / normals


@pytest.mark.parametrize(("degrees", "max_error"), [(40, 0.05), (60, 0.06), (78, 0.1)])
def test_normals_within_a_pixel_do_not_face_the_viewer(degrees, max_error) -> None:
    """Facets would, and be too bright where they reflect what is above, too dark at the horizon."""
    params, sigma, num = {"roughness": 0.34, "f0": 0.04}, 0.077, 40
    wo = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
    z, phi = np.meshgrid((np.arange(num) + 0.5) / num, 2 * np.pi * (np.arange(num) + 0.5) / num, indexing="ij")
    wi = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=-1).reshape(-1, 3)
    expected = shown_by_normals(wi, wo, params, sigma)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    wide = {**params, "slope_variance": sigma**2}
    masked = ggx.light_masking(np.arccos(wi[:, 2]), wide) * ggx.view_masking(np.radians(degrees), wide)
    value = ggx.ndf(np.arccos(h[:, 2]), wide) * ggx.reflectance(np.arccos(h @ wo), wide) * masked / (4 * wo[2])
    elevation = np.degrees(np.arcsin(wi[:, 2]))
    bands = np.digitize(elevation, [15, 30, 50])
    shown, summed = (np.bincount(bands, weights=brdf) for brdf in (value, expected))
    assert np.abs(shown - summed).sum() < max_error * summed.sum()


@pytest.mark.parametrize("model", ["ward", "cook_torrance", "blinn_phong"])
def test_other_lobes_are_as_wide_as_their_facets_and_the_normals(model) -> None:
    """Half of the energy of slopes lies within √(ln 2 (α² + 2 σ²)), for Gaussian ones."""
    name, value = {"ward": ("alpha", 0.05), "cook_torrance": ("sigma", 0.05), "blinn_phong": ("exponent", 800.0)}[model]
    params = scaled_roughness(document(model, params={name: value}), 1.0, 0.1**2)["params"][name]
    expected = 2 / (0.05**2 + 2 * 0.1**2) if model == "blinn_phong" else (0.05**2 + 2 * 0.1**2) ** 0.5
    assert params == pytest.approx(expected, rel=1e-6)


def test_only_curves_of_the_width_differ_between_levels() -> None:
    term, curves = document("ggx"), {curve.name: curve for curve in TERMS["ggx"].curves}
    assert level_bands(term, curves["theta_h"], LEVELS).shape == (3, 3, 256)
    assert level_bands(term, curves["theta_d"], LEVELS).shape == (3, 64)
    assert level_bands(term, curves["theta_h"], NO_LEVELS).shape == (3, 256)
    assert level_bands({**term, "roughness_map": None}, curves["theta_h"], LEVELS).shape == (3, 256)
    for k, pair in enumerate(LEVELS.pairs):
        expected = curve_bands(scaled_roughness(term, *pair), curves["theta_h"])
        np.testing.assert_array_equal(level_bands(term, curves["theta_h"], LEVELS)[k], expected)


def test_a_drawn_curve_is_the_same_at_all_levels() -> None:
    term = document("ggx", curves={"theta_h": {"points": [[0, 2.0], [90, 0.0]]}})
    bands = level_bands(term, TERMS["ggx"].curve("theta_h"), LEVELS)
    np.testing.assert_array_equal(bands[0], bands[2])
    np.testing.assert_array_equal(bands[0], curve_bands(term, TERMS["ggx"].curve("theta_h")))


def test_each_sample_has_the_values_of_its_level() -> None:
    term, curve = document("ggx"), TERMS["ggx"].curve("theta_o")
    gamma = np.linspace(0.2, 1.5, 6)
    actual = level_values(term, curve, gamma, LEVELS)
    for sample, level in enumerate(LEVELS.level):
        expected = curve_values(scaled_roughness(term, *LEVELS.pairs[level]), curve, gamma[sample : sample + 1])
        np.testing.assert_allclose(actual[:, sample], expected[:, 0])


@pytest.mark.parametrize("model", ["lambert", "oren_nayar", "ashikhmin_shirley"])
def test_terms_without_a_width_reject_a_roughness_map(model) -> None:
    with pytest.raises(ParameterError, match="roughness_map"):
        document(model)


@pytest.mark.parametrize("value", [True, False, 1, "map", [], {}])
def test_following_a_map_accepts_only_booleans(value) -> None:
    with pytest.raises(ParameterError, match="roughness_map"):
        complete_term(("terms", 0), {"model": "ggx", "roughness_map": value}, None)
    assert not uses_roughness_map(complete_term(("terms", 0), {"model": "ggx"}, None))
