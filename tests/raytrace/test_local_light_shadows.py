"""Shadows of local lights against intersections in plain NumPy; lights at surfaces and inside walls."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_emissive_triangles, make_surface_points, quad, still_life

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.lights.local_lights import light_sample, make_light_strata, prepare_local_lights
from relume.look import LightGeometry
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.raytrace.local_light_visibility import MIN_GROUPED_SAMPLES, compute_irradiance, trace_light_visibility
from relume.raytrace.scene_buffers import build_scene_buffers

UP = np.array([0, 1, 0], np.float32)


def crosses(triangles, start, end):
    """True where a segment (n, 3) intersects any of the triangles (Möller, Trumbore 1997)."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    along = end - start
    across = np.cross(along[:, None], f)
    determinant = np.einsum("ntc,tc->nt", across, e)
    with np.errstate(divide="ignore", invalid="ignore"):
        from_corner = start[:, None] - a
        u = np.einsum("ntc,ntc->nt", from_corner, across) / determinant
        rotated = np.cross(from_corner, e)
        v = np.einsum("nc,ntc->nt", along, rotated) / determinant
        t = np.einsum("ntc,tc->nt", rotated, f) / determinant
        return ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)).any(axis=1)


@pytest.fixture(scope="module")
def surfaces():
    scene = still_life()
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "front", (64, 48))
    solid = np.flatnonzero(samples.material != BACKGROUND)[::37]
    return geometry, samples.surface.points.position[solid], samples.surface.points.normal[solid]


@pytest.mark.parametrize(
    "light",
    [
        LightGeometry("point", (0.9, 1.4, 0.6)),
        LightGeometry("directional", direction=(-1.0, -1.0, -0.3)),
        LightGeometry("rectangle", (0.9, 1.4, 0.6), (-1.0, -1.0, 0.0), size=(0.5, 0.8)),
    ],
    ids=lambda light: light.kind,
)
def test_visibility_bits_equal_segment_intersections(surfaces, light):
    geometry, position, normal = surfaces
    made = prepare_local_lights(light)
    strata = make_light_strata(made, 16)
    points = make_surface_points(position, normal, first=100)
    visibility = trace_light_visibility(geometry.embree, made, strata, points)
    bits = np.unpackbits(visibility, axis=1, bitorder="little")[:, : len(strata.uv)].astype(bool)
    triangles = geometry.positions[geometry.faces].astype(float)
    wrong = 0
    for k in range(len(strata.uv)):
        actual = [
            light_sample(made, strata, k, *cranley_patterson_offset(strata, n), *p)
            for n, p in zip(points.seed, position, strict=True)
        ]
        direction, distance = np.array([f[:3] for f in actual]), np.array([f[3] for f in actual])
        end = position + direction * np.minimum(distance, 100)[:, None]
        requested = (np.einsum("nc,nc->n", direction, normal) > 0) & (np.array([f[4] for f in actual]) > 0)
        wrong += np.sum(bits[:, k] != (requested & ~crosses(triangles, position.astype(float), end)))
    assert wrong <= 2e-3 * bits.size, "but for rays that graze an edge"
    assert 0.05 < bits.mean() < 0.95


def test_many_samples_are_traced_in_fours_where_neighbors_agree():
    """A floor in rows under an area light, a third of it occluded by a card: bits still equal segment intersections."""
    panel, card = ([[x, y, -0.5], [1, y, -0.5], [1, y, 0.5], [x, y, 0.5]] for x, y in ((-1, 1.5), (0.37, 1.3)))
    corners = np.array(panel, np.float32)[[[0, 1, 2], [0, 2, 3]]]
    made = prepare_local_lights(LightGeometry("mesh", material="Lamp"), make_emissive_triangles(corners, False))
    strata = make_light_strata(made, MIN_GROUPED_SAMPLES // 4)
    x, z = np.meshgrid(np.linspace(-0.4, 0.4, 16), np.linspace(-0.2, 0.2, 2))
    position = np.stack([x, 0 * x, z], axis=2).reshape(-1, 3).astype(np.float32)
    points = make_surface_points(position, np.tile(UP, (32, 1)))
    hides = quad("card", card, 0)
    bits = np.unpackbits(trace_light_visibility(embree_of(hides), made, strata, points), axis=1, bitorder="little")
    offset = np.array(
        [
            [
                light_sample(made, strata, k, *cranley_patterson_offset(strata, n), *p)[:4]
                for k in range(MIN_GROUPED_SAMPLES)
            ]
            for n, p in zip(points.seed, position, strict=True)
        ]
    )
    end = position[:, None] + offset[..., :3] * offset[..., 3:]
    start = np.repeat(position.astype(float), MIN_GROUPED_SAMPLES, axis=0)
    free = ~crosses(hides.positions[hides.faces].astype(float), start, end.reshape(-1, 3)).reshape(
        32, MIN_GROUPED_SAMPLES
    )
    assert 0.5 < free.mean() < 0.9
    assert (bits != free).mean() < 2e-3
    # single cells along the edge
    np.testing.assert_allclose(bits.mean(axis=1), free.mean(axis=1), atol=6 / MIN_GROUPED_SAMPLES)


def irradiance(geometry, light, position, normal, triangles=None, num_samples=64):
    made = prepare_local_lights(light, triangles)
    strata = make_light_strata(made, num_samples)
    points = make_surface_points(position, normal)
    return compute_irradiance(made, strata, points, trace_light_visibility(geometry, made, strata, points))


def embree_of(*meshes):
    first = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + np.uint32(start) for mesh, start in zip(meshes, first[:-1], strict=True)])
    return EmbreeScene.build(np.concatenate([mesh.positions for mesh in meshes]), faces)


CEILING = quad("ceiling", [[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]], 0)
FLOOR = np.random.default_rng(4).uniform([-1, 1e-4, -1], [1, 1e-4, 1], (300, 3)).astype(np.float32)
NORMALS = np.tile(UP, (300, 1))


def test_an_emissive_surface_does_not_shadow_itself():
    """The ceiling is the emitter: as bright as an unoccluded rectangle."""
    corners = CEILING.positions[CEILING.faces]
    emitter = LightGeometry("mesh", material="Lamp")
    actual = irradiance(embree_of(CEILING), emitter, FLOOR, NORMALS, make_emissive_triangles(corners, False))
    assert np.all(actual > 0.3)
    open_air = embree_of(quad("far", [[90, 0, 0], [91, 0, 0], [91, 1, 0], [90, 1, 0]], 0))
    free = irradiance(open_air, emitter, FLOOR, NORMALS, make_emissive_triangles(corners, False))
    np.testing.assert_array_equal(actual, free)


@pytest.mark.parametrize("height", [2.0, 2.0 - 1e-6])
def test_a_rectangle_in_the_plane_of_a_ceiling_is_not_shadowed(height):
    light = LightGeometry("rectangle", (0.0, height, 0.0), size=(0.5, 0.5))
    actual = irradiance(embree_of(CEILING), light, FLOOR, NORMALS)
    assert np.all(actual > 0.01)


def test_lights_inside_a_wall_or_above_the_ceiling_are_occluded():
    above = quad("above", [[-1, 2.2, -1], [1, 2.2, -1], [1, 2.2, 1], [-1, 2.2, 1]], 0)
    wall = embree_of(CEILING, above)
    for light in (
        LightGeometry("point", (0, 2.1, 0)),
        LightGeometry("rectangle", (0, 2.1, 0), size=(0.5, 0.5)),
        LightGeometry("directional"),
    ):
        assert not irradiance(wall, light, 0.5 * FLOOR, NORMALS).any()
