"""Visibility of tiles that a bake does not have, beside that of the others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy_reference import unit
from tiny_scenes import still_life

from relume.core.errors import CancelledError
from relume.raytrace.new_tiles import NewTiles
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import trace_visibility

NUM_LIGHTS, NEW = 21, np.array([2, 9, 17, 18, 19, 20])  # more lights, and one byte more, than the 17 of the bake


def bits(visible):
    return np.unpackbits(visible, axis=1, count=NUM_LIGHTS, bitorder="little").astype(bool)


@pytest.fixture(scope="module")
def traced():
    """Scene, points, all directions, the bake's bits of the first 17, and the new tiles."""
    geometry, rng = build_scene_buffers(still_life()), np.random.default_rng(3)
    corners = geometry.positions[geometry.faces[rng.integers(len(geometry.faces), size=300)]]
    position, normal = corners.mean(axis=1), unit(rng.normal(size=(300, 3))).astype(np.float32)
    position += 1e-3 * normal
    points = SurfacePoints(position, normal, normal, np.arange(300, dtype=np.uint32))
    direction = unit(rng.normal(size=(NUM_LIGHTS, 3))).astype(np.float32)
    baked = trace_visibility(geometry.embree, position, normal, direction[:17]).visible
    return geometry.embree, points, direction, baked, NewTiles("key", NUM_LIGHTS, NEW, direction[NEW])


def test_new_tiles_are_traced_and_others_keep_their_bits(traced):
    scene, points, direction, baked, new = traced
    noisy = baked ^ np.packbits(np.isin(np.arange(24), NEW), bitorder="little")  # bits of replaced tiles do not matter
    visible = bits(new.insert(new.trace(scene, points, lambda: False), noisy))
    expected = bits(trace_visibility(scene, points.position, points.normal, direction).visible)
    np.testing.assert_array_equal(visible, expected)
    assert 0.05 < expected[:, NEW].mean() < 0.45  # half are below the horizon, and some occluded


def test_without_occluders_all_above_the_horizon_are_visible(traced):
    _, points, direction, _, new = traced
    above = points.normal @ direction.T > 0
    baked = np.packbits(above[:, :17], axis=1, bitorder="little")
    np.testing.assert_array_equal(bits(new.insert(new.unoccluded(points), baked)), above)


def test_tracing_can_be_canceled(traced):
    scene, points, _, _, new = traced
    with pytest.raises(CancelledError, match="canceled"):
        new.trace(scene, points, lambda: True)
