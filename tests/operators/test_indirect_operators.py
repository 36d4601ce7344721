"""Transport rows against the projector, whose image of the same light is exact, and their kernels against NumPy."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import numpy_reference as ref
import pytest
from analytic_terms import ANALYTIC
from scipy.sparse import csr_array

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.core.errors import CancelledError
from relume.lights.spherical_triangles import tessellate_environment
from relume.math.haar import haar
from relume.operators import indirect as rows_module
from relume.operators.indirect import expected_light, num_channels, precompute_rows, row_bytes
from relume.operators.indirect_kernel import select_coefficients, transform
from relume.operators.linear_operator import tile_layout
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import make_pattern
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.projector import Projector
from relume.transport.shading_points import GatherRays, ShadingPoints
from relume.transport.term_contraction import contract

NUM_PATCHES, NUM_POINTS, NUM_RAYS = 90, 150, 33
NONE = tessellate_environment(np.ones((8, 16, 3), np.float32), 40).empty()


@pytest.fixture(scope="module")
def receivers():
    """Points that hit neighboring patches, so that their rows are smooth; a tenth of the rays hits nothing."""
    rng = np.random.default_rng(5)
    dark = ref.make_random_receivers(NUM_POINTS, 8, seed=6)
    center = np.linspace(0, NUM_PATCHES, NUM_POINTS)[:, None]
    hits = np.clip(center + 12 * rng.normal(size=(NUM_POINTS, NUM_RAYS)), 0, NUM_PATCHES - 1).astype(np.uint16)
    hits[rng.random(hits.shape) < 0.1] = NO_PATCH
    rays = GatherRays(hits, make_pattern(NUM_RAYS, 0, 7), isotropic(light(1)))
    return ShadingPoints(dark.points, dark.wo, np.empty((NUM_POINTS, 0), np.uint8), (rays,))


def light(seed):
    """Radiance of patches: smooth with one step."""
    at = np.arange(NUM_PATCHES)[:, None] / NUM_PATCHES
    phase = np.random.default_rng(seed).random((2, 3))
    radiance = np.zeros((NO_PATCH + 1, 3), np.float32)
    radiance[:NUM_PATCHES] = 2 + np.sin(6 * (at + phase[0])) + (at > phase[1])
    return radiance


def bands_of(term, **params):
    document = {"model": term.model, "params": params}
    return {curve.name: curve_bands(document, curve) for curve in term.curves}


def exact_image(term, bands, receivers, radiance):
    lit = replace(receivers, rays=(replace(receivers.rays[0], outgoing=isotropic(radiance)),))
    return Projector(term, contract(term, bands, None), NONE, lit).project(0, NUM_POINTS)[:, 0]


def image_by_rows(term, bands, receivers, radiance):
    tiles, samples = tile_layout(NUM_POINTS)
    image = np.ones((tiles, 3, samples), np.float32)
    rows = freeze(term, bands, receivers)
    rows.add(haar(radiance[:NUM_PATCHES]).astype(np.float32), image)
    assert rows.num_bytes == row_bytes(NUM_POINTS, num_channels(term, bands))
    return image.transpose(0, 2, 1).reshape(-1, 3)[:NUM_POINTS] - 1


def test_rows_are_filtered_like_rays(receivers):
    """Samples contribute to each other's image with the weights of the exact image."""
    rng = np.random.default_rng(8)
    weights = csr_array(rng.random((NUM_POINTS,) * 2) * (rng.random((NUM_POINTS,) * 2) < 0.02) + np.eye(NUM_POINTS))
    (rays,) = receivers.rays
    weights = csr_array(weights / weights.sum(axis=1)[:, None]).astype(np.float32)
    sharing = SimpleNamespace(weights=lambda term, start, stop: weights[start:stop])
    shared = replace(receivers, rays=(replace(rays, sharing=sharing),))
    term, bands = TERMS["lambert"], bands_of(TERMS["lambert"])
    expected = weights.toarray() @ image_by_rows(term, bands, receivers, light(1))
    np.testing.assert_allclose(image_by_rows(term, bands, shared, light(1)), expected, rtol=1e-4, atol=1e-4)


