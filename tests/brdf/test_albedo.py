"""Albedo of isotropic materials, against sums over uniform directions."""

import numpy as np
import pytest
from analytic_terms import ANALYTIC

from relume.brdf.albedo import (
    directional_albedo,
    material_reflectance,
    reflectance,
)
from relume.brdf.evaluate import eval_brdf
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import NormalMap

NUM, ERRORS = 100_000, 5  # directions; allowed standard errors of their sums, besides the quadrature error


def term_of(model, color=(1.0, 1.0, 1.0), **params):
    return complete_term(("test",), {"model": model, "color": list(color), "params": params}, None)


def albedo_by_sampling(term, theta_o):
    """Albedo by a sum over random uniform directions and azimuths, and its standard error. (3,) each"""
    rng = np.random.default_rng(7)
    z, phi = rng.random(NUM), 2 * np.pi * rng.random(NUM)
    wi = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=-1)
    turn = 2 * np.pi * rng.random(NUM)
    wo = np.stack([np.sin(theta_o) * np.cos(turn), np.sin(theta_o) * np.sin(turn), 0 * turn + np.cos(theta_o)], axis=-1)
    value = 2 * np.pi * eval_brdf(term, wi, wo) * z[:, None]
    return value.mean(axis=0), value.std(axis=0) / np.sqrt(NUM)


@pytest.mark.parametrize("model", ANALYTIC)
def test_the_albedo_is_the_integral_over_all_directions(model):
    term = term_of(model, color=(0.8, 0.3, 0.1))
    theta, albedo = directional_albedo([term])
    for k in (0, 4, 7):
        expected, error = albedo_by_sampling(term, theta[k])
        np.testing.assert_array_less(np.abs(albedo[k] - expected), ERRORS * error + 0.01 * expected)


def test_albedos_of_terms_add_up_and_average_to_the_reflectance():
    terms = [term_of("oren_nayar", (0.5, 0.4, 0.2)), term_of("ggx", roughness=0.3)]
    theta, albedo = directional_albedo(terms)
    alone = [directional_albedo([term])[1] for term in terms]
    np.testing.assert_allclose(albedo, alone[0] + alone[1], rtol=1e-6)
    assert np.all(np.diff(theta) > 0)
    cosine = np.cos(theta)
    mean = 2 * np.trapezoid(
        np.vstack([albedo[:1], albedo, albedo[-1:]]) * np.array([1, *cosine, 0])[:, None],
        -np.array([1, *cosine, 0]),
        axis=0,
    )
    np.testing.assert_allclose(mean, sum(reflectance(term) for term in terms), rtol=0.02)


def test_albedo_above_one_is_detected():
    assert directional_albedo([term_of("ggx", roughness=0.5, f0=1.0)])[1].max() <= 1.001
    assert directional_albedo([term_of("blinn_phong", exponent=50.0)])[1].max() > 2


@pytest.mark.parametrize("roughness", [0.03, 0.1, 0.6])  # a mirror, a sharp highlight, a broad one
def test_normal_mapping_changes_the_reflectance(roughness):
    """A normal-mapped mirror has no mirror reflectance; everything else is unchanged."""
    terms = [term_of("lambert", (0.5, 0.4, 0.2)), term_of("ggx", roughness=roughness, f0=0.9)]
    terms[0]["texture"] = "image:0123456789abcdef"
    normals = NormalMap("image:fedcba9876543210", 1.5)
    flat, normal_mapped = material_reflectance(terms), material_reflectance(terms, normals)
    assert (flat.normals, normal_mapped.normals) == (None, normals)
    assert normal_mapped not in (flat, material_reflectance(terms, normals._replace(scale=1.4)))
    assert normal_mapped.with_baked_normals() == flat.with_baked_normals() == flat
    assert normal_mapped.images == flat.images == (terms[0]["texture"], None)
    assert normal_mapped.lobes == flat.lobes
    np.testing.assert_array_equal(normal_mapped.matrix, flat.matrix)
    assert bool(flat.planar_mirrors) == (roughness < 0.06)
    assert normal_mapped.planar_mirrors == ()
