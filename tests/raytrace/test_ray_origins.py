"""Ray origins on triangles of any size, anywhere: no false hits, and small offsets."""

import numpy as np
import pytest
from tiny_scenes import mesh, quad

from relume.lights.local_lights import make_light_strata, prepare_local_lights
from relume.look import LightGeometry
from relume.math.plane_rounding import ROUNDING, origin_offsets
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.local_light_visibility import trace_light_visibility
from relume.raytrace.ray_origins import OriginMesh, ray_origins
from relume.raytrace.scene_buffers import face_normals
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.merge_meshes import merge_meshes


def rays_from(positions, faces, num, rng):
    """Rays from both sides of random points of triangles into the half spaces there: faces, origins, directions."""
    normal = face_normals(positions, faces)
    mesh = OriginMesh.build(positions, faces, normal)
    face, uv = rng.integers(0, len(faces), num), rng.random((num, 2)).astype(np.float32)
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    is_inner = rng.random(num) < 0.5
    away = normal[face] * np.where(is_inner, -1, 1)[:, None]
    direction = rng.normal(size=(num, 3))
    direction *= np.sign(np.einsum("nc,nc->n", direction, away))[:, None]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return face, ray_origins(mesh, face, uv, is_inner).position, direction.astype(np.float32)


def rotation(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


TRIANGLES = {
    "unit": lambda rng: rng.normal(size=(3, 3)),
    "tiny": lambda rng: 1e-6 * rng.normal(size=(3, 3)),
    "kilometers": lambda rng: 1e3 * rng.normal(size=(3, 3)),
    "10³ sizes away": lambda rng: rng.normal(size=(3, 3)) + 1e3 * rng.normal(size=3),
    "10⁶ m away": lambda rng: 10 * rng.normal(size=(3, 3)) + 1e6 * rng.normal(size=3),
    "sliver": lambda rng: np.array([[0, 0, 0], [1, 0, 0], [rng.random(), 0.004, 0]]) @ rotation(rng),
    "in a plane of the axes": lambda rng: rng.normal(size=(3, 3)) * [1, 0, 1],
    "parallel to a plane of the axes": lambda rng: rng.normal(size=(3, 3)) * [1, 0, 1] + [0, 7.3, 0],
}


@pytest.mark.parametrize("triangle", TRIANGLES.values(), ids=TRIANGLES)
def test_no_ray_meets_the_triangle_that_it_leaves(triangle):
    rng, faces, num_hits = np.random.default_rng(1), np.array([[0, 1, 2]], np.uint32), 0
    for _ in range(200):
        positions = triangle(rng).astype(np.float32)
        _, origin, direction = rays_from(positions, faces, 256, rng)
        num_hits += np.count_nonzero(trace_rays(EmbreeScene.build(positions, faces), origin, direction).face >= 0)
    assert num_hits == 0


@pytest.mark.parametrize("ratio", [1.5, 10, 1000])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_no_ray_meets_another_triangle_of_the_plane_that_it_leaves(ratio, scale):
    """A small square within a large one, in a tilted plane: rounding at the large triangles is that of their size."""
    rng, num_hits = np.random.default_rng(2), 0
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    ring = [triangle for i in range(4) for j in [(i + 1) % 4] for triangle in ([4 + i, 4 + j, j], [4 + i, j, i])]
    faces = np.array([[0, 1, 2], [0, 2, 3], *ring], np.uint32)
    for _ in range(50):
        positions = (scale * np.concatenate([square / ratio, square]) @ rotation(rng)).astype(np.float32)
        _, origin, direction = rays_from(positions, faces, 512, rng)
        num_hits += np.count_nonzero(trace_rays(EmbreeScene.build(positions, faces), origin, direction).face >= 0)
    assert num_hits == 0


def test_offsets_scale_with_the_scene_and_grow_with_the_distance_from_the_origin():
    corners = np.random.default_rng(3).normal(size=(50, 3, 3))
    offset = origin_offsets(corners)
    np.testing.assert_array_equal(origin_offsets(2.0**13 * corners), 2.0**13 * offset)
    np.testing.assert_allclose(origin_offsets(1e-4 * corners), 1e-4 * offset, rtol=1e-6)
    normal = face_normals(corners.reshape(-1, 3), np.arange(150).reshape(50, 3))
    far = origin_offsets(corners + np.array([1e4, 0, 0]))
    np.testing.assert_allclose(
        far, 4 * ROUNDING * 1e4 * np.abs(normal[:, 0]) + offset, rtol=0.01, atol=3 * offset.max()
    )
    # in a plane of the axes the only rounding is that within the plane, of which the least offset is one
    ground = np.array([[[-500, 0, 500], [500, 0, 500], [500, 0, -500]]])
    np.testing.assert_allclose(origin_offsets(ground), 1000 * ROUNDING)


def test_a_degenerate_triangle_has_a_finite_offset():
    corners = np.array([[[0, 0, 0]] * 3, [[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 0, 0], [1, 0, 0], [1, 1e-30, 0]]])
    offset = origin_offsets(corners)
    assert np.isfinite(offset).all()
    assert (offset < 1e-3).all()
    mesh = OriginMesh.build(corners[1].astype(np.float32), np.array([[0, 1, 2]], np.uint32), np.zeros((1, 3), "f"))
    assert np.isfinite(ray_origins(mesh, np.zeros(1, np.int32), np.zeros((1, 2), "f"), np.zeros(1, bool))).all()


def cube(center, size):
    """The outer sides of a cube."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2 + center
    sides = (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)
    return mesh("cube", corner, [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))], 0)


@pytest.mark.parametrize("tilt", [0.0, 0.3], ids=["level", "tilted"])
def test_a_cube_of_a_millimeter_on_a_kilometer_has_its_contact_shadow(tilt):
    """A slanted sun: the ground is lit outside the parallelogram of the shadow, and dark in it, up to the contact.

    On the level ground its edges are right to 0.1 mm, which is the rounding within a triangle of a kilometer; on the
    tilted ground to 0.6 mm, which is that across it.
    """
    size, slope = 1e-3, 1.0
    turn = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    ground = quad("ground", np.array([[-500, 0, 500], [500, 0, 500], [500, 0, -500], [-500, 0, -500]]) @ turn.T, 0)
    block = cube([0, size / 2, 0], size)
    block = mesh("cube", block.positions.astype(float) @ turn.T, block.faces, 0)
    buffers = merge_meshes([ground, block])
    embree, normal = EmbreeScene.build(buffers.positions, buffers.faces), face_normals(buffers.positions, buffers.faces)
    origins = OriginMesh.build(buffers.positions, buffers.faces, normal)
    # points of the ground to the left of the cube, found by rays from above
    height = 3 * size
    x = np.linspace(-2.5 * size, -0.55 * size, 400)
    start = np.stack([x, np.full_like(x, height), np.full_like(x, 0.2 * size)], axis=1) @ turn.T
    hits = trace_rays(embree, start.astype(np.float32), np.tile(-turn[:, 1], (len(x), 1)).astype(np.float32))
    assert (hits.face < 2).all()
    position = ray_origins(origins, hits.face, hits.uv, np.zeros(len(x), np.bool_)).position
    at = position.astype(float) @ turn
    toward_sun = np.array([slope, 1, 0]) / np.hypot(slope, 1) @ turn.T
    is_dark = trace_rays(embree, position, np.tile(toward_sun, (len(x), 1)).astype(np.float32)).face >= 0
    resolution = 1e-4 if tilt == 0 else 6e-4
    edge = -size / 2 - size / slope  # of the shadow
    assert at[:, 1].max() < resolution
    assert is_dark[(at[:, 0] > edge + resolution) & (at[:, 0] < -size / 2)].all()
    assert not is_dark[at[:, 0] < edge - resolution].any()


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("distance", [0.0, 1e3], ids=["at the origin", "10³ sizes away"])
def test_light_of_a_panel_reaches_every_point_and_none_behind_a_wall(scale, distance):
    """A ray ends off the panel, which is a mesh of the scene; a wall 0.01 sizes before it occludes all light."""
    rng, turn = np.random.default_rng(4), rotation(np.random.default_rng(5))

    def place(corners):
        return scale * (np.asarray(corners, float) @ turn.T + distance / np.sqrt(3))

    panel_corners = place([[-0.3, 1, -0.3], [0.3, 1, -0.3], [0.3, 1, 0.3], [-0.3, 1, 0.3]])
    panel = quad("panel", panel_corners, 0)
    wall = quad("wall", place([[-1, 0.99, -1], [1, 0.99, -1], [1, 0.99, 1], [-1, 0.99, 1]]), 0)
    up = turn[:, 1]
    light = LightGeometry(
        "rectangle", tuple(panel.positions.astype(float).mean(axis=0)), tuple(-up), size=(0.3 * scale, 0.3 * scale)
    )
    made = prepare_local_lights(light)
    x, z = rng.uniform(-0.5, 0.5, (2, 500))
    position = np.asarray(place(np.stack([x, 0 * x, z], axis=1)), np.float32)
    normal = np.tile(up, (500, 1)).astype(np.float32)
    points = SurfacePoints(position, normal, any_tangent(normal), np.arange(500, dtype=np.uint32))
    for meshes, expected in (([panel], 1.0), ([panel, wall], 0.0)):
        buffers = merge_meshes(meshes)
        bits = trace_light_visibility(
            EmbreeScene.build(buffers.positions, buffers.faces), made, make_light_strata(made, 64), points
        )
        visible = np.unpackbits(bits, axis=1, count=64).mean()
        assert visible == expected
