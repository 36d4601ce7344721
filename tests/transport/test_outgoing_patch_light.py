"""Directional outgoing light of patches: reflectance matrices of materials, and the table of a patch."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest

from relume.brdf.albedo import PAIRS, material_reflectance, reflectance_matrix
from relume.brdf.evaluate import eval_brdf
from relume.math.direction_grid import SIDE, bin_solid_angles
from relume.math.zernike import OUTGOING_DEGREE, WINDOW_DECAY, basis_functions, recurrence
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.transport.outgoing_patch_light import NUM_OUTGOING, bin_means, decay_of, isotropic, radiance_from_patch

NUM_PAIRS = 200_000
PLAIN = {"color": [1.0, 0.5, 0.0], "texture": None, "curves": {}}


def by_cosine(u, v):
    """Cosine-distributed directions of points in the unit square. (num, 3)"""
    r, phi = np.sqrt(u), 2 * np.pi * v
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - r * r)], axis=-1)


def over_hemisphere(num, seed):
    """Random cosine-distributed directions. (num, 3)"""
    return by_cosine(*np.random.default_rng(seed).random((2, num)))


@pytest.fixture(scope="module")
def sides():
    """Incident and outgoing directions, and the functions of each as rows, which are read sequentially.

    Pairs are a Kronecker sequence of the root of x⁵ = x + 1: each replaces many random ones.
    """
    u = (np.arange(1, NUM_PAIRS + 1)[:, None] * 1.1673039782614187 ** -np.arange(1.0, 5)) % 1
    wi, wo = by_cosine(u[:, 0], u[:, 1]), by_cosine(u[:, 2], u[:, 3])
    return wi, wo, *(np.ascontiguousarray(basis_functions(w)[:, :NUM_OUTGOING].T) for w in (wi, wo))


@pytest.mark.parametrize(
    ("model", "params"),
    [("blinn_phong", {"exponent": 12.0}), ("ggx", {"roughness": 0.6, "f0": 0.8}), ("ward_anisotropic", {})],
)
def test_reflectance_matrices_are_double_integrals(model, params, sides):
    """F_jk by a mean over both directions, as accurate as a million random samples."""
    document = {**PLAIN, "model": model, "params": params}
    wi, wo, h_i, h_o = sides
    value = np.ascontiguousarray(np.pi**2 * eval_brdf(document, wi, wo)[:, 0])
    matrix, table = reflectance_matrix(document), recurrence(OUTGOING_DEGREE)
    for pair, (j, k) in enumerate(PAIRS):
        drawn = value * h_i[table.cosine[k]] * h_o[table.cosine[j]]
        if table.order[j]:  # equal for cosine and sine parts; their mean for anisotropic terms
            drawn = (drawn + value * h_i[table.sine[k]] * h_o[table.sine[j]]) / 2
        deviation = drawn.std() / np.sqrt(1_000_000)
        assert matrix[0, pair] == pytest.approx(drawn.mean(), abs=5 * deviation + 2e-3)
    np.testing.assert_allclose(matrix[1], matrix[0] / 2, rtol=1e-6)
    assert not matrix[2].any()


def test_a_table_equals_the_sum_of_its_functions():
    """For the directions of cosine rays, the sum is known without the table."""
    rng = np.random.default_rng(5)
    vectors = rng.normal(size=(3, 3, NUM_OUTGOING)).astype(np.float32) / np.arange(1, NUM_OUTGOING + 1)
    even = np.zeros((NO_PATCH + 1, 3), np.float32)
    even[:5] = 1 + rng.random((5, 3))
    frame = np.tile(np.eye(3, dtype=np.float32)[:2], (3, 1, 1))
    sent = radiance_from_patch(even, np.array([0, 2, 3]), frame, vectors.astype(np.float32))
    wo = over_hemisphere(4_000, 3)
    for row, patch in enumerate((0, 2, 3)):
        exact = even[patch] + basis_functions(wo)[:, :NUM_OUTGOING] @ vectors[row].T
        radiance = np.array([ref.evaluate_outgoing(sent, patch, w) for w in wo])
        assert np.linalg.norm(radiance - exact) < 0.12 * np.linalg.norm(exact - even[patch])
        assert np.abs(radiance.mean(axis=0) - exact.mean(axis=0)).max() < 0.01
    np.testing.assert_array_equal(ref.evaluate_outgoing(sent, 1, wo[0]), even[1])


def reflect_one_direction(roughness):
    """Outgoing light of metal for one direction, 50 directions of it, and its decay."""
    metal = {**PLAIN, "model": "ggx", "color": [1, 1, 1], "params": {"roughness": roughness, "f0": 0.9}}
    plain = np.ones((2, 50, 3), np.float32)
    made = ReflectanceOperator.from_materials((material_reflectance([metal]),), np.zeros(50, np.uint16), plain)
    vectors = np.repeat(basis_functions(over_hemisphere(50, 6))[:, None, :NUM_OUTGOING], 3, axis=1).astype(np.float32)
    of_patches, leaving = made.apply(IncidentLight(plain[0], vectors))
    even = np.zeros((NO_PATCH + 1, 3), np.float32)
    even[:50] = of_patches
    frame, falls = np.tile(np.eye(3, dtype=np.float32)[:2], (50, 1, 1)), decay_of(made.roughening)
    return radiance_from_patch(even, np.arange(50), frame, leaving, falls), falls


def test_narrow_lobes_suppress_ringing_of_metals():
    def lowest(sent, table):
        light = sent.isotropic[:50, None, 0] + sent.scale[:, :1] * table[..., 0]
        return light.min(axis=1) / light.max(axis=1)

    outgoing = {roughness: reflect_one_direction(roughness) for roughness in (0.01, 0.1, 0.3, 0.6)}
    for sent, _ in outgoing.values():
        assert np.all(lowest(sent, sent.smooth) > lowest(sent, sent.table))
    sharp, rough = outgoing[0.01][0], outgoing[0.3][0]
    assert np.median(lowest(sharp, sharp.table)) < np.median(lowest(rough, rough.table)) - 0.1
    assert np.median(lowest(sharp, sharp.smooth)) > np.median(lowest(rough, rough.smooth)) - 0.02
    np.testing.assert_allclose(
        outgoing[0.3][1], WINDOW_DECAY, rtol=0.04
    )  # from there on the highlight limits the decay
    np.testing.assert_allclose(outgoing[0.6][1], WINDOW_DECAY, rtol=1e-6)


def test_uniform_light_is_reflected_uniformly():
    radiance = np.zeros((NO_PATCH + 1, 3), np.float32)
    radiance[:4] = 3
    assert isotropic(radiance).table.shape[0] == 0
    assert ref.evaluate_outgoing(isotropic(radiance), 2, np.array([0.0, 0, 1])) == pytest.approx(3)
    assert bin_means()[0] == pytest.approx(1 / np.sqrt(np.pi), rel=1e-5)


def test_light_is_nowhere_negative_and_its_flux_remains():
    rng = np.random.default_rng(8)
    even = np.zeros((NO_PATCH + 1, 3), np.float32)
    even[:3] = rng.uniform(0.1, 1, (3, 3))
    frame = np.tile(np.eye(3, dtype=np.float32)[:2], (3, 1, 1))
    ringing = rng.normal(size=(3, 3, NUM_OUTGOING)).astype(np.float32)
    tables = [
        radiance_from_patch(even, np.arange(3), frame, ringing, np.zeros(3, np.float32), is_positive=is_positive)
        for is_positive in (False, True)
    ]
    plain, positive = (
        even[:3, None] + light.scale[:, None] * light.table.astype(np.float64) for light in tables
    )  # (patches, bins, 3)
    assert plain.min() < -0.1
    assert positive.min() > -tables[1].scale.max()  # a step of the table
    areas = bin_solid_angles()
    flux = np.maximum(np.einsum("pbc,b->pc", plain, areas), 0)
    np.testing.assert_allclose(np.einsum("pbc,b->pc", positive, areas), flux, atol=2e-3 * flux.max())


@pytest.mark.parametrize("is_positive", [False, True])
def test_tables_equal_numpy(is_positive):
    rng = np.random.default_rng(11)
    even, rows = np.zeros((NO_PATCH + 1, 3), np.float32), np.array([1, 4, 5, 9])
    even[:10] = rng.uniform(0, 1, (10, 3))
    coefficients = rng.normal(size=(4, 3, NUM_OUTGOING)).astype(np.float32)
    decay, extra = rng.uniform(0.001, 0.01, 4).astype(np.float32), rng.uniform(0, 2, (2, 3, SIDE * SIDE))
    light = radiance_from_patch(
        even, rows, np.zeros((4, 2, 3), np.float32), coefficients, decay, (np.array([1, 3]), extra.astype(np.float32)),
        is_positive=is_positive,
    )  # fmt: skip
    degree = np.repeat(np.arange(OUTGOING_DEGREE + 1), np.arange(OUTGOING_DEGREE + 1) + 1)
    window = np.exp(-np.outer(decay, degree * (degree + 2.0)))
    for table, factor in ((light.table, np.ones_like(window)), (light.smooth, window)):
        expected = np.einsum("gcj,gj,jb->gbc", coefficients, factor, bin_means())
        expected[[1, 3]] += extra.transpose(0, 2, 1)
        expected += even[rows, None]
        if is_positive:
            flux = np.maximum(np.einsum("b,gbc->gc", bin_solid_angles(), expected), 0)
            clipped = np.maximum(expected, 0)
            expected = clipped * (flux / np.einsum("b,gbc->gc", bin_solid_angles(), clipped))[:, None]
        radiance = even[rows, None] + light.scale[:, None] * table
        np.testing.assert_allclose(radiance, expected, atol=light.scale.max())
