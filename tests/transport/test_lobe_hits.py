"""Tracing of lobe rays: what each meets is what a single ray meets, and polished surfaces pass it on."""

from __future__ import annotations

import numpy as np
import pytest
from rgb9e5 import rgb9e5_unpack
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.brdf.lobe_sampling import sample_lobe
from relume.brdf.roughness_levels import NO_LEVELS
from relume.brdf.term_validation import complete_term
from relume.patches.patch_kdtree import NO_PATCH, NO_PATCH_NODE, PatchTree
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.lobe_directions import lobe_shift, lobe_vector, make_lobe_pattern
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.surface_textures import TextureCoordinates, Textures, concatenate_textures
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Glass, Material, Texture
from relume.transport.hit_textures import NO_TEXTURES, hit_textures
from relume.transport.lobe_hits import NO_FOOTPRINT, LobeHits, lobe_ray_in_pixel, trace_lobe_rays
from relume.transport.lobe_paths import END, ESCAPE, NO_EMITTER, NO_SURFACES, REFLECTION, TRANSMISSION, LobeSurfaces
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
            pattern, lobe_vector(pattern, 0, ray, lobe_shift(pattern, points.seed[p]))[0], ray, points.normal[p],
            points.tangent[p], wo[p], NO_FOOTPRINT[0], points.seed[p],
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


@pytest.mark.parametrize("has_patches", [False, True])
def test_a_quarter_of_the_rays_decides_where_lobes_are_uniform(geometry, lookup, points, has_patches):
    """Without patches it does not matter what they meet. Fewer than one ray in a thousand differ."""
    if not has_patches:
        dark = lookup.tree._replace(roots=np.full(4, NO_PATCH_NODE, np.int32))
        lookup = lookup._replace(tree=dark)
    surface_points, wo = points
    order = np.argsort(surface_points.position[:, 0])
    surface_points, wo = surface_points.rows(order), wo[order]
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 55, 7)
    hits = trace_lobe_rays(geometry, lookup, NO_SURFACES, surface_points, wo, NO_FOOTPRINT, None, pattern)
    direction = directions(pattern, surface_points, wo)
    face = trace_rays(geometry.embree, np.repeat(surface_points.position, 55, axis=0), direction).face.reshape(NUM, 55)
    is_above = direction[:, 1].reshape(NUM, 55) > 0
    assert np.mean((escapes(hits) != (face < 0))[is_above]) < 1e-3
    assert np.mean(((hits.patch == 9) != ((face >= 0) & has_patches))[is_above]) < 1e-3
    assert 0.2 < escapes(hits).mean() < 0.8


def polished_ceiling(geometry, blur=0.0, curvature=0.0):
    lobe = sample_lobe(CHROME, NO_LEVELS)
    tint = np.ones((NO_PATCH + 1, 3), np.float32)
    tint[9] = 1, 0.5, 0.25
    return LobeSurfaces(
        face_material=np.array([0, 0, 1, 1], np.int32),
        normals=np.empty((0, 3), np.float32),
        curvature=np.full(4, curvature, np.float32),
        lobe=np.array([-1, 0], np.int32),
        quantile=lobe.quantile,
        band_density=lobe.band_density,
        is_half_angle=np.array([True]),
        scale=np.array([256 / (np.pi / 2)], np.float32),
        albedo=np.full((1, 4, 3), 0.8, np.float32),
        blur=np.array([blur], np.float32),
        tint=tint,
        textures=NO_TEXTURES,
        specular=-1,
        glass=np.empty((0, 4), np.float32),
        is_two_sided=np.array([False, False]),
        origins=geometry.origins,
    )


