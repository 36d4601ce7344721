"""Filtering of gathered light between neighbors: which samples are neighbors, and the filtered projection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from analytic_terms import ANALYTIC
from scipy.sparse import csr_array

from relume.brdf.registry import TERMS
from relume.lights.spherical_triangles import tessellate_environment
from relume.patches.neighbor_filter import FilterWeights, NeighborFilter
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE, SurfacePoints
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.projector import Projector
from relume.transport.shading_points import GatherRays
from relume.transport.term_contraction import contract
from relume.views.gather_filter import make_neighbor_filter

WIDTH, HEIGHT = 9, 7


def grid(keep=None):
    """Samples of a floor, one per pixel, in shuffled order."""
    pixel = np.random.default_rng(1).permutation(WIDTH * HEIGHT).astype(np.uint32)
    pixel = pixel if keep is None else pixel[keep(pixel)]
    position = np.stack([pixel % WIDTH, 0 * pixel, pixel // WIDTH], axis=1).astype(np.float32)
    return pixel, position, np.tile(np.array([0, 1, 0], np.float32), (len(pixel), 1))


def filter_of(pixel, position, normal, chance=FIXED_ALPHA_SAMPLE, **options):
    points = SurfacePoints(position, normal, np.zeros_like(normal), pixel, chance)
    return make_neighbor_filter(pixel, WIDTH, points, **options)


def brute_force_weights(pixel, is_same):
    """Every pair of samples, one after another."""
    weights = np.zeros((len(pixel), len(pixel)))
    for a, pa in enumerate(pixel.astype(int)):
        for b, pb in enumerate(pixel.astype(int)):
            dx, dy = abs(pa % WIDTH - pb % WIDTH), abs(pa // WIDTH - pb // WIDTH)
            if a == b or (max(dx, dy) <= 1 and is_same(a, b)):
                weights[a, b] = (2 - dx) * (2 - dy) / np.count_nonzero(pixel == pb)
    return weights / weights.sum(axis=1, keepdims=True)


def test_neighbors_have_tent_weights_normalized_at_image_borders():
    pixel, position, normal = grid()
    matrix = filter_of(pixel, position, normal).diffuse.matrix
    np.testing.assert_allclose(matrix.toarray(), brute_force_weights(pixel, lambda a, b: True), rtol=1e-6)
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=1e-6)


def test_samples_of_one_pixel_are_averaged():
    pixel, position, normal = (np.concatenate([a, a[:20]]) for a in grid())
    matrix = filter_of(pixel, position, normal).diffuse.matrix
    np.testing.assert_allclose(matrix.toarray(), brute_force_weights(pixel, lambda a, b: True), rtol=1e-6)


def test_separate_surfaces_are_not_neighbors():
    """A wall that meets the floor, and a step in it."""
    pixel, position, normal = grid()
    x, y = pixel % WIDTH, pixel // WIDTH
    normal[x > 4] = [1, 0, 0]
    position[(x <= 4) & (y > 3), 1] += 0.5
    matrix = filter_of(pixel, position, normal).diffuse.matrix.toarray()
    piece = np.where(x > 4, 2, np.where(y > 3, 1, 0))
    flat = piece != 2  # depth along the wall is height
    assert not matrix[piece[:, None] != piece[None, :]].any()
    expected = brute_force_weights(pixel, lambda a, b: piece[a] == piece[b])
    np.testing.assert_allclose(matrix[np.ix_(flat, flat)], expected[np.ix_(flat, flat)], rtol=1e-6)


def test_samples_of_different_channels_are_not_neighbors():
    pixel, position, normal = (np.concatenate([a, a]) for a in grid())
    chance = np.repeat(np.array([-3, -4], np.float32), len(pixel) // 2)
    matrix = filter_of(pixel, position, normal, chance).diffuse.matrix.toarray()
    assert not matrix[chance[:, None] != chance].any()
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=1e-6)


def test_highlights_are_filtered_between_similar_orientations():
    """Every second column of a floor is rotated, first slightly, then more; diffuse light ignores the rotation."""
    pixel, position, normal = grid()
    is_turned = pixel % WIDTH % 2

    def both(degrees):
        angle = np.radians(degrees) * is_turned
        normal[:, 0], normal[:, 1] = np.sin(angle), np.cos(angle)
        weights = filter_of(pixel, position, normal)
        return weights.diffuse.matrix.toarray(), weights.highlights.matrix.toarray()

    all_alike = brute_force_weights(pixel, lambda a, b: True)
    for matrix in (*both(2.0), both(5.0)[0]):
        np.testing.assert_allclose(matrix, all_alike, rtol=1e-6)
    np.testing.assert_allclose(
        both(5.0)[1], brute_force_weights(pixel, lambda a, b: is_turned[a] == is_turned[b]), rtol=1e-6
    )


def test_diffuse_light_has_several_tent_passes_and_highlights_one():
    pixel, position, normal = grid(lambda pixel: pixel % 5 > 0)
    weights = filter_of(pixel, position, normal, num_passes=3)
    assert (weights.diffuse.num_passes, weights.highlights.num_passes) == (3, 1)
    rings, among = weights.diffuse.find_dependencies(4, 11)
    values = np.random.default_rng(9).random((len(pixel), 3))
    once = brute_force_weights(pixel, lambda a, b: True)
    shared = values[among]
    for within in reversed(rings):
        shared = within @ shared
    np.testing.assert_allclose(shared, (once @ once @ once @ values)[4:11], rtol=1e-5)


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("model", ["lambert", "cook_torrance"])
@pytest.mark.parametrize("is_active", [False, True])
def test_projected_points_are_weighted_means_of_single_points(model, is_active, times):
    """Free and contracted curves, in ranges of any length; environment light is not filtered."""
    rng, num = np.random.default_rng(2), 70
    lights = tessellate_environment(rng.random((16, 32, 3), np.float32), 40)
    points = ref.make_random_receivers(num, lights.num_lights, seed=3)
    hits = rng.integers(0, 50, (num, 24)).astype(np.uint16)
    radiance = rng.random((1 << 16, 3), np.float32)
    alone = GatherRays(hits, make_pattern(16, 8, 5), isotropic(radiance))
    weights = csr_array(rng.random((num, num)) * (rng.random((num, num)) < 0.1) + np.eye(num)).astype(np.float32)
    term = TERMS[model]
    curve = next(c for c in ANALYTIC[model].curves if not c.depends_on_view)
    bands = {c.name: rng.random((3, c.num_bands)) for c in term.curves}
    contraction = contract(term, bands, curve.name if is_active else None)

    def project(rays, ranges):
        projector = Projector(term, contraction, lights, replace(points, rays=rays))
        return np.concatenate([projector.project(*rows) for rows in ranges])

    dark = project((), [(0, num)])
    separate = project((alone,), [(0, num)]) - dark
    nobody = FilterWeights(csr_array((num, num), dtype=np.float32), 1)
    of_term = FilterWeights(csr_array(weights / weights.sum(axis=1)[:, None]), times)
    neighbor_filter = NeighborFilter(of_term, nobody) if model == "lambert" else NeighborFilter(nobody, of_term)
    shared = project((replace(alone, sharing=neighbor_filter),), [(0, 50), (50, num)]) - dark
    expected = np.einsum("pq,qjc->pjc", np.linalg.matrix_power(of_term.matrix.toarray(), times), separate)
    np.testing.assert_allclose(shared, expected, rtol=2e-4, atol=2e-5 * np.abs(expected).max())


def test_a_filter_within_some_samples_ignores_all_others():
    pixel, position, normal = grid()
    weights = filter_of(pixel, position, normal).highlights
    is_member = np.random.default_rng(2).random(len(pixel)) < 0.6
    expected = weights.matrix.toarray() * is_member * is_member[:, None]
    expected[is_member] /= expected[is_member].sum(axis=1, keepdims=True)
    np.testing.assert_allclose(weights.within(is_member).matrix.toarray(), expected, rtol=1e-5)
