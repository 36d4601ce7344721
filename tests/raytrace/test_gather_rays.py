"""Gather rays as estimators: their weights must sum to known integrals."""

from __future__ import annotations

import numpy as np
import pytest

from relume.core.errors import PlanError
from relume.raytrace.gather_rays import (
    MAX_RAYS,
    _step,
    glossy_pdf,
    lattice_offsets,
    local_ray,
    make_pattern,
    ray_weight,
)

WO = np.array([np.sin(0.7), 0.0, np.cos(0.7)], np.float32)


def rays_of(pattern, point):
    """Directions above the horizon and their weights. (n, 3), (n,)"""
    shift = lattice_offsets(pattern, point)
    wi = np.array([local_ray(pattern, ray, shift, *WO) for ray in range(pattern.num_rays)])
    wi = wi[wi[:, 2] > 0]
    return wi, np.array([ray_weight(pattern, *direction, *WO) for direction in wi])


def half_cosines(wi):
    half = wi + WO
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    return half[:, 2], half @ WO


def uniform(num):
    """Uniform directions on the hemisphere, for quadrature. (num, 3)"""
    i = np.arange(num)
    z, phi = (i + 0.5) / num, i * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)


@pytest.mark.parametrize("num_glossy", [0, 100])
def test_directions_are_unit_and_weights_positive(num_glossy):
    wi, weight = rays_of(make_pattern(100, num_glossy, 1), 7)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, atol=1e-5)
    assert weight.min() > 0


def test_weights_of_cosine_rays_sum_to_pi():
    wi, weight = rays_of(make_pattern(377, 0, 1), 3)
    assert len(wi) == 377
    assert weight.sum() == pytest.approx(np.pi, rel=1e-5)


@pytest.mark.parametrize("exponent", [0, 10, 100, 1000])
@pytest.mark.parametrize("num_glossy", [64, 200])
def test_highlights_of_every_size_are_estimated_without_bias(exponent, num_glossy):
    """∫ cos^s θh cos θi dω by the rays of many points, against quadrature."""
    pattern = make_pattern(64, num_glossy, 5)
    estimates = []
    for point in range(300):
        wi, weight = rays_of(pattern, point)
        estimates.append(weight @ half_cosines(wi)[0] ** exponent)
    even = uniform(400_000)
    expected = 2 * np.pi * np.mean(half_cosines(even)[0] ** exponent * even[:, 2])
    spread = np.std(estimates) / np.sqrt(len(estimates))
    assert np.mean(estimates) == pytest.approx(expected, abs=4 * spread + 0.003 * expected)


def test_glossy_rays_reduce_the_noise_of_a_highlight():
    def noise(pattern):
        estimates = [weight @ half_cosines(wi)[0] ** 3000 for wi, weight in (rays_of(pattern, p) for p in range(60))]
        return np.std(estimates) / np.mean(estimates)

    assert noise(make_pattern(128, 128, 1)) < 0.3 * noise(make_pattern(256, 0, 1))


def test_the_half_vector_density_integrates_to_one():
    """∫ p(h) dh = 1 over the hemisphere of h, with p(h) = 4 cos θd · p(ωi)."""
    cosine = np.linspace(0, 1, 2_000_001)
    density = 4 * np.array(glossy_pdf.py_func(cosine, 1.0), float)
    assert 2 * np.pi * np.trapezoid(density, cosine) == pytest.approx(1, rel=1e-3)


def test_shifted_lattices_cover_the_square_uniformly():
    """All rays of many points, as points of the unit square: u from the polar angle, v from the azimuth."""
    pattern, counts = make_pattern(21, 0, 3), np.zeros((8, 8))
    for point in range(3000):
        x, y, _ = rays_of(pattern, point)[0].T
        counts += np.histogram2d(x**2 + y**2, np.arctan2(y, x) / (2 * np.pi) % 1, bins=8, range=[[0, 1], [0, 1]])[0]
    np.testing.assert_allclose(counts, 3000 * 21 / 64, rtol=0.05)


def test_a_ray_index_has_nearly_the_same_direction_at_all_points():
    """Except near the border and the center of the disc, where shifts wrap around."""
    pattern, angles = make_pattern(377, 233, 3), []
    for ray in range(0, pattern.num_rays, 7):
        directions = np.array([local_ray(pattern, ray, lattice_offsets(pattern, point), *WO) for point in range(60)])
        mean = directions.mean(axis=0)
        angles.append(np.degrees(np.arccos(np.clip(directions @ mean / np.linalg.norm(mean), -1, 1)).max()))
    assert np.quantile(angles, 0.8) < 15


@pytest.mark.parametrize("count", [1, 2, 55, 64, 377])
def test_basis_vectors_of_a_lattice_connect_its_points(count):
    sides = make_pattern(count, 0, 1).sides[0].astype(float)
    assert abs(np.linalg.det(sides)) == pytest.approx(1 / count, rel=1e-5)
    step = _step(count)
    for u, v in sides:
        assert (v - u * step) % 1 == pytest.approx(0, abs=1e-5) or (v - u * step) % 1 == pytest.approx(1, abs=1e-5)


def test_shifts_depend_on_seed_and_point():
    pattern = make_pattern(8, 0, 3)
    assert lattice_offsets(make_pattern(8, 0, 4), 5) != lattice_offsets(pattern, 5)
    far = lattice_offsets(pattern, 16_777_216 + 1), lattice_offsets(pattern, 16_777_216)
    assert far[0] != far[1]  # indices beyond the integers of float32 are still distinguished


@pytest.mark.parametrize(("num_cosine", "num_glossy"), [(0, 8), (-1, 0), (MAX_RAYS, 1), (8, -1)])
def test_counts_out_of_bounds_are_rejected(num_cosine, num_glossy):
    with pytest.raises(PlanError):
        make_pattern(num_cosine, num_glossy, 0)
