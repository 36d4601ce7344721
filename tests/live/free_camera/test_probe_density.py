"""Probe density: higher near cameras and at shadow edges."""

import itertools

import numpy as np
import pytest
from session_edits import relative_rmse
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.core.cache import Cache
from relume.lights.spherical_triangles import tessellate_environment
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.probes.density import density_from_distance, density_from_shadows
from relume.probes.interpolation_weights import make_weights_linear
from relume.probes.mesh_lattice import make_corner_grid, place_probes
from relume.probes.triangle_grids import ProbeDensity, enumerate_nodes
from relume.probes.visible_sides import visible_sides
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA_POSITION = np.array([[0.0, 3.0, 4.0]])


@pytest.fixture(scope="module")
def scene():
    """A floor of two faces, and a card standing on its center."""
    floor = quad("floor", [[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]], 0)
    card = quad("card", [[-0.3, 0, 0.1], [0.3, 0, 0.1], [0.3, 0.5, 0.1], [-0.3, 0.5, 0.1]], 1)
    gray = [Material(name, ({"model": "lambert", "color": [0.8, 0.8, 0.8]},)) for name in ("Floor", "Card")]
    camera = make_camera("front", CAMERA_POSITION[0], [0, 0, 0], 0.5)
    return make_tiny_scene(floor, card, camera=camera, environment=studio(32, 20.0), materials=gray)


def place_initial_probes(scene, num_points=1500):
    geometry = build_scene_buffers(scene)
    is_open = visible_sides(geometry, scene.cameras, 1)
    density = density_from_distance(geometry, CAMERA_POSITION, make_corner_grid(is_open))
    return geometry, is_open, place_probes(geometry, is_open, density, num_points)


def density_by_shadows(scene, geometry, placed):
    return density_from_shadows(
        geometry, placed, CAMERA_POSITION, tessellate_environment(scene.environment.radiance, 300)
    )


