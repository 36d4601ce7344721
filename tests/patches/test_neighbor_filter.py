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
from relume.patches.hit_distance import mean_inverse_distance
from relume.patches.neighbor_filter import NeighborFilter
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE, SurfacePoints
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.projector import Projector
from relume.transport.shading_points import GatherRays
from relume.transport.term_contraction import contract

WIDTH, HEIGHT = 9, 7


def grid(keep=None):
    """Samples of a floor, one per pixel, in shuffled order."""
    pixel = np.random.default_rng(1).permutation(WIDTH * HEIGHT).astype(np.uint32)
    pixel = pixel if keep is None else pixel[keep(pixel)]
    position = np.stack([pixel % WIDTH, 0 * pixel, pixel // WIDTH], axis=1).astype(np.float32)
    return pixel, position, np.tile(np.array([0, 1, 0], np.float32), (len(pixel), 1))


def filter_of(pixel, position, normal, inverse_distance=None, chance=FIXED_ALPHA_SAMPLE):
    points = SurfacePoints(position, normal, np.zeros_like(normal), pixel, chance)
    inverse_distance = np.zeros(len(pixel), np.float32) if inverse_distance is None else inverse_distance
    return NeighborFilter.of_samples(pixel, WIDTH, points, inverse_distance)


def diffuse_weights(*of_samples, **options):
    return all_weights(filter_of(*of_samples, **options), "lambert")


def all_weights(neighbor_filter, model):
    return neighbor_filter.weights(TERMS[model], 0, len(neighbor_filter.pixel)).toarray()


class SharedByMatrix(NeighborFilter):
    """Any weights, for terms of one kind."""

    def __init__(self, matrix, model):
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "model", model)

    def weights_and_neighbors(self, term, start, stop):
        assert term.model == self.model
        return self.matrix[start:stop], np.arange(self.matrix.shape[1])


def brute_force_weights(pixel, closeness):
    """Every pair of samples, one after another. closeness: 1 - change / largest change of samples a and b"""
    weights = np.zeros((len(pixel), len(pixel)))
    for a, pa in enumerate(pixel.astype(int)):
        for b, pb in enumerate(pixel.astype(int)):
            dx, dy = abs(pa % WIDTH - pb % WIDTH), abs(pa // WIDTH - pb // WIDTH)
            if max(dx, dy) <= 2:
                tent = (3 - dx) * (3 - dy) / np.count_nonzero(pixel == pb)
                weights[a, b] = tent * (1 if a == b else max(closeness(a, b), 0))
    return weights / weights.sum(axis=1, keepdims=True)


def test_neighbors_have_tent_weights_normalized_at_image_borders():
    pixel, position, normal = grid()
    matrix = diffuse_weights(pixel, position, normal)
    np.testing.assert_allclose(matrix, brute_force_weights(pixel, lambda a, b: 1), rtol=1e-6)
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=1e-6)


def test_samples_of_one_pixel_are_averaged():
    pixel, position, normal = (np.concatenate([a, a[:20]]) for a in grid())
    matrix = diffuse_weights(pixel, position, normal)
    np.testing.assert_allclose(matrix, brute_force_weights(pixel, lambda a, b: 1), rtol=1e-6)


def test_separate_surfaces_are_not_neighbors():
    """A wall that meets the floor, and a step in it."""
    pixel, position, normal = grid()
    x, y = pixel % WIDTH, pixel // WIDTH
    normal[x > 4] = [1, 0, 0]
    position[(x <= 4) & (y > 3), 1] += 1.0
    matrix = diffuse_weights(pixel, position, normal)
    piece = np.where(x > 4, 2, np.where(y > 3, 1, 0))
    flat = piece != 2  # depth along the wall is height
    assert not matrix[piece[:, None] != piece[None, :]].any()
    expected = brute_force_weights(pixel, lambda a, b: piece[a] == piece[b])
    np.testing.assert_allclose(matrix[np.ix_(flat, flat)], expected[np.ix_(flat, flat)], rtol=1e-6)


def test_samples_of_different_channels_are_not_neighbors():
    pixel, position, normal = (np.concatenate([a, a]) for a in grid())
    chance = np.repeat(np.array([-3, -4], np.float32), len(pixel) // 2)
    matrix = diffuse_weights(pixel, position, normal, chance=chance)
    assert not matrix[chance[:, None] != chance].any()
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=1e-6)


def test_weights_fall_with_distance_and_turn_as_light_may_change():
    """Rows of the floor turn by up to 4°; surfaces come near at one side. Highlights change four times as fast."""
    pixel, position, normal = grid()
    angle = np.radians(pixel // WIDTH % 3 * 2.0)
    normal[:, 0], normal[:, 1] = np.sin(angle), np.cos(angle)
    inverse_distance = np.asarray(0.002 * (1 + pixel % WIDTH), np.float32)

    def closeness(a, b, turn):
        near = max(inverse_distance[a], inverse_distance[b])
        change = near * np.linalg.norm(position[a] - position[b]) + turn * np.linalg.norm(normal[a] - normal[b])
        return 1 - change / 0.2

    weights = filter_of(pixel, position, normal, inverse_distance)
    for model, turn in (("lambert", 1), ("ggx", 4)):
        expected = brute_force_weights(pixel, lambda a, b, turn=turn: closeness(a, b, turn))
        assert 0.01 < np.mean(expected == 0) < 0.9
        np.testing.assert_allclose(all_weights(weights, model), expected, atol=2e-5)


def test_distances_are_harmonic_means_over_the_rays_that_meet_patches():
    rng = np.random.default_rng(4)
    position, patch_position = rng.random((6, 3), np.float32), rng.random((9, 4, 3), np.float32)
    hits = rng.integers(0, 9, (6, 24)).astype(np.uint16)
    hits[rng.random(hits.shape) < 0.3] = NO_PATCH
    hits[0] = NO_PATCH
    used = hits[:, ::4]
    distance = np.linalg.norm(patch_position.mean(axis=1)[used % 9] - position[:, None], axis=2)
    expected = np.where(used == NO_PATCH, 0, 1 / distance).mean(axis=1)
    np.testing.assert_allclose(mean_inverse_distance(position, hits, patch_position), expected, rtol=1e-5)


@pytest.mark.parametrize("model", ["lambert", "cook_torrance"])
@pytest.mark.parametrize("is_active", [False, True])
def test_projected_points_are_weighted_means_of_single_points(model, is_active):
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
    of_term = csr_array(weights / weights.sum(axis=1)[:, None])
    neighbor_filter = SharedByMatrix(of_term, model)
    shared = project((replace(alone, sharing=neighbor_filter),), [(0, 50), (50, num)]) - dark
    expected = np.einsum("pq,qjc->pjc", of_term.toarray(), separate)
    np.testing.assert_allclose(shared, expected, rtol=2e-4, atol=2e-5 * np.abs(expected).max())


def test_highlights_are_shared_among_some_samples_alone():
    pixel, position, normal = grid()
    weights = filter_of(pixel, position, normal)
    is_member = np.random.default_rng(2).random(len(pixel)) < 0.6
    expected = all_weights(weights, "ggx") * is_member * is_member[:, None]
    expected[is_member] /= expected[is_member].sum(axis=1, keepdims=True)
    some = weights.among_highlights(is_member)
    np.testing.assert_allclose(all_weights(some, "ggx"), expected, rtol=1e-5)
    np.testing.assert_array_equal(all_weights(some, "lambert"), all_weights(weights, "lambert"))


def test_weights_of_a_range_are_those_of_its_neighbors():
    pixel, position, normal = (np.concatenate([a, a[:9]]) for a in grid())
    weights = filter_of(pixel, position, normal)
    rows, neighbors = weights.weights_and_neighbors(TERMS["lambert"], 11, 30)
    expected = all_weights(weights, "lambert")[11:30]
    np.testing.assert_array_equal(neighbors, np.flatnonzero(expected.any(axis=0)))
    np.testing.assert_array_equal(rows.toarray(), expected[:, neighbors])
