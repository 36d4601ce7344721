"""Visibility bits against embreex's own tracer, and against shadows in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, still_life, studio

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.lights.spherical_triangles import tessellate_environment
from relume.raytrace.camera_rays import camera_directions, trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.visibility import trace_visibility

GRAZING_SHARE = 2e-5  # of the rays; those within rounding of an edge may hit or miss


def bits_of(visible, num_lights):
    return np.unpackbits(visible, axis=1, bitorder="little")[:, :num_lights].astype(bool)


def embreex_scene(geometry):
    """Triangles in embreex's own wrapper, as the reference."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, geometry.positions[geometry.faces])
    return scene


def visible_by_embreex(geometry, origins, normals, directions):
    above = normals @ directions.T > 0
    point, light = np.nonzero(above)
    hit = embreex_scene(geometry).run(origins[point], directions[light], query="OCCLUDED")
    visible = np.zeros_like(above)
    visible[point, light] = hit < 0
    return visible, above


def unit(v):
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


@pytest.fixture(scope="module")
def surfaces():
    scene = still_life()
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "front", (64, 48))
    solid = samples.material != BACKGROUND
    return geometry, samples.surface.points.position[solid], samples.surface.points.normal[solid]


@pytest.mark.parametrize("num_points", [1, 15, 16, 17, 511, 513, 1000])
@pytest.mark.parametrize("num_lights", [8, 9, 101])
def test_bits_equal_embreex_for_every_packet_width(surfaces, num_points, num_lights):
    geometry, position, normal = surfaces
    pick = np.random.default_rng(num_points).permutation(len(position))[:num_points]
    directions = unit(np.random.default_rng(5).normal(size=(num_lights, 3)))
    traced = trace_visibility(geometry.embree, position[pick], normal[pick], directions)
    expected, above = visible_by_embreex(geometry, position[pick], normal[pick], directions)
    different = bits_of(traced.visible, num_lights) != expected
    assert different.sum() <= max(1, GRAZING_SHARE * above.sum()) if num_points > 100 else not different.any()
    assert traced.visible.shape == (num_points, (num_lights + 7) // 8)


def test_whole_view_against_embreex(surfaces):
    geometry, position, normal = surfaces
    directions = tessellate_environment(studio(), 300).direction
    traced = trace_visibility(geometry.embree, position, normal, directions)
    expected, above = visible_by_embreex(geometry, position, normal, directions)
    different = bits_of(traced.visible, len(directions)) != expected
    assert different.sum() <= GRAZING_SHARE * above.sum()
    assert 0.1 < expected[above].mean() < 0.99  # there are shadows, and light
    assert traced.num_rays == above.sum()
    assert traced.trace_s > 0


def test_lights_below_the_horizon_are_hidden_without_rays(surfaces):
    geometry, position, normal = surfaces
    directions = unit(np.random.default_rng(6).normal(size=(64, 3)))
    bits = bits_of(trace_visibility(geometry.embree, position, normal, directions).visible, 64)
    assert not bits[normal @ directions.T <= 0].any()
    away = -np.tile(normal[:1], (len(position), 1))
    below = trace_visibility(geometry.embree, position, away, normal[:1])
    assert below.num_rays == 0
    assert not below.visible.any()


def test_unused_bits_of_the_last_byte_stay_zero(surfaces):
    geometry, position, normal = surfaces
    directions = unit(np.random.default_rng(7).normal(size=(11, 3)))
    visible = trace_visibility(geometry.embree, position, normal, directions).visible
    assert not np.unpackbits(visible, axis=1, bitorder="little")[:, 11:].any()


def test_nothing_to_trace_is_no_error(surfaces):
    geometry, position, normal = surfaces
    traced = trace_visibility(geometry.embree, position[:0], normal[:0], unit(np.ones((9, 3))))
    assert traced.visible.shape == (0, 2)
    assert traced.num_rays == 0


def test_the_shadow_of_a_square_hole_is_analytic():
    """A lid with a square hole above a floor: a direction is visible if the ray passes the hole."""
    lid = [
        quad(f"lid{k}", [[x0, 1, z1], [x1, 1, z1], [x1, 1, z0], [x0, 1, z0]], 0)
        for k, (x0, x1, z0, z1) in enumerate(
            [(-9, 9, 0.5, 9), (-9, 9, -9, -0.5), (0.5, 9, -0.5, 0.5), (-9, -0.5, -0.5, 0.5)]
        )
    ]
    geometry = build_scene_buffers(make_tiny_scene(*lid, camera=make_camera("c", [0, 5, 5], [0, 0, 0], 0.8)))
    rng = np.random.default_rng(8)
    points = np.column_stack([rng.uniform(-1, 1, 500), np.zeros(500), rng.uniform(-1, 1, 500)]).astype(np.float32)
    normals = np.tile(np.float32([0, 1, 0]), (500, 1))
    directions = unit(np.column_stack([rng.normal(size=200), rng.uniform(0.4, 2, 200), rng.normal(size=200)]))
    bits = bits_of(trace_visibility(geometry.embree, points, normals, directions).visible, 200)
    through = points[:, None, [0, 2]] + (directions[:, [0, 2]] / directions[:, 1:2])[None]
    far = np.abs(through).max(axis=2)
    clear = (np.abs(far - 0.5) > 1e-4) & (far < 8)
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(bits[clear], (far < 0.5)[clear])
    assert 0.02 < bits.mean() < 0.5


def test_the_shadow_of_a_ball_in_an_open_box_is_analytic():
    """A ball above a floor between four low walls; rays near the ball's faceted outline are excluded."""
    ball = sphere("ball", [0, 1, 0], 0.5, 0, num_rings=24)
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    corners = [(-2, 2), (2, 2), (2, -2), (-2, -2)]
    walls = [
        quad(f"wall{k}", [[x0, 0, z0], [x0, 0.6, z0], [x1, 0.6, z1], [x1, 0, z1]], 0)
        for k, ((x0, z0), (x1, z1)) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True))
    ]
    geometry = build_scene_buffers(
        make_tiny_scene(ball, floor, *walls, camera=make_camera("c", [0, 5, 5], [0, 0, 0], 0.8))
    )
    rng = np.random.default_rng(9)
    points = np.column_stack([rng.uniform(-1.9, 1.9, 700), np.full(700, 1e-3), rng.uniform(-1.9, 1.9, 700)])
    points = points.astype(np.float32)
    directions = unit(np.column_stack([rng.normal(size=150), rng.uniform(0.05, 2, 150), rng.normal(size=150)]))
    normals = np.tile(np.float32([0, 1, 0]), (700, 1))
    bits = bits_of(trace_visibility(geometry.embree, points, normals, directions).visible, 150)
    d, towards = directions[None].astype(float), np.float64([0, 1, 0]) - points[:, None]
    along = (towards * d).sum(axis=2)
    past = np.sqrt(np.maximum((towards**2).sum(axis=2) - along**2, 0))
    with np.errstate(divide="ignore"):
        to_wall = np.abs((np.sign(d[..., [0, 2]]) * 2 - points[:, None, [0, 2]]) / d[..., [0, 2]]).min(axis=2)
    height = points[:, None, 1] + to_wall * d[..., 1]
    clear = (np.abs(past - 0.4975) > 0.005) & (np.abs(height - 0.6) > 1e-3)
    assert clear.mean() > 0.95
    np.testing.assert_array_equal(bits[clear], ((past > 0.5) & (height > 0.6))[clear])


