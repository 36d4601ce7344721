"""Neighbors of lights on the sphere, against properties of triangulations of a sphere."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import studio

from relume.lights.neighbors import find_neighbors
from relume.lights.spherical_triangles import tessellate_environment


def sets_of(neighbors):
    return [
        set(neighbors_of_light.tolist()) for neighbors_of_light in np.split(neighbors.neighbors, neighbors.first[1:-1])
    ]


def random_directions(count):
    v = np.random.default_rng(3).normal(size=(count, 3))
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)


def test_neighbourhood_is_mutual_and_a_triangulation_of_the_sphere():
    directions = tessellate_environment(studio(), 300).direction
    neighbor_sets = sets_of(find_neighbors(directions))
    assert len(neighbor_sets) == len(directions)
    assert all(m not in near for m, near in enumerate(neighbor_sets))
    assert all(m in neighbor_sets[other] for m, near in enumerate(neighbor_sets) for other in near)
    assert (
        sum(map(len, neighbor_sets)) == 6 * len(directions) - 12
    )  # Euler: a triangulation of a sphere has 3n - 6 edges


def test_the_nearest_direction_is_a_neighbor():
    directions = random_directions(200)
    cosine = directions @ directions.T
    np.fill_diagonal(cosine, -1)
    neighbor_sets = sets_of(find_neighbors(directions))
    assert all(int(near) in neighbor_sets[m] for m, near in enumerate(cosine.argmax(axis=1)))


def test_equal_directions_are_neighbors():
    directions = random_directions(40)
    directions[17] = directions[4]
    neighbor_sets = sets_of(find_neighbors(directions))
    assert 4 in neighbor_sets[17]
    assert 17 in neighbor_sets[4]
    assert all(neighbor_sets)


@pytest.mark.parametrize("count", [0, 1, 2, 8])
def test_all_of_a_few_lights_are_neighbors(count):
    neighbor_sets = sets_of(find_neighbors(random_directions(count))) if count else []
    assert neighbor_sets == [set(range(count)) - {m} for m in range(count)]
    assert find_neighbors(random_directions(count)).first.tolist() == [max(0, count - 1) * m for m in range(count + 1)]
