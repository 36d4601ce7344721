"""Bounces against plain NumPy, and against rooms with radiance in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import studio

from relume.lights.spherical_triangles import tessellate_environment
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.bounce import bounces, irradiance, one_bounce, preview_bounces


def random_hits(num_patches, num_rays, seed, lost=0.2):
    rng = np.random.default_rng(seed)
    hits = rng.integers(0, num_patches, (num_patches, num_rays)).astype(np.uint16)
    hits[rng.random(hits.shape) < lost] = NO_PATCH
    return hits


def bounce_numpy(hits, reflectance, radiance):
    incident = np.concatenate([radiance, np.zeros((NO_PATCH + 1 - len(radiance), 3))])[hits]
    return reflectance * incident.mean(axis=1)


def test_a_bounce_equals_numpy():
    hits = random_hits(700, 33, seed=1)
    reflectance, radiance = np.random.default_rng(2).random((2, 700, 3), np.float32)
    np.testing.assert_allclose(
        one_bounce(hits, reflectance, radiance), bounce_numpy(hits, reflectance, radiance), rtol=1e-5, atol=1e-7
    )


@pytest.mark.parametrize("num_bounces", [0, 1, 2, 5, 40])
def test_uniform_light_in_a_closed_room_is_a_geometric_series(num_bounces):
    """Each bounce is ρ times the one before, whatever the gather hits: L (1 − ρⁿ⁺¹) / (1 − ρ)."""
    hits = random_hits(300, 64, seed=3, lost=0)
    rho = np.array([0.2, 0.5, 0.8], np.float32)
    direct = np.tile(np.array([1.0, 2.0, 3.0], np.float32), (300, 1))
    actual = bounces(hits, np.tile(rho, (300, 1)), direct, num_bounces)
    np.testing.assert_allclose(actual, direct * (1 - rho ** (num_bounces + 1)) / (1 - rho), rtol=2e-5)


@pytest.mark.parametrize("num_bounces", [0, 3, 6, 7, 24])
def test_preview_bounces_converge_to_the_dominant_distribution(num_bounces):
    hits = random_hits(400, 64, seed=8, lost=0.1)
    reflectance, direct = np.random.default_rng(9).random((2, 400, 3), np.float32)
    actual = preview_bounces(hits, hits, 0.8 * reflectance, direct, num_bounces)
    expected = bounces(hits, 0.8 * reflectance, direct, num_bounces)
    assert np.linalg.norm(actual - expected) <= 1e-3 * np.linalg.norm(expected)
    if num_bounces <= 6:
        np.testing.assert_array_equal(actual, expected)
    assert not preview_bounces(hits, hits, reflectance, 0 * direct, num_bounces).any()


def test_black_patches_and_escaped_rays_give_nothing():
    hits = random_hits(50, 16, seed=4, lost=1.0)
    ones = np.ones((50, 3), np.float32)
    assert not one_bounce(hits, ones, ones).any()
    assert not one_bounce(random_hits(50, 16, seed=4), 0 * ones, ones).any()


def test_bounces_are_linear_in_the_light():
    hits, rng = random_hits(200, 32, seed=5), np.random.default_rng(6)
    reflectance, first, second = rng.random((3, 200, 3), np.float32)
    combined = bounces(hits, reflectance, 2 * first + 3 * second, 4)
    np.testing.assert_allclose(
        combined, 2 * bounces(hits, reflectance, first, 4) + 3 * bounces(hits, reflectance, second, 4), rtol=2e-5
    )


def test_irradiance_equals_numpy():
    lights = tessellate_environment(studio(), 100)
    rng = np.random.default_rng(7)
    normal = rng.normal(size=(333, 3))
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
    visible = rng.random((333, lights.num_lights)) < 0.5
    cosine = np.maximum(normal.astype(float) @ lights.direction.T, 0) * visible
    actual = irradiance(normal, np.packbits(visible, axis=1, bitorder="little"), lights)
    np.testing.assert_allclose(actual, cosine @ lights.irradiance, rtol=1e-5, atol=1e-6)


def test_irradiance_of_a_uniform_environment_is_pi():
    lights = tessellate_environment(np.ones((64, 128, 3), np.float32), 2000)
    up = np.array([[0, 1, 0]], np.float32)
    everything = np.full((1, (lights.num_lights + 7) // 8), 255, np.uint8)
    np.testing.assert_allclose(irradiance(up, everything, lights), np.pi, rtol=2e-3)
