"""Patches and gather hits, against first hits traced one by one, and against closed rooms that preserve energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import corner, make_camera, make_surface_points, make_tiny_scene, sphere

from relume.patches.gather_hits import trace_gather_rays
from relume.patches.importons import lobe_directions
from relume.patches.patch_kdtree import NO_PATCH, grow_tree, locate
from relume.patches.patches import POINTS_PER_PATCH, choose_patches, patch_sample_points
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.gather_rays import lattice_offsets, local_ray, make_pattern
from relume.raytrace.ray_packet import LANES
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Material, Texture, TextureEncoding

NUM_PATCHES = 1200


@pytest.fixture(scope="module")
def box():
    scene = cornell_box()
    geometry = build_scene_buffers(scene)
    return scene, geometry, choose_patches(scene, geometry, ("front",), (400, 400), NUM_PATCHES)


def points_of(patches, count, first=0):
    some = (
        patch_sample_points(patches.position, patches.normal)
        .rows(slice(None, None, POINTS_PER_PATCH * patches.num_patches // count))
        .rows(slice(count))
    )
    return make_surface_points(some.position, some.normal, first)


def random_keys(num, num_sides, seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(num, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    keys = np.concatenate([rng.random((num, 3)), normal], axis=1).astype(np.float32)
    return keys, rng.integers(0, num_sides, num).astype(np.int32)


def patch_of(tree, side, key):
    """The patch of one point, with the same values in all lanes."""
    keys, nodes = (
        np.repeat(np.asarray(key, np.float32)[:, None], LANES, axis=1),
        np.full(LANES, tree.roots[side], np.int32),
    )
    locate(tree, keys, nodes)
    assert len(set(nodes)) == 1
    return int(nodes[0])


@pytest.mark.parametrize(("num_patches", "num_points"), [(1, 50), (7, 50), (300, 5000), (50, 50)])
def test_each_point_is_located_in_its_patch(num_patches, num_points):
    keys, side = random_keys(num_points, 4, seed=num_patches)
    tree, members = grow_tree(keys, np.ones(len(keys), np.float32), side, 6, num_patches)
    assert sorted(np.concatenate(members)) == list(range(num_points))
    assert len(members) == pytest.approx(num_patches, abs=4)
    for patch, rows in enumerate(members):
        assert len(set(side[rows])) == 1
        assert {patch_of(tree, side[row], keys[row]) for row in rows} == {patch}


def test_hits_just_below_a_plane_are_located_on_it():
    """Points are offset from their surface, with rounding; few points lie on the front plane, many on the back one."""
    rng = np.random.default_rng(5)
    near, far = np.float32(-1.2), np.float32(-2)
    z = np.where(np.arange(3000) < 200, near, far)
    x = np.where(z == near, rng.uniform(-2.7, -2.5, 3000), rng.uniform(-2.5, 2.5, 3000))
    position = np.stack([x, rng.random(3000), z + 1e-4 + rng.uniform(-2e-7, 2e-7, 3000)], axis=1)
    keys = np.concatenate([position, np.tile([0, 0, 1], (3000, 1))], axis=1).astype(np.float32)
    tree, members = grow_tree(keys, np.ones(3000, np.float32), np.zeros(3000, np.int32), 1, 200)
    is_near = [set(z[rows]) == {near} for rows in members]
    assert {len(set(z[rows])) for rows in members} == {1}
    for x, y in rng.uniform((-2.7, 0), (-2.5, 1), (50, 2)):
        assert is_near[patch_of(tree, 0, (x, y, near, 0, 0, 1))]
    for x, y in rng.uniform((-2.4, 0), (2.5, 1), (50, 2)):
        assert not is_near[patch_of(tree, 0, (x, y, far, 0, 0, 1))]


@pytest.mark.parametrize("cause", ["what is seen is near", "the surface bends"])
def test_patches_are_small_where_light_varies(cause):
    """On one half of a plane with as many points as the other half."""
    keys, _ = random_keys(4000, 1, seed=2)
    is_uneven, reach = keys[:, 0] < 0.5, np.full(4000, 3, np.float32)
    bends = is_uneven & (cause == "the surface bends")
    keys[:, 3:] = np.where(bends[:, None], keys[:, 3:] * (1, 1, 0.3), (0, 0, 1))
    reach[is_uneven & ~bends] = 0.3
    _, members = grow_tree(keys, reach, np.zeros(4000, np.int32), 1, 400)
    assert sum(is_uneven[rows].mean() > 0.5 for rows in members) > 270


def test_a_side_without_points_has_no_patch():
    keys, side = random_keys(100, 2, seed=1)
    tree, _ = grow_tree(keys, np.ones(len(keys), np.float32), side, 4, 10)
    assert patch_of(tree, 3, keys[0]) == NO_PATCH


def test_coinciding_points_have_one_patch():
    keys, _ = random_keys(1, 1, seed=1)
    tree, members = grow_tree(np.repeat(keys, 100, axis=0), np.ones(100, np.float32), np.zeros(100, np.int32), 1, 10)
    assert len(members) == 1
    assert patch_of(tree, 0, keys[0]) == 0


def test_no_points_give_no_patches():
    tree, members = grow_tree(np.empty((0, 6), np.float32), np.empty(0, np.float32), np.empty(0, np.int32), 2, 10)
    assert members == []
    assert patch_of(tree, 0, (0, 0, 0, 0, 0, 1)) == NO_PATCH


def test_points_lie_on_reachable_surfaces(box):
    """None on the floor under a block, none inside a block: a patch next to a block contains no hidden points."""
    scene, _, patches = box
    for name in ("Tall block", "Short block"):
        mesh = next(mesh for mesh in scene.meshes if mesh.name == name)
        top = mesh.positions[mesh.positions[:, 1] == mesh.positions[:, 1].max()][:, [0, 2]].astype(float)
        center = top.mean(axis=0)
        along = np.unique(np.round(top - center, 5), axis=0)
        u, v = along[0] + along[1], along[0] + along[2]
        position = patches.position.reshape(-1, 3).astype(float)
        at = np.abs((position[:, [0, 2]] - center) @ np.linalg.inv(np.array([u, v]) / 2))
        low = position[:, 1] < mesh.positions[:, 1].max() - 1e-3
        assert not np.any(low & (at < 0.999).all(axis=1))


def test_patches_are_small_along_contacts(box):
    """Distance to the nearest other patch on the floor: next to the tall block, and far from all blocks."""
    scene, _, patches = box
    center = patches.position.mean(axis=1).astype(float)
    floor = center[center[:, 1] < 1e-3][:, [0, 2]]
    tall = next(mesh for mesh in scene.meshes if mesh.name == "Tall block").positions
    foot = tall[tall[:, 1] == 0][:, [0, 2]].astype(float)
    spacing = np.sort(np.linalg.norm(floor[:, None] - floor[None], axis=2), axis=1)[:, 1]
    along = foot[0] + np.linspace(0.1, 0.9, 50)[:, None] * (foot[1] - foot[0])
    from_contact = np.linalg.norm(floor[:, None] - along[None], axis=2).min(axis=1)
    assert np.median(spacing[from_contact < 0.03]) < 0.5 * np.median(spacing[from_contact > 0.3])


def test_patches_are_small_where_a_polished_floor_reflects_them(box):
    """More points lie at the base of the blocks, which the floor reflects, than with a diffuse floor."""
    plain, _, patches = box
    polished = cornell_box(is_floor_glossy=True)
    mirrored = choose_patches(polished, build_scene_buffers(polished), ("front",), (400, 400), NUM_PATCHES)
    blocks = [k for k, material in enumerate(plain.materials) if material.name.endswith("block")]

    def fraction_of_points(patches):
        is_low = (patches.position[:, :, 1].mean(axis=1) < 0.5) & (patches.normal[:, :, 2].mean(axis=1) > 0.5)
        return np.mean(np.isin(patches.material, blocks) & is_low)

    assert fraction_of_points(mirrored) > 1.15 * fraction_of_points(patches)


def test_lobes_have_the_cosine_of_their_exponent():
    """E cos α = (e + 1)/(e + 2) for a density ∝ cos^e α and uniform azimuths."""
    axis = np.repeat(np.array([[0.36, 0.48, -0.8]], np.float32), 20_000, axis=0)
    for exponent in (1.0, 200.0):
        directions = lobe_directions(axis, exponent, np.random.default_rng(3))
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1, abs=1e-5)
        assert (directions @ axis[0]).mean() == pytest.approx(
            (exponent + 1) / (exponent + 2), abs=0.02 / (exponent + 2)
        )
        across = directions.mean(axis=0) - (directions @ axis[0]).mean() * axis[0]
        assert np.linalg.norm(across) < 0.02


def test_patches_are_deterministic(box):
    scene, geometry, patches = box
    again = choose_patches(scene, geometry, ("front",), (400, 400), NUM_PATCHES)
    np.testing.assert_array_equal(again.position, patches.position)
    np.testing.assert_array_equal(again.tree.value, patches.tree.value)


def test_consecutive_patches_are_neighbors_in_space(box):
    center = box[2].position.mean(axis=1)
    step = np.linalg.norm(np.diff(center, axis=0), axis=1)
    anywhere = np.linalg.norm(center[np.random.default_rng(1).permutation(len(center))] - center, axis=1)
    assert np.median(step) < 0.15 * np.median(anywhere)


@pytest.mark.parametrize("max_coherent_triangles", [0, 1000], ids=["ray by ray", "in packets"])
def test_gather_hits_equal_first_hits(box, max_coherent_triangles, monkeypatch):
    """Every ray is traced separately and located directly."""
    monkeypatch.setattr("relume.patches.gather_hits._MAX_COHERENT_TRIANGLES", max_coherent_triangles)
    _, geometry, patches = box
    points, pattern = points_of(patches, 40, first=100), make_pattern(24, 9, 3)
    links = trace_gather_rays(geometry, patches.tree, points, points.normal, pattern)
    normals = geometry.face_normals
    origins, directions, expected_of = [], [], []
    for p in range(40):
        n, t = points.normal[p].astype(float), points.tangent[p].astype(float)
        frame = np.stack([t, np.cross(n, t), n])
        wo = frame @ points.normal[p]
        shift = lattice_offsets(pattern, 100 + p)
        for ray in range(33):
            wi = np.array(local_ray(pattern, ray, shift, *wo.astype(np.float32)))
            if wi[2] > 0:
                origins.append(points.position[p])
                directions.append(wi @ frame)
                expected_of.append((p, ray))
    directions = np.asarray(directions, np.float32)
    hits = trace_rays(geometry.embree, np.array(origins), directions)
    assert links.num_rays == len(origins)
    wrong = 0
    for origin, direction, face, distance, (p, ray) in zip(
        origins, directions, hits.face, hits.distance, expected_of, strict=True
    ):
        expected = NO_PATCH
        if face >= 0:
            behind = normals[face] @ direction > 0
            normal = -normals[face] if behind else normals[face]
            side = 2 * geometry.face_mesh[face] + int(behind)
            expected = patch_of(patches.tree, side, (*(origin + distance * direction), *normal))
        wrong += int(expected != links.patch[p, ray])
    assert wrong <= 0.005 * len(origins)  # rounding at the edge of a patch


def test_results_do_not_depend_on_order_and_batches(box):
    _, geometry, patches = box
    points, pattern = points_of(patches, 30), make_pattern(16, 0, 3)
    whole = trace_gather_rays(geometry, patches.tree, points, points.normal, pattern).patch
    subset = points.rows(slice(11, 23))
    np.testing.assert_array_equal(
        trace_gather_rays(geometry, patches.tree, subset, subset.normal, pattern).patch, whole[11:23]
    )


def test_no_ray_leaves_a_closed_room():
    """Rays of patches inside a ball: an escaping ray would lose light, as do the few below their triangles."""
    ball = sphere("room", (0, 0, 0), 2.0, 0, num_rings=96, inside=True)
    room = make_tiny_scene(ball, camera=make_camera("front", (0, 0, 1), (0, 0, 0), 1.0))
    geometry = build_scene_buffers(room)
    patches = choose_patches(room, geometry, ("front",), (64, 64), 500)
    points = points_of(patches, 400)
    links = trace_gather_rays(geometry, patches.tree, points, points.normal, make_pattern(64, 0, 1))
    assert np.mean(links.patch == NO_PATCH) < 1e-4


@pytest.mark.parametrize(("center", "radius"), [((0, 0, 0), 1.0), ((0, 0, 0), 1e-3), ((50, 3, -20), 0.01)], ids=str)
def test_convex_solid_does_not_light_itself(center, radius):
    """Up to a hundredth of the rays above smooth normals of a coarse ball are below the planes of its triangles."""
    ball = sphere("ball", center, radius, 0, num_rings=6)
    viewpoint = np.add(center, (0, 0, 4 * radius))
    scene = make_tiny_scene(ball, camera=make_camera("front", viewpoint, center, 1.0))
    geometry, rng = build_scene_buffers(scene), np.random.default_rng(3)
    patches = choose_patches(scene, geometry, ("front",), (64, 64), 100)
    num = 4000
    face = rng.choice(len(geometry.faces), num, p=geometry.face_areas / geometry.face_areas.sum())
    root, v = np.sqrt(rng.random(num)), rng.random(num)
    uv = np.stack([root * (1 - v), root * v], axis=1).astype(np.float32)
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    normal = np.einsum("nk,nkc->nc", weights, geometry.normals[geometry.faces[face]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    position = positions_on_faces(geometry, face, uv, geometry.face_normals[face])
    points = make_surface_points(position, normal)
    links = trace_gather_rays(geometry, patches.tree, points, points.normal, make_pattern(64, 0, 1))
    assert np.mean(links.patch != NO_PATCH) < 1e-4


def test_patches_have_tangents_of_uv_coordinates():
    """On a floor with u along its width, within the accuracy of normals; and without normal mapping."""
    slope = np.full((2, 2, 3), (200, 128, 230), np.uint8)
    bumps = Texture(slope, encoding=TextureEncoding("normal"))
    lambert = ({"model": "lambert"},)
    scene = corner([Material("Floor", lambert, {}, bumps), Material("Wall", lambert)])
    tangents = np.broadcast_to(np.float32([1, 0, 0, 1]), scene.meshes[0].tangents.shape)
    scene = replace(scene, meshes=(replace(scene.meshes[0], tangents=tangents), *scene.meshes[1:]))
    patches = choose_patches(scene, build_scene_buffers(scene), ("front",), (40, 30), 100)
    points, uv = patch_sample_points(patches.position, patches.normal), patches.uv.reshape(-1, patches.uv.shape[2])
    of_floor = np.repeat(patches.material == 0, POINTS_PER_PATCH) & (points.position[:, 1] < 1e-3)
    floor_patches = np.flatnonzero(of_floor)
    assert len(floor_patches) > 20
    normal, tangent, turn = points.normal[floor_patches], points.tangent[floor_patches], uv[floor_patches, 3:4]
    assert np.median(normal[:, 0]) > 0.5  # they tilt along red, except for those corrected toward the viewer
    expected = np.array([1, 0, 0]) - normal[:, :1] * normal
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(np.cos(turn) * tangent + np.sin(turn) * np.cross(normal, tangent), expected, atol=1e-4)
    smooth = patches.surface_normal.reshape(-1, 3)[floor_patches]
    np.testing.assert_allclose(np.abs(smooth), np.broadcast_to([0, 1, 0], smooth.shape), atol=1e-6)  # both sides