def test_rays_go_on_from_polished_surfaces(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    hits = trace_lobe_rays(geometry, lookup, polished_ceiling(geometry), *points, NO_FOOTPRINT, None, pattern)
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
    # the floor may emit upward, and what escapes may not
    assert set(paths.emitter[ends & (paths.patch == 5)]) == {0}
    assert set(paths.emitter[~ends]) == {NO_EMITTER}
    np.testing.assert_allclose(rgb9e5_unpack(paths.emission[ends & (paths.patch == 5)]), 1)


def test_wide_lobes_store_where_they_are_lit(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    paths = trace_lobe_rays(
        geometry, lookup, polished_ceiling(geometry, 0.1), *points, NO_FOOTPRINT, None, pattern
    ).paths
    lit = paths.kind == REFLECTION
    assert np.count_nonzero(lit) == np.count_nonzero(~lit)
    assert set(paths.patch[lit]) == {9}
    np.testing.assert_allclose(paths.normal[lit], [[0, -1, 0]] * np.count_nonzero(lit), atol=1e-6)


def test_ray_footprints_grow_where_they_meet_a_curved_surface(geometry, lookup, points):
    pattern, spread = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7), {}
    for curvature in (0.0, 3.0):
        surfaces = polished_ceiling(geometry, 0.1, curvature)
        paths = trace_lobe_rays(geometry, lookup, surfaces, *points, NO_FOOTPRINT, None, pattern).paths
        lit = paths.kind == REFLECTION
        spread[curvature], distance = paths.spread[lit], 1 / np.abs(paths.direction[lit, 1])
    assert np.ptp(spread[0.0]) == 0
    assert spread[0.0][0] > 0
    np.testing.assert_allclose(spread[3.0] / spread[0.0], 1 + 2 * 3 * distance, rtol=0.01)


def test_selected_points_keep_their_paths(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    hits = trace_lobe_rays(geometry, lookup, polished_ceiling(geometry, 0.1), *points, NO_FOOTPRINT, None, pattern)
    rows = np.array([150, 3, 77])
    some = hits.rows(rows)
    for k, row in enumerate(rows):
        mine, whole = slice(*some.paths.first[k : k + 2]), slice(*hits.paths.first[row : row + 2])
        np.testing.assert_array_equal(some.paths.ray[mine], hits.paths.ray[whole])
        np.testing.assert_array_equal(some.paths.direction[mine], hits.paths.direction[whole])


def stripes():
    """A texture of the ceiling: red rises along u, green along v."""
    u, v = (np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32
    return np.stack(np.broadcast_arrays(u, v[:, None], np.float32(0.5)), axis=-1).astype(np.float32)


def with_textured_ceiling(geometry, surfaces):
    """The textures of a scene whose ceiling has stripes in the diffuse slot."""
    textures = Textures(
        *concatenate_textures([Texture(stripes(), ("clamp", "clamp"))]),
        np.array([[2, 2]]),
        np.array([[-1] * 4, [0, -1, -1, -1]]),
    )
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]] * 2, np.float32)
    scale = np.sqrt([0.01, 0.01, 0.02, 0.02]).astype(np.float32)
    coordinates = TextureCoordinates(uvs, geometry.faces, scale)
    return surfaces._replace(
        face_material=geometry.face_material, textures=hit_textures(textures, coordinates), specular=-1
    )