def test_probes_are_sparser_far_from_the_camera(scene):
    geometry, _, placed = place_initial_probes(scene)
    camera_position, steps = np.array([0.0, 0.5, 2.0]), enumerate_nodes(placed.probe_grid.num_rows)
    power = density_from_distance(geometry, camera_position[None], placed.probe_grid).power
    where = placed.probes.position[placed.lattice_nodes.probe[placed.probe_grid.node_index, 0]]
    distance = np.linalg.norm(where - camera_position, axis=1)
    is_floor = geometry.face_material[steps.grid // 2] == 0
    assert power[is_floor][distance[is_floor].argmax()] == 3 + power[is_floor][distance[is_floor].argmin()]
    assert set(power) <= set(range(-2, 3))


def test_both_halves_of_narrow_strips_have_equal_grids():
    """Their centers differ far from the camera; the values between probes do not."""
    x = np.arange(8) * 0.02
    corners = [[[w, 0, -4], [w, 0, 4], [w + 0.02, 0, 4], [w + 0.02, 0, -4]] for w in x]
    strips = [quad(f"strip {k}", corners[k], 0) for k in range(len(x))]
    gray = [Material("Strips", ({"model": "lambert", "color": [0.8, 0.8, 0.8]},))]
    scene = make_tiny_scene(*strips, camera=make_camera("front", CAMERA_POSITION[0], [0, 0, 0], 0.5), materials=gray)
    geometry = build_scene_buffers(scene)
    is_open = visible_sides(geometry, scene.cameras, 1)
    density = density_from_distance(geometry, np.array([[0.0, 1.0, 3.0]]), make_corner_grid(is_open))
    power, _ = density.face_extremes()
    assert (power[::2] != power[1::2]).all()
    rows = place_probes(geometry, is_open, density, 300).probe_grid.num_rows.max(axis=1)
    assert rows.max() > 1
    np.testing.assert_array_equal(rows[::2], rows[1::2])


def test_probes_are_dense_at_shadow_edges(scene):
    geometry, is_open, before = place_initial_probes(scene)
    after = place_probes(geometry, is_open, density_by_shadows(scene, geometry, before), 1500)
    near, far = [], []
    for placed in (before, after):
        distance = np.linalg.norm(placed.probes.position[placed.material == 0], axis=1)
        near.append((distance < 0.8).sum())
        far.append((distance > 3).sum())
    assert near[1] > 2 * near[0]
    assert far[1] < 0.9 * far[0]


def test_other_nodes_are_interpolated_linearly(scene):
    geometry, is_open, before = place_initial_probes(scene)
    placed = place_probes(geometry, is_open, density_by_shadows(scene, geometry, before), 1500)
    lattice, vertices, steps = placed.probe_grid, placed.lattice_nodes, enumerate_nodes(placed.probe_grid.num_rows)
    is_floor = geometry.face_material[steps.grid // 2] == 0
    a, b, c = geometry.positions[geometry.faces[steps.grid // 2]].transpose(1, 0, 2)
    u, v = (steps.i / steps.rows)[:, None], (steps.j / steps.rows)[:, None]
    where = ((1 - u - v) * a + u * b + v * c)[is_floor]
    of_nodes = vertices.probe[lattice.node_index], vertices.weight[lattice.node_index]
    interpolated = np.einsum("npc,np->nc", placed.probes.position[of_nodes[0]], of_nodes[1])[is_floor]
    difference = np.linalg.norm((interpolated - where)[:, [0, 2]], axis=1) / placed.spacing
    assert len(where) > 2 * len(placed.probes.position)
    assert np.quantile(difference, 0.98) < 0.05
    assert difference.max() < 1  # except at nodes merged with those of another face
    np.testing.assert_allclose(vertices.weight.sum(axis=1), 1, atol=1e-5)


def test_density_by_shadows_reduces_the_error(scene, tmp_path, monkeypatch):
    def shown(method, name):
        recipe = Recipe(method, ("front",), (64, 48), 300, num_probes=1500)
        bake = open_bake(bake_in_process(METHODS[method], scene, recipe, tmp_path / f"{name}.zarr"), Cache(1 << 30))
        look = validate({"transport": {"bounces": 0}} if method == "probes" else {}, bake.default_look)
        return render_image(bake, "front", look)[..., :3]

    reference, now = shown("direct", "truth"), shown("probes", "now")
    alike = lambda geometry, placed, cameras, lights: density_from_distance(geometry, cameras, placed.probe_grid)  # noqa: E731
    monkeypatch.setattr("relume.methods.probes.density_from_shadows", alike)
    assert relative_rmse(now, reference) < 0.7 * relative_rmse(shown("probes", "before"), reference)


def test_without_occlusion_only_distance_counts():
    ground = quad("ground", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    scene = make_tiny_scene(
        ground, camera=make_camera("front", CAMERA_POSITION[0], [0, 0, 0], 0.8), environment=studio(32, 20.0)
    )
    geometry, _, placed = place_initial_probes(scene)
    after = density_by_shadows(scene, geometry, placed)
    np.testing.assert_array_equal(
        density_from_distance(geometry, CAMERA_POSITION, placed.probe_grid).power, after.power
    )


def test_weights_reproduce_linear_light():
    rng = np.random.default_rng(5)
    towards, normal = rng.normal(size=(200, 3, 4)), np.tile([0.0, 0, 1], (200, 1))
    weight = rng.random((200, 4))
    weight /= weight.sum(axis=1, keepdims=True)
    weights = make_weights_linear(weight, towards, normal)
    difference = [np.linalg.norm(np.einsum("vcp,vp->vc", towards[:, :2], w), axis=1) for w in (weight, weights)]
    assert np.median(difference[1] / difference[0]) < 0.35
    assert (difference[1] < 1.01 * difference[0]).all()
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_coarse_nodes_use_no_fine_probes_of_another_surface():
    """A thin plate of narrow strips, whose rim has the finest probes: they are nearer than those of the top."""
    x = np.linspace(-1, 1, 41)
    top = [[[a, 0.01, -1], [a, 0.01, 1], [b, 0.01, 1], [b, 0.01, -1]] for a, b in itertools.pairwise(x)]
    rim = [[[-1, 0, z], [1, 0, z], [1, 0.01, z], [-1, 0.01, z]] for z in (-1, 1)]
    plate = [quad(f"side {k}", corners, 0) for k, corners in enumerate(top + rim)]
    gray = [Material("Plate", ({"model": "lambert", "color": [0.8, 0.8, 0.8]},))]
    scene = make_tiny_scene(*plate, camera=make_camera("front", CAMERA_POSITION[0], [0, 0, 0], 0.5), materials=gray)
    geometry = build_scene_buffers(scene)
    is_open = visible_sides(geometry, scene.cameras, 1)
    lattice = make_corner_grid(is_open)
    face = enumerate_nodes(lattice.num_rows).grid // 2
    power = np.where(np.abs(geometry.face_normals[face, 1]) > 0.5, 2, -4).astype(np.int8)
    placed = place_probes(geometry, is_open, ProbeDensity(lattice, power), 1500)
    nodes, normals = placed.lattice_nodes, placed.probes.normal[placed.lattice_nodes.probe]
    cosine = np.einsum("nc,nkc->nk", nodes.normal, normals)
    assert (np.abs(nodes.normal[:, 1]) > 0.99).sum() > 2 * (np.abs(placed.probes.normal[:, 1]) > 0.99).sum()
    assert np.where(cosine < 0.5, nodes.weight, 0).sum(axis=1).max() < 0.1
