"""Bright lights in surfaces that lobe rays meet: closed forms, and sampled beams."""

import numpy as np
import pytest

from relume.brdf.lobe_sampling import lobe_of
from relume.live.free_camera.lobe_terms import fit_blur
from relume.live.free_camera.reflected_lights import add_reflected_lights, tabulated_density
from relume.transport.lobe_paths import NO_SURFACES, LobePaths, edge_curvature

GGX = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.2, "f0": 0.9}}
PHONG = {"model": "phong", "color": [1.0] * 3, "params": {"exponent": 3000.0}}
MODELS = pytest.mark.parametrize("document", [GGX, PHONG], ids=["half angle", "mirror angle"])
ONES = np.ones(3, np.float32)


def test_a_tabulated_density_is_that_of_the_curve():
    alpha, angle = 0.2**2, np.radians([0.3, 1.0, 2.3, 6.0, 20.0])
    cosine = np.cos(angle)
    expected = alpha**2 * cosine / (np.pi * (cosine**2 * (alpha**2 - 1) + 1) ** 2)
    quantile = lobe_of(GGX).quantile
    np.testing.assert_allclose([tabulated_density(quantile, 0, np.float32(a)) for a in angle], expected, rtol=0.03)
    assert tabulated_density(quantile, 0, np.float32(1.6)) == 0


def reflected(document, wo, directions, spread):
    """Light of a sun in each direction, of unit irradiance, by the lobe of a surface that faces +Z. (n,)"""
    lobe = lobe_of(document)
    surfaces = NO_SURFACES._replace(quantile=lobe.quantile, is_half_angle=np.array([lobe.is_half_angle]))
    paths = LobePaths.allocate(1, 1, 0)
    paths.lobe[0], paths.spread[0], paths.throughput[0] = 0, spread, 1
    paths.normal[0], paths.direction[0] = (0, 0, 1), wo
    lights, out = np.zeros((1, 7), np.float32), np.zeros((len(directions), 3), np.float32)
    for direction, light in zip(directions, out, strict=True):
        lights[0] = *direction, *ONES, 0
        add_reflected_lights(lights, ONES, surfaces, paths, 0, light)
    return out[:, 0]


@MODELS
@pytest.mark.parametrize("spread", [0.0, 0.05, 0.3])
def test_a_lobe_keeps_its_energy_however_wide_the_beam(document, spread):
    rng, wo = np.random.default_rng(3), np.array([0.3, 0, np.sqrt(1 - 0.3**2)])
    # directions by the density 1 / (1 + x²) of angles about the mirror direction
    reach, scale = np.radians(60), np.radians(4) + spread / 2
    top = np.arctan(reach / scale)
    angle, azimuth = scale * np.tan(top * rng.random(20_000)), 2 * np.pi * rng.random(20_000)
    density = 1 / (scale * top * (1 + (angle / scale) ** 2)) / (2 * np.pi * np.sin(angle))
    mirrored = np.array([-wo[0], 0, wo[2]])
    axes = np.stack([np.cross([0, 1, 0], mirrored), [0, 1, 0], mirrored])
    local = np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=1)
    assert np.mean(reflected(document, wo, local @ axes, spread) / density) == pytest.approx(1, abs=0.05)


@MODELS
def test_a_beam_sees_the_mean_over_its_directions(document):
    rng, spread = np.random.default_rng(4), 0.1
    wo, tilts = np.array([0, 0, 1.0]), rng.uniform(-0.25 * spread, 0.25 * spread, (2000, 2))
    # turning the normal by an angle turns the mirror direction by twice as much
    for offset in (0.0, 0.05):
        light = np.array([[np.sin(offset), 0, np.cos(offset)]])
        turned = np.column_stack([np.sin(offset + 2 * tilts[:, 0]), np.sin(2 * tilts[:, 1])])
        turned = np.column_stack([turned, np.sqrt(1 - np.square(turned).sum(axis=1))])
        expected = reflected(document, wo, turned, 0).mean()
        assert reflected(document, wo, light, spread)[0] == pytest.approx(expected, rel=0.5)


def test_curvature_is_that_of_a_sphere():
    corners = np.random.default_rng(5).normal(0, 1, (20, 3, 3))
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    corners = corners.astype(np.float32)
    np.testing.assert_allclose(edge_curvature(0.25 * corners, corners), 4, rtol=1e-4)
    assert edge_curvature(0 * corners, 0 * corners).max() == 0


@MODELS
def test_two_gaussians_blur_like_the_lobe(document):
    lobe, (narrow, wide, share) = lobe_of(document), fit_blur(lobe_of(document))
    angle = lobe.quantile[0] * (2 if lobe.is_half_angle else 1)
    fitted = sum(
        weight * (1 - np.exp(-0.5 * (angle / sigma) ** 2)) for sigma, weight in ((narrow, share), (wide, 1 - share))
    )
    assert narrow <= wide
    assert np.abs(fitted - np.linspace(0, 1, len(angle))).max() < 0.04
