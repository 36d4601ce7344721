"""Tracing of lobe rays: what each meets is what a single ray meets, and polished surfaces pass it on."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.brdf.lobe_sampling import sample_lobe
from relume.brdf.roughness_levels import NO_LEVELS
from relume.brdf.term_validation import complete_term
from relume.patches.patch_kdtree import NO_PATCH, NO_PATCH_NODE, PatchTree
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.lobe_directions import lobe_shift, make_lobe_pattern
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Material
from relume.transport.lobe_hits import NO_FOOTPRINT, LobeHits, lobe_ray_in_pixel, trace_lobe_rays
from relume.transport.lobe_paths import END, ESCAPE, NO_SURFACES, REFLECTION, LobeSurfaces
from relume.transport.patch_lookup import PatchLookup

NUM = 200
CHROME = complete_term(("terms", 0), {"model": "ggx", "params": {"roughness": 0.1, "f0": 1.0}}, None)


@pytest.fixture(scope="module")
def geometry():
    """A floor of patch 5 below a ceiling of patch 9 that covers half of it; each mesh has one patch on each side."""
    materials = (Material("A", ({"model": "lambert"},)), Material("B", ({"model": "lambert"},)))
    scene = make_tiny_scene(
        quad("floor", [[-5, 0, 5], [5, 0, 5], [5, 0, -5], [-5, 0, -5]], 0),
        quad("ceiling", [[0, 1, 5], [5, 1, 5], [5, 1, -5], [0, 1, -5]], 1),
        camera=make_camera("front", [0, 4, 0.01], [0, 0, 0], 0.1),
        environment=np.ones((8, 16, 3), "f"),
        materials=materials,
    )
    return build_scene_buffers(scene)


@pytest.fixture(scope="module")
def lookup(geometry):
    leaves = np.array([-1 - 5, -1 - 5, -1 - 9, -1 - 9], np.int32)
    tree = PatchTree(np.zeros(1, np.uint8), np.zeros(1, np.float32), np.full((1, 2), NO_PATCH_NODE, np.int32), leaves)
    sides = (2 * geometry.face_mesh).astype(np.int32)
    return PatchLookup(tree, geometry.face_normals, sides, np.zeros(NO_PATCH + 1, np.float32))


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(1)
    position = np.column_stack([rng.uniform(-4, 4, NUM), np.full(NUM, 1e-4), rng.uniform(-4, 4, NUM)])
    normal = np.tile(np.float32([0, 1, 0]), (NUM, 1))
    seed = np.arange(NUM, dtype=np.uint32)
    wo = rng.normal(size=(NUM, 3)) * [1, 0, 1] + [0, 1.5, 0]
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    return SurfacePoints(position.astype(np.float32), normal, any_tangent(normal), seed), wo.astype(np.float32)


def directions(pattern, points, wo):
    rays = [
        lobe_ray_in_pixel(
            pattern, 0, ray, lobe_shift(pattern, points.seed[p]), points.normal[p], points.tangent[p], wo[p],
            NO_FOOTPRINT[0], points.seed[p],
        )[0]
        for p in range(NUM)
        for ray in range(pattern.num_rays)
    ]  # fmt: skip
    return np.array(rays, np.float32)


def escapes(hits: LobeHits) -> np.ndarray:
    return np.unpackbits(hits.escapes, axis=1, bitorder="little")[:, : hits.patch.shape[1]].astype(bool)


def test_rays_meet_what_single_rays_meet(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    hits = trace_lobe_rays(geometry, lookup, NO_SURFACES, *points, NO_FOOTPRINT, None, pattern)
    direction = directions(pattern, *points)
    face = trace_rays(geometry.embree, np.repeat(points[0].position, 21, axis=0), direction).face.reshape(NUM, 21)
    is_above = direction[:, 1].reshape(NUM, 21) > 0
    assert is_above.mean() > 0.99
    np.testing.assert_array_equal(escapes(hits), (face < 0) & is_above)
    assert 0.2 < escapes(hits).mean() < 0.8
    assert set(hits.patch[(face >= 0) & is_above]) == {9}
    assert len(hits.paths.ray) == 0


def polished_ceiling(blur=0.0):
    lobe = sample_lobe(CHROME, NO_LEVELS)
    tint = np.ones((NO_PATCH + 1, 3), np.float32)
    tint[9] = 1, 0.5, 0.25
    return LobeSurfaces(
        faces=np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.uint32),
        face_material=np.array([0, 0, 1, 1], np.int32),
        normals=np.empty((0, 3), np.float32),
        lobe=np.array([-1, 0], np.int32),
        quantile=lobe.quantile,
        band_density=lobe.band_density,
        is_half_angle=np.array([True]),
        scale=np.array([256 / (np.pi / 2)], np.float32),
        albedo=np.full((1, 4, 3), 0.8, np.float32),
        blur=np.array([blur], np.float32),
        tint=tint,
        offset=1e-4,
    )


def test_rays_go_on_from_polished_surfaces(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    hits = trace_lobe_rays(geometry, lookup, polished_ceiling(), *points, NO_FOOTPRINT, None, pattern)
    paths = hits.paths
    assert len(paths.ray) == np.count_nonzero(hits.patch == 9)
    assert np.all(np.diff(paths.first) >= 0)
    assert paths.first[-1] == len(paths.ray)
    assert set(paths.kind) <= {END, ESCAPE}
    np.testing.assert_allclose(paths.throughput, [[0.8, 0.4, 0.2]] * len(paths.ray), rtol=1e-6)
    assert np.mean(paths.direction[:, 1] < 0) > 0.99, "reflected down"
    ends = paths.kind == END
    assert 0.5 < ends.mean() < 1
    assert set(paths.patch[ends & (paths.patch != NO_PATCH)]) == {5}
    point = np.repeat(np.arange(NUM), np.diff(paths.first))
    assert np.all(hits.patch[point, paths.ray] == 9)


def test_wide_lobes_store_where_they_are_lit(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    paths = trace_lobe_rays(geometry, lookup, polished_ceiling(0.1), *points, NO_FOOTPRINT, None, pattern).paths
    lit = paths.kind == REFLECTION
    assert np.count_nonzero(lit) == np.count_nonzero(~lit)
    assert set(paths.patch[lit]) == {9}
    np.testing.assert_allclose(paths.normal[lit], [[0, -1, 0]] * np.count_nonzero(lit), atol=1e-6)


def test_selected_points_keep_their_paths(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    hits = trace_lobe_rays(geometry, lookup, polished_ceiling(0.1), *points, NO_FOOTPRINT, None, pattern)
    rows = np.array([150, 3, 77])
    some = hits.rows(rows)
    for k, row in enumerate(rows):
        mine, whole = slice(*some.paths.first[k : k + 2]), slice(*hits.paths.first[row : row + 2])
        np.testing.assert_array_equal(some.paths.ray[mine], hits.paths.ray[whole])
        np.testing.assert_array_equal(some.paths.direction[mine], hits.paths.direction[whole])
