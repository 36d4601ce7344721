"""The interpolated measured BRDF and its quotients, against plain NumPy and the source terms."""

import numpy as np
import pytest
from merl_files import PLASTIC, make_planes

from relume.assets.measured.factorize import FLOOR, factorize, factorize_rank_one
from relume.assets.measured.interpolate import (
    NUM_KNOTS,
    QuotientKind,
    build_table,
    evaluate_measured,
    measured_over_model,
)
from relume.assets.measured.merl import CHANNEL_SCALE, grid_directions, is_measured
from relume.brdf.evaluate import eval_brdf


def directions(rng, num, lowest=0.0):
    """Directions above the horizon with cosines above `lowest`."""
    v = rng.normal(size=(num, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    z = lowest + (1 - lowest) * np.abs(v[:, 2])
    across = v[:, :2] * np.sqrt((1 - z * z) / np.maximum((v[:, :2] ** 2).sum(axis=1), 1e-30))[:, None]
    return np.concatenate([across, z[:, None]], axis=1)


def spherical(v):
    return np.arctan2(np.linalg.norm(v[..., :2], axis=-1), v[..., 2]), np.arctan2(v[..., 1], v[..., 0])


def rotated(v, axis, angle):
    """Rodrigues about a coordinate axis."""
    e = np.eye(3)[axis]
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return c * v + s * np.cross(e, v) + (1 - c) * (v @ e)[..., None] * e


def positions_numpy(wi, wo):
    """Positions in nodes along θh, θd and φd by Rusinkiewicz: the half vector rotated to the pole."""
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    theta_h, phi_h = spherical(half)
    theta_d, phi_d = spherical(rotated(rotated(wi, 2, -phi_h), 1, -theta_h))
    return np.sqrt(theta_h / (np.pi / 2)) * 90, theta_d / (np.pi / 2) * 90, np.mod(phi_d, np.pi) / np.pi * 180


def measured_numpy(table, wi, wo):
    """Trilinear interpolation, one corner after another."""
    h, d, p = positions_numpy(wi, wo)
    h, d = np.minimum(h, 89), np.minimum(d, 89)
    h0, d0, p0 = np.minimum(h.astype(int), 88), np.minimum(d.astype(int), 88), p.astype(int)
    total = 0
    for a in (0, 1):
        for b in (0, 1):
            for c in (0, 1):
                weight = abs(1 - a - (h - h0)) * abs(1 - b - (d - d0)) * abs(1 - c - (p - p0))
                total = total + weight[:, None] * table[h0 + a, d0 + b, (p0 + c) % 180].astype(float)
    return total


def curve_numpy(knots, position):
    return np.stack([np.interp(position, np.arange(NUM_KNOTS), channel) for channel in knots])


def quotient_numpy(lobe, table, curves, wi, wo):
    value, (h, d, _) = measured_numpy(table, wi, wo).T, positions_numpy(wi, wo)
    i, o = (np.arccos(v[:, 2]) / (np.pi / 2) * 90 for v in (wi, wo))
    product = curve_numpy(curves[0], i) * curve_numpy(curves[3], o)
    match lobe:
        case QuotientKind.WHOLE:
            return value
        case QuotientKind.DIFFUSE:
            return np.minimum(value, product) / product
        case QuotientKind.SPECULAR:
            return np.maximum(value - product, 0) / (curve_numpy(curves[1], h) * curve_numpy(curves[2], d))
        case QuotientKind.HOMOMORPHIC:
            return value / (product * curve_numpy(curves[1], h))


@pytest.fixture(scope="module")
def factors(planes, table):
    return factorize(planes, table)


def test_nodes_have_the_stored_values(planes, table):
    wi, wo = grid_directions()
    nodes = is_measured(planes) & (wi[..., 2] > 1e-6) & (wo[..., 2] > 1e-6)
    expected = np.moveaxis(planes, 0, -1)[nodes] * CHANNEL_SCALE
    np.testing.assert_allclose(evaluate_measured(table, wi[nodes], wo[nodes]), expected, rtol=2e-6, atol=1e-9)


def test_interpolated_values_are_near_the_source_terms(table):
    rng = np.random.default_rng(1)
    wi, wo = directions(rng, 20_000, 0.3), directions(rng, 20_000, 0.3)
    expected = sum(eval_brdf(document, wi, wo) for document in PLASTIC)
    actual = evaluate_measured(table, wi, wo)
    # linear over at most 2°, Δ²/8 · f''/f with a lobe that changes by a factor of e within about 10°: 0.5 %
    assert np.abs(actual - expected).max() < 0.02 * expected.max()
    assert np.sqrt(np.mean((actual - expected) ** 2)) < 5e-3 * np.sqrt(np.mean(expected**2))


def test_the_brdf_is_reciprocal_and_isotropic(table):
    rng = np.random.default_rng(2)
    wi, wo = directions(rng, 2000, 1e-3), directions(rng, 2000, 1e-3)
    value = evaluate_measured(table, wi, wo)
    np.testing.assert_allclose(evaluate_measured(table, wo, wi), value, rtol=1e-6, atol=1e-9)
    angle = rng.uniform(0, 2 * np.pi, 2000)
    np.testing.assert_allclose(
        evaluate_measured(table, rotated(wi, 2, angle), rotated(wo, 2, angle)), value, rtol=1e-6, atol=1e-9
    )


@pytest.mark.parametrize("lobe", list(QuotientKind))
def test_quotients_equal_their_reference(table, factors, lobe):
    rng = np.random.default_rng(3)
    wi, wo = directions(rng, 5000, 1e-3), directions(rng, 5000, 1e-3)
    curves = factors.homomorphic if lobe is QuotientKind.HOMOMORPHIC else factors.lobes
    actual = measured_over_model(lobe, table, curves, *wi.T, *wo.T)
    expected = quotient_numpy(lobe, table, curves, wi, wo)
    np.testing.assert_allclose(actual, expected, rtol=1e-6, atol=1e-7 * expected.max())


@pytest.mark.parametrize("lobe", list(QuotientKind))
def test_quotients_are_bounded_and_zero_below_the_horizon(table, factors, lobe):
    curves = factors.homomorphic if lobe is QuotientKind.HOMOMORPHIC else factors.lobes
    rng = np.random.default_rng(4)
    for dtype in (np.float32, np.float64):
        wi, wo = directions(rng, 3000).astype(dtype).T, directions(rng, 3000).astype(dtype).T
        wi[2, :500] = np.geomspace(1e-30, 1e-3, 500)
        value = measured_over_model(lobe, table, curves, *wi, *wo)
        assert value.dtype == dtype
        assert np.isfinite(value).all()
        assert (value >= 0).all()
        down = wi * np.array([[1], [1], [-1]], dtype)
        for a, b in ((down, wo), (wo, down), (down, down)):
            assert not measured_over_model(lobe, table, curves, *a, *b).any()


def test_curves_can_be_divided_by(factors):
    for curves in (factors.lobes, factors.homomorphic):
        assert curves.shape == (4, 3, NUM_KNOTS)
        assert (curves > 0).all()
        assert (curves >= 0.999 * FLOOR * np.maximum(curves.max(axis=2, keepdims=True), 1)).all()


def test_a_separable_material_is_factorized_without_residual():
    """Lambert, and a lobe that is a product of functions of θh and θd by construction."""
    planes = make_planes(({"model": "blinn_phong", "color": [3.0, 2.0, 1.0], "params": {"exponent": 20.0}},))
    table = build_table(planes)
    factorized = factorize(planes, table)
    np.testing.assert_allclose(factorized.homomorphic_error, 0, atol=0.02)
    lambert = make_planes(({"model": "lambert", "color": [0.5, 0.2, 0.0]},))
    factorized = factorize(lambert, build_table(lambert))
    np.testing.assert_allclose(factorized.lobes_error, 0, atol=2e-3)
    np.testing.assert_allclose(factorized.homomorphic_error[:2], 0, atol=1e-3)
    np.testing.assert_allclose(factorized.lobes[0, 0] * factorized.lobes[3, 0], 0.5 / np.pi, rtol=2e-3)
    np.testing.assert_allclose(factorized.lobes[0, 2] * factorized.lobes[3, 2], 0, atol=2e-6)  # blue is black


def test_both_lobes_are_separated(planes, table, factors):
    diffuse = factors.lobes[0] * factors.lobes[3]
    np.testing.assert_allclose(diffuse[:, 20:60], np.array([[0.5, 0.2, 0.05]]).T / np.pi * np.ones(40), rtol=0.2)
    highlight = factors.lobes[1, 0]
    assert highlight[0] > 50 * highlight[60]
    assert max(factors.lobes_error) < 0.2


def test_rank_one_recovers_the_factors_with_a_quotient_of_one():
    rng = np.random.default_rng(5)
    u, v, weight = rng.uniform(0.1, 9, 30), rng.uniform(0.1, 1, 20), rng.uniform(0.5, 1, (30, 20))
    v /= v.max()
    found_u, found_v = factorize_rank_one(np.outer(u, v), weight)
    np.testing.assert_allclose(found_u, u, rtol=1e-9)
    np.testing.assert_allclose(found_v, v, rtol=1e-9)
    noisy = np.outer(u, v) * rng.uniform(0.5, 1.5, (30, 20))
    found_u, found_v = factorize_rank_one(noisy, weight)
    quotient = noisy / np.outer(found_u, found_v)
    np.testing.assert_allclose((quotient * weight).sum(axis=0) / weight.sum(axis=0), 1, rtol=1e-6)
    np.testing.assert_allclose((quotient * weight).sum(axis=1) / weight.sum(axis=1), 1, rtol=1e-6)
