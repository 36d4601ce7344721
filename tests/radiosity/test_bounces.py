"""Reflected light against plain NumPy, and against rooms whose light is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import studio

from relume.lights.spherical_triangles import tessellate_environment
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.bounce import bounces, irradiance, one_bounce, preview_bounces


def some_links(num_cells, num_rays, seed, lost=0.2):
    rng = np.random.default_rng(seed)
    links = rng.integers(0, num_cells, (num_cells, num_rays)).astype(np.uint16)
    links[rng.random(links.shape) < lost] = NO_PATCH
    return links


def bounce_numpy(links, reflectance, radiance):
    incident = np.concatenate([radiance, np.zeros((NO_PATCH + 1 - len(radiance), 3))])[links]
    return reflectance * incident.mean(axis=1)


def test_bounce_is_its_twin():
    links = some_links(700, 33, seed=1)
    reflectance, radiance = np.random.default_rng(2).random((2, 700, 3), np.float32)
    np.testing.assert_allclose(
        one_bounce(links, reflectance, radiance), bounce_numpy(links, reflectance, radiance), rtol=1e-5, atol=1e-7
    )


@pytest.mark.parametrize("num_bounces", [0, 1, 2, 5, 40])
def test_even_light_in_a_closed_room_grows_as_a_geometric_series(num_bounces):
    """Each bounce gives ρ times the one before, whatever the links: L (1 − ρⁿ⁺¹) / (1 − ρ)."""
    links = some_links(300, 64, seed=3, lost=0)
    rho = np.array([0.2, 0.5, 0.8], np.float32)
    direct = np.tile(np.array([1.0, 2.0, 3.0], np.float32), (300, 1))
    actual = bounces(links, np.tile(rho, (300, 1)), direct, num_bounces)
    np.testing.assert_allclose(actual, direct * (1 - rho ** (num_bounces + 1)) / (1 - rho), rtol=2e-5)


@pytest.mark.parametrize("num_bounces", [0, 3, 6, 7, 24])
def test_rough_bounces_are_those_that_settle_into_a_shape(num_bounces):
    links = some_links(400, 64, seed=8, lost=0.1)
    reflectance, direct = np.random.default_rng(9).random((2, 400, 3), np.float32)
    actual = preview_bounces(links, links, 0.8 * reflectance, direct, num_bounces)
    expected = bounces(links, 0.8 * reflectance, direct, num_bounces)
    assert np.linalg.norm(actual - expected) <= 1e-3 * np.linalg.norm(expected)
    if num_bounces <= 6:
        np.testing.assert_array_equal(actual, expected)
    assert not preview_bounces(links, links, reflectance, 0 * direct, num_bounces).any()


def test_what_is_black_reflects_nothing_and_what_is_lost_gives_nothing():
    links = some_links(50, 16, seed=4, lost=1.0)
    ones = np.ones((50, 3), np.float32)
    assert not one_bounce(links, ones, ones).any()
    assert not one_bounce(some_links(50, 16, seed=4), 0 * ones, ones).any()


def test_bounces_are_linear_in_the_light():
    links, rng = some_links(200, 32, seed=5), np.random.default_rng(6)
    reflectance, first, second = rng.random((3, 200, 3), np.float32)
    combined = bounces(links, reflectance, 2 * first + 3 * second, 4)
    np.testing.assert_allclose(
        combined, 2 * bounces(links, reflectance, first, 4) + 3 * bounces(links, reflectance, second, 4), rtol=2e-5
    )


def test_irradiance_is_its_twin():
    lights = tessellate_environment(studio(), 100)
    rng = np.random.default_rng(7)
    normal = rng.normal(size=(333, 3))
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
    visible = rng.random((333, lights.num_lights)) < 0.5
    cosine = np.maximum(normal.astype(float) @ lights.direction.T, 0) * visible
    actual = irradiance(normal, np.packbits(visible, axis=1, bitorder="little"), lights)
    np.testing.assert_allclose(actual, cosine @ lights.irradiance, rtol=1e-5, atol=1e-6)


def test_open_sky_of_one_radiance_gives_pi():
    lights = tessellate_environment(np.ones((64, 128, 3), np.float32), 2000)
    up = np.array([[0, 1, 0]], np.float32)
    everything = np.full((1, (lights.num_lights + 7) // 8), 255, np.uint8)
    np.testing.assert_allclose(irradiance(up, everything, lights), np.pi, rtol=2e-3)
