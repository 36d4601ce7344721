"""Rays of a lobe have its distribution, at any width, and the mean density of each band."""

from __future__ import annotations

import numpy as np
import pytest

from relume.brdf.lobe_sampling import MAX_MEDIAN, sample_lobe
from relume.brdf.roughness_levels import NO_LEVELS, RoughnessLevels
from relume.brdf.term import Angle
from relume.brdf.term_validation import complete_term
from relume.math.angle_bands import band_edges


def document(model, **params):
    return complete_term(("terms", 0), {"model": model, "params": params}, None)


@pytest.mark.parametrize("roughness", [0.01, 0.03, 0.1, 0.2])
def test_angles_of_ggx_have_its_distribution(roughness):
    """∫ D cos dω up to θh is tan² θh / (α² + tan² θh)."""
    lobe = sample_lobe(document("ggx", roughness=roughness), NO_LEVELS)
    fraction = np.array([0.1, 0.5, 0.9, 0.99])
    expected = np.arctan(roughness**2 * np.sqrt(fraction / (1 - fraction)))
    found = np.interp(fraction, np.linspace(0, 1, lobe.quantile.shape[1]), lobe.quantile[0])
    np.testing.assert_allclose(found, expected, rtol=5e-3)
    assert lobe.median[0] == pytest.approx(np.arctan(roughness**2), rel=5e-3)


def test_angles_of_phong_have_its_distribution():
    """cos^n about the mirror direction: cos^(n + 1) of the rays are farther away than θr."""
    lobe = sample_lobe(document("phong", exponent=1000.0), NO_LEVELS)
    assert not lobe.is_half_angle
    assert np.cos(lobe.median[0]) ** 1001 == pytest.approx(0.5, rel=5e-3)


def test_angles_of_an_anisotropic_lobe_have_its_distributions():
    lobe = sample_lobe(document("ward_anisotropic", alpha_x=0.02, alpha_y=0.3), NO_LEVELS)
    assert lobe.angles == (Angle.TILT_X, Angle.TILT_Y)
    fraction = np.linspace(0, 1, lobe.quantile.shape[1])
    for row, alpha in enumerate((0.02, 0.3)):
        gamma = np.linspace(0, 1.5, 200_001)
        density = np.exp(-((np.tan(gamma) / alpha) ** 2))
        expected = np.interp([0.2, 0.5, 0.9], np.cumsum(density) / density.sum(), gamma)
        np.testing.assert_allclose(np.interp([0.2, 0.5, 0.9], fraction, lobe.quantile[row]), expected, rtol=0.01)
        assert lobe.band_density[row].sum() * np.pi / lobe.band_density.shape[1] == pytest.approx(1, rel=1e-5)


def test_a_lobe_that_is_narrow_along_one_direction_is_traced():
    assert sample_lobe(document("ashikhmin_shirley", nu=20.0, nv=2e4), NO_LEVELS).is_narrow.tolist() == [True]
    assert sample_lobe(document("ashikhmin_shirley", nu=100.0, nv=100.0), NO_LEVELS) is None


def test_lafortune_is_about_its_axis():
    lobe = sample_lobe(document("lafortune", exponent=1e4, c_x=0.5, c_y=1.0), NO_LEVELS)
    assert lobe.axes == (-0.5, -1.0, 1.0)
    assert not lobe.is_round
    assert sample_lobe(document("lafortune", exponent=1e4), NO_LEVELS).is_round
    assert sample_lobe(document("lafortune", exponent=1e4, c_x=0.0, c_y=0.0, c_z=0.0), NO_LEVELS) is None


def test_densities_of_all_bands_sum_to_one():
    lobe = sample_lobe(document("ggx", roughness=0.15), NO_LEVELS)
    solid_angles = 2 * np.pi * -np.diff(np.cos(band_edges(lobe.band_density.shape[1])))
    assert lobe.band_density[0] @ solid_angles == pytest.approx(1, rel=1e-5)
    assert np.all(lobe.band_density > 0)


def test_each_roughness_level_has_its_own_lobe():
    mapped = {**document("ggx", roughness=0.1), "roughness_map": True}
    lobe = sample_lobe(mapped, RoughnessLevels(((0.5, 0.0), (2.0, 0.0), (4.0, 0.0)), np.zeros(1, np.uint8)))
    assert lobe.is_narrow.tolist() == [True, True, False]
    ratio = lobe.quantile[1, 2048] / lobe.quantile[0, 2048]
    assert ratio == pytest.approx(16, rel=0.02)
    assert lobe.median[0] == pytest.approx(np.arctan(0.05**2), rel=5e-3)


def test_a_drawn_spike_is_sampled_where_it_is():
    drawn = {"theta_h": {"points": [[0, 0], [1.0, 0], [1.2, 5], [1.4, 0], [90, 0]]}}
    lobe = sample_lobe({**document("ggx"), "curves": drawn}, NO_LEVELS)
    assert np.all(np.degrees(lobe.quantile[0, 1:-1]) > 0.99)
    assert np.degrees(lobe.quantile[0, -2]) < 1.41


@pytest.mark.parametrize(
    "given",
    [
        document("lambert"),
        document("ggx", roughness=0.5),
        document("ashikhmin_shirley"),
        {**document("ggx"), "curves": {"theta_h": {"points": [[0, 0], [90, 0]]}}},
        {**document("ward_anisotropic", alpha_x=0.01), "curves": {"tilt_y": {"points": [[0, 0], [90, 0]]}}},
    ],
)
def test_wide_and_black_terms_have_no_lobe_rays(given):
    assert sample_lobe(given, NO_LEVELS) is None


def test_the_widest_lobe_is_near_the_limit():
    assert sample_lobe(document("ggx", roughness=0.22), NO_LEVELS).median[0] < MAX_MEDIAN
    assert sample_lobe(document("ggx", roughness=0.24), NO_LEVELS) is None