@pytest.mark.parametrize("far_away", [0.0, 1000.0])
def test_convex_objects_do_not_shadow_themselves(far_away):
    """Neither a plane, nor a ball whose shading normals differ from its facets."""
    at = np.float64([far_away, 0, 0])
    plane = quad("plane", np.add([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], at), 0)
    directions = tessellate_environment(studio(), 300).direction
    camera = make_camera("c", np.add(at, [0, 1.5, 2.5]), at, 0.6)
    scene = make_tiny_scene(plane, camera=camera)
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "c", (64, 48))
    solid = samples.material != BACKGROUND
    assert solid.sum() > 500
    visible = trace_visibility(
        geometry.embree, samples.surface.points.position[solid], samples.surface.points.normal[solid], directions
    ).visible
    bits = bits_of(visible, len(directions))
    np.testing.assert_array_equal(bits, np.broadcast_to(directions[:, 1] > 0, bits.shape))

    scene = make_tiny_scene(sphere("ball", at, 1.0, 0, num_rings=16), camera=camera)
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "c", (64, 48))
    solid = samples.material != BACKGROUND
    position, normal = samples.surface.points.position[solid], samples.surface.points.normal[solid]
    bits = bits_of(trace_visibility(geometry.embree, position, normal, directions).visible, len(directions))
    # facets deviate from smooth normals by up to half a ring: above both horizons nothing occludes
    high = normal @ directions.T > np.sin(np.pi / 16)
    assert bits[high].all()
    assert high.mean() > 0.3


def test_first_hits_equal_embreex():
    scene = still_life()
    geometry = build_scene_buffers(scene)
    camera = scene.cameras[0]
    y, x = np.divmod(np.arange(50 * 37), 50)
    directions = camera_directions(camera, (50, 37), (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    origin = camera.to_world[:3, 3].astype(np.float32)
    hits = trace_rays(geometry.embree, origin, directions)
    embreex_hits = embreex_scene(geometry).run(np.tile(origin, (len(directions), 1)), directions, output=True)
    same = hits.face == embreex_hits["primID"]
    assert (~same).mean() < 1e-3  # a ray through a common edge may hit either triangle
    hit = same & (hits.face >= 0)
    np.testing.assert_allclose(hits.distance[hit], embreex_hits["tfar"][hit], rtol=1e-5)
    np.testing.assert_allclose(hits.uv[hit], np.column_stack([embreex_hits["u"], embreex_hits["v"]])[hit], atol=2e-4)
    assert np.isinf(hits.distance[hits.face < 0]).all()
    assert 0.3 < (hits.face >= 0).mean() < 0.99