def test_rays_bring_the_texture_at_their_hits(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    surfaces = with_textured_ceiling(geometry, NO_SURFACES)
    hits = trace_lobe_rays(geometry, lookup, surfaces, *points, NO_FOOTPRINT, None, pattern)
    assert hits.texture.shape == (1, NUM, 21)
    direction = directions(pattern, *points).reshape(NUM, 21, 3)
    position = points[0].position[:, None] + direction * ((1 - 1e-4) / direction[..., 1:2])
    u, v = position[..., 0] / 5, 1 - (5 - position[..., 2]) / 10
    hit = (hits.patch == 9) & (np.minimum(u, 1 - u) > 0.05) & (np.minimum(v, 1 - v) > 0.05)
    assert hit.mean() > 0.2
    texture = rgb9e5_unpack(hits.texture[0])[hit]
    np.testing.assert_allclose(texture, np.stack([u, v, np.full_like(u, 0.5)], -1)[hit], atol=0.01)


def test_footprints_grow_with_distance_and_lobe(geometry, lookup, points):
    """The texture of a far hit is a mean: noise of single texels becomes gray."""
    noise = np.random.default_rng(4).uniform(0, 1, (512, 512, 1)).repeat(3, axis=2).astype(np.float32)
    spreads = []
    for roughness in (0.02, 0.22):
        chrome = complete_term(("terms", 0), {"model": "ggx", "params": {"roughness": roughness, "f0": 1.0}}, None)
        surfaces = with_textured_ceiling(geometry, NO_SURFACES)
        textures = surfaces.textures.textures._replace(**concatenate_textures([Texture(noise)])._asdict())
        surfaces = surfaces._replace(textures=surfaces.textures._replace(textures=textures))
        pattern = make_lobe_pattern(sample_lobe(chrome, NO_LEVELS), 21, 7)
        hits = trace_lobe_rays(geometry, lookup, surfaces, *points, NO_FOOTPRINT, None, pattern)
        spreads.append(rgb9e5_unpack(hits.texture[0])[hits.patch == 9].std())
    assert spreads[0] > 0.15
    assert spreads[1] < 0.5 * spreads[0]


def test_textures_tint_what_polished_surfaces_reflect(geometry, lookup, points):
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    surfaces = with_textured_ceiling(geometry, polished_ceiling(geometry))._replace(specular=0)
    paths = trace_lobe_rays(geometry, lookup, surfaces, *points, NO_FOOTPRINT, None, pattern).paths
    assert len(paths.ray) > 0
    np.testing.assert_allclose(paths.throughput[:, 2], 0.8 * 0.5, rtol=0.01)
    assert paths.throughput[:, 0].std() > 0.1


TINT = (0.2, 0.9, 0.5)


@pytest.fixture(scope="module")
def glazed():
    """The floor of patch 5 below two sheets of tinted glass of patch 7, and the ceiling of patch 9 above a half."""
    terms = ({"model": "lambert"},)
    materials = Material("A", terms), Material("B", terms), Material("C", terms, glass=Glass(TINT))
    scene = make_tiny_scene(
        quad("floor", [[-5, 0, 5], [5, 0, 5], [5, 0, -5], [-5, 0, -5]], 0),
        quad("ceiling", [[0, 1, 5], [5, 1, 5], [5, 1, -5], [0, 1, -5]], 1),
        *(quad(f"sheet {y}", [[-9, y, 9], [9, y, 9], [9, y, -9], [-9, y, -9]], 2) for y in (0.3, 0.4)),
        camera=make_camera("front", [0, 4, 0.01], [0, 0, 0], 0.1),
        environment=np.ones((8, 16, 3), "f"),
        materials=materials,
    )
    geometry = build_scene_buffers(scene)
    leaves = -1 - np.array([5, 5, 9, 9, 7, 7, 7, 7], np.int32)
    tree = PatchTree(np.zeros(1, np.uint8), np.zeros(1, np.float32), np.full((1, 2), NO_PATCH_NODE, np.int32), leaves)
    sides = (2 * geometry.face_mesh).astype(np.int32)
    lookup = PatchLookup(tree, geometry.face_normals, sides, np.zeros(NO_PATCH + 1, np.float32))
    surfaces = NO_SURFACES._replace(
        face_material=geometry.face_material,
        lobe=np.full(3, -1, np.int32),
        glass=np.array([[-1] * 4, [-1] * 4, [*TINT, 0.04]], np.float32),
        is_two_sided=np.zeros(3, np.bool_),
        origins=geometry.origins,
    )
    return geometry, lookup, surfaces


def test_glass_passes_every_ray_with_the_tint_of_each_channel(glazed, points):
    geometry, lookup, surfaces = glazed
    pattern = make_lobe_pattern(sample_lobe(CHROME, NO_LEVELS), 21, 7)
    # samples that tinted glass splits: all see the same, because their weights add up to one
    for alpha_sample in (0.0, -6.0, -7.0):
        split = points[0]._replace(alpha_sample=np.full(1, alpha_sample, np.float32))
        hits = trace_lobe_rays(geometry, lookup, surfaces, split, points[1], NO_FOOTPRINT, None, pattern)
        paths, cosine = hits.paths, directions(pattern, *points)[:, 1].reshape(NUM, 21)
        assert not escapes(hits).any()
        assert np.all(hits.patch == NO_PATCH)
        point = np.repeat(np.arange(NUM), np.diff(paths.first))
        ray_cosine = cosine[point, paths.ray]
        transmittance = (1 - 0.04 - 0.96 * (1 - ray_cosine) ** 5)[:, None] * TINT
        own, through = paths.patch == 7, paths.patch == 9
        leaving = paths.kind == TRANSMISSION
        assert np.all(own | through | leaving)
        assert np.count_nonzero(own) == 2 * np.count_nonzero(through | leaving) == 2 * np.count_nonzero(cosine > 0)
        first, second = own.nonzero()[0][::2], own.nonzero()[0][1::2]
        np.testing.assert_allclose(paths.throughput[first], 1)
        np.testing.assert_allclose(paths.throughput[second], transmittance[second], rtol=1e-3)
        ends = through | leaving
        np.testing.assert_allclose(paths.throughput[ends], transmittance[ends] ** 2, rtol=1e-3)
        np.testing.assert_allclose(paths.direction[ends][:, 1], ray_cosine[ends], atol=1e-4)
        assert 0.2 < np.mean(leaving[ends]) < 0.8