def freeze(term, bands, receivers, is_canceled=lambda: False):
    expected = expected_light(light(1)[:NUM_PATCHES])
    return precompute_rows(term, bands, receivers, receivers.rays[0], expected, lambda fraction: None, is_canceled)


@pytest.mark.parametrize("model", list(ANALYTIC))
def test_complete_rows_equal_the_projector(model, receivers):
    """With all coefficients only the rounding to 16 bits remains."""
    term = TERMS[model]
    bands = bands_of(term)
    expected = exact_image(term, bands, receivers, light(2))
    image = image_by_rows(term, bands, receivers, light(2))
    np.testing.assert_allclose(image, expected, rtol=2e-3, atol=3e-4 * np.abs(expected).max())


def test_channels_may_differ(receivers):
    term = TERMS["blinn_phong"]
    bands = bands_of(term, exponent=[5.0, 20.0, 80.0])
    assert (num_channels(term, bands), num_channels(term, bands_of(term))) == (3, 1)
    expected = exact_image(term, bands, receivers, light(2))
    assert np.ptp(expected, axis=1).max() > 0.1
    np.testing.assert_allclose(image_by_rows(term, bands, receivers, light(2)), expected, rtol=2e-3, atol=2e-3)


def test_the_error_falls_with_the_number_of_coefficients(receivers, monkeypatch):
    term = TERMS["lambert"]
    expected, errors = exact_image(term, bands_of(term), receivers, light(2)), []
    for num_coefficients in (4, 16, 64):
        monkeypatch.setattr(rows_module, "NUM_COEFFICIENTS", num_coefficients)
        errors.append(np.linalg.norm(image_by_rows(term, bands_of(term), receivers, light(2)) - expected))
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[1] < 0.03 * np.linalg.norm(expected)


def test_black_light_gives_black_and_can_be_the_expected_light(receivers):
    black = np.zeros((NO_PATCH + 1, 3), np.float32)
    term = TERMS["lambert"]
    assert not image_by_rows(term, bands_of(term), receivers, black).any()
    assert np.all(expected_light(black[:NUM_PATCHES]) > 0)


def test_points_without_hits_have_empty_rows(receivers):
    lost = replace(receivers.rays[0], gather_hits=np.full_like(receivers.rays[0].gather_hits, NO_PATCH))
    term = TERMS["lambert"]
    assert not image_by_rows(term, bands_of(term), replace(receivers, rays=(lost,)), light(2)).any()


def test_freezing_may_be_cancelled(receivers):
    term = TERMS["lambert"]
    with pytest.raises(CancelledError):
        freeze(term, bands_of(term), receivers, lambda: True)


def test_ties_never_displace_better_coefficients():
    """The mean comes last; it was lost if several stored coefficients were equally small."""
    details = np.ones((9, 4), np.float32)
    details[-1] = 100
    index = np.arange(8, -1, -1, dtype=np.int32)
    indices, scale, weights = np.empty(3, np.int32), np.empty(3, np.float32), np.empty((3, 4), np.int16)
    select_coefficients(index, details, np.ones(16, np.float32), indices, scale, weights)
    assert indices.tolist() == [0, 1, 2]
    np.testing.assert_allclose(scale[:, None] * weights, [[100] * 4, [1] * 4, [1] * 4], rtol=1e-4)


@pytest.mark.parametrize("num_patches", [1, 2, 13, 64])
def test_the_transform_of_few_patches_equals_that_of_all(num_patches):
    rng = np.random.default_rng(num_patches)
    patches = np.sort(rng.choice(64, num_patches, replace=False)).astype(np.int32)
    sums = rng.random((num_patches, 5), np.float32)
    whole = np.zeros((64, 5))
    whole[patches] = sums
    index, details = np.empty(65, np.int32), np.empty((65, 5), np.float32)
    num = transform(patches.copy(), sums.copy(), 6, index, details)
    actual = np.zeros((64, 5))
    actual[index[:num]] = details[:num]
    assert len(set(index[:num])) == num
    np.testing.assert_allclose(actual, haar(whole), atol=1e-6)
