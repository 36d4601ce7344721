"""From probes to pixels: lattice, sides with probes, primary visibility and outgoing radiance."""

import math

import numpy as np
import pytest
from probe_shading import shade_probes_numpy
from tiny_scenes import make_camera, make_tiny_scene, mesh, sphere, still_life

from relume.assets.environments.equirect import lookup, rotate_about_y
from relume.core.cache import Cache
from relume.core.errors import PlanError
from relume.live.free_camera.basis.highlight_lobes import build_lobes
from relume.live.free_camera.basis.material_tables import build_tables
from relume.live.free_camera.environment_lookup import rotation_of, sample
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.primary_visibility import interpolate_to_nodes, trace_primary
from relume.live.free_camera.shade_pixels import InterpolatedProbes, MirrorData, shade_pixels
from relume.live.free_camera.shade_probes import shade_probes
from relume.live.opened.openers import open_bake
from relume.look import EnvironmentKey
from relume.methods.registry import METHODS
from relume.probes.density import density_from_distance
from relume.probes.mesh_lattice import make_corner_grid, place_probes
from relume.probes.triangle_grids import ProbeDensity, node_index, num_nodes
from relume.probes.visible_sides import visible_sides
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.texture import MipMap
from relume.scene.model import Camera
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

BROAD_WIDTHS = {"alpha_x": 0.45, "alpha_y": 0.3}  # a highlight that the basis can represent


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    recipe = Recipe("probes", ("front",), (48, 36), 60, num_probes=1000)
    store = bake_in_process(METHODS["probes"], still_life(), recipe, tmp_path_factory.mktemp("moving") / "s.zarr")
    return open_bake(store, Cache(1 << 30))


def placed(scene, num_points=500):
    geometry = build_scene_buffers(scene)
    camera_positions = np.array([camera.to_world[:3, 3] for camera in scene.cameras])
    is_open = visible_sides(geometry, scene.cameras, 1)
    return geometry, place_probes(
        geometry, is_open, density_from_distance(geometry, camera_positions, make_corner_grid(is_open)), num_points
    )


@pytest.mark.parametrize("rows", [1, 2, 7, 255])
def test_each_node_has_one_number(rows):
    numbers = [node_index(rows, i, j) for i in range(rows + 1) for j in range(rows + 1 - i)]
    assert numbers == list(range(int(num_nodes(np.array([rows]))[0])))


@pytest.mark.parametrize("num_points", [200, 500, 5000])
def test_the_number_of_probes_is_near_the_requested_one_without_duplicates(num_points):
    _, placed_probes = placed(still_life(), num_points)
    assert 0.5 * num_points < placed_probes.probes.num_points <= 1.05 * num_points + 1
    together = np.column_stack([placed_probes.probes.position, placed_probes.probes.normal, placed_probes.material])
    assert len(np.unique(together, axis=0)) == len(together)


def test_nodes_use_nearby_probes():
    """Probes of their own side."""
    geometry, placed_probes = placed(still_life(), 4000)
    lattice, vertices, points = placed_probes.probe_grid, placed_probes.lattice_nodes, placed_probes.probes
    np.testing.assert_allclose(vertices.weight.sum(axis=1), 1, atol=1e-5)
    assert vertices.weight.min() >= 0
    for face, side in np.argwhere(lattice.num_rows > 0)[::37]:
        rows, first = int(lattice.num_rows[face, side]), int(lattice.first[face, side])
        a, b, c = geometry.positions[geometry.faces[face]]
        for i, j in ((0, 0), (rows, 0), (0, rows), (rows // 2, rows // 3 if rows > 2 else 0)):
            node_position = a + (b - a) * (i / rows) + (c - a) * (j / rows)
            vertex = lattice.node_index[first + node_index(rows, i, j)]
            taken = vertices.weight[vertex] @ points.position[vertices.probe[vertex]]
            assert np.linalg.norm(taken - node_position) < 2 * placed_probes.spacing
            outward = np.cross(b - a, c - a) * (1 if side == 0 else -1)
            assert vertices.normal[vertex] @ outward > 0


def test_a_smooth_field_is_smooth_between_probes():
    """The error of interpolating slowly varying light on a mesh finer than its probes is at most its change over 1.5
    spacings, without steps.
    """
    scene = make_tiny_scene(
        sphere("ball", (0, 0, 0), 1.0, 0, num_rings=96), camera=make_camera("front", (0, 0, 4), (0, 0, 0), 0.7)
    )
    _, placed_probes = placed(scene, 600)
    slope = np.array([0.3, 0.5, -0.2], np.float32)
    field = 1 + placed_probes.probes.position @ slope
    shown = np.einsum("vk,vk->v", placed_probes.lattice_nodes.weight, field[placed_probes.lattice_nodes.probe])
    over_a_spacing = float(np.linalg.norm(slope)) * placed_probes.spacing
    assert len(shown) > 4 * 600
    assert np.abs(shown - 1 - placed_probes.lattice_nodes.normal @ slope).max() < 1.5 * over_a_spacing
    # between vertices of a face
    assert np.ptp(shown[placed_probes.probe_grid.node_index.reshape(-1, 3)], axis=1).max() < over_a_spacing


def test_solids_have_probes_outside_and_rooms_inside():
    solid = make_tiny_scene(sphere("ball", (0, 0, 0), 1.0, 0), camera=make_camera("front", (0, 0, 4), (0, 0, 0), 0.7))
    sides = visible_sides(build_scene_buffers(solid), solid.cameras, 3)
    assert sides[:, 0].all()
    assert not sides[:, 1].any()
    room = make_tiny_scene(sphere("room", (0, 0, 0), 1.0, 0), camera=make_camera("front", (0, 0, 0.2), (0, 0, -1), 1.2))
    assert visible_sides(build_scene_buffers(room), room.cameras, 3).all()


def test_a_scene_without_area_is_rejected():
    flat = mesh("line", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], 0, normals=[[0, 1, 0]] * 3)
    geometry = build_scene_buffers(make_tiny_scene(flat, camera=make_camera("front", (0, 1, 3), (0, 0, 0), 0.7)))
    is_open = np.ones((1, 2), bool)
    density = ProbeDensity(make_corner_grid(is_open), np.zeros(6, np.int8))
    with pytest.raises(PlanError, match="no surface"):
        place_probes(geometry, is_open, density, 100)


def test_interpolation_weights_reproduce_the_position_of_a_pixel(free_bake):
    view = free_bake.views["front"]
    gbuffer = trace_primary(free_bake.stored_scene, free_bake.embree, view.camera, (96, 72))
    hit = gbuffer.hits.face >= 0
    np.testing.assert_allclose(gbuffer.weight[hit].sum(axis=1), 1, atol=1e-5)
    assert gbuffer.weight[hit].min() > -1e-5
    of_vertices = interpolate_to_nodes(
        free_bake.stored_scene, gbuffer.is_visible, free_bake.stored_scene.probes.position
    )
    interpolated = np.einsum("nk,nkc->nc", gbuffer.weight, of_vertices[gbuffer.lattice_node])
    expected = view.camera.to_world[:3, 3] + gbuffer.hits.distance[:, None] * gbuffer.directions
    apart = np.linalg.norm(interpolated - expected, axis=1)[hit]
    assert np.median(apart) < 0.03
    vertices = free_bake.stored_scene.lattice_nodes
    assert set(np.flatnonzero(gbuffer.is_visible)) == set(gbuffer.lattice_node[hit].ravel())
    taken = vertices.probe[gbuffer.is_visible > 0][vertices.weight[gbuffer.is_visible > 0] > 0]
    assert set(np.flatnonzero(gbuffer.is_needed)) == set(taken)


def test_probe_radiance_equals_its_reference(free_bake):
    """All light for terms without a highlight; for others without the environment, which does not ring below zero."""
    materials = [
        [{"model": "lambert", "color": [0.5, 0.4, 0.3], "params": {}, "texture": "diffuse"}],
        [{"model": "ward_anisotropic", "color": [0.9, 0.8, 0.7], "params": BROAD_WIDTHS, "texture": None}],
        [{"model": "blinn_phong", "color": [0.2, 0.1, 0.3], "params": {"exponent": 20.0}, "texture": None}],
    ]
    names = len(free_bake.material_names)
    tables = build_tables([materials[k % 3] for k in range(names)])
    rng = np.random.default_rng(9)
    num = free_bake.stored_scene.probes.num_points
    vectors, others = (rng.normal(size=(num, 3, 36)).astype(np.float32) for _ in range(2))
    camera_position = np.array([0.3, 1.2, 2.0], np.float32)
    viewed = free_bake.stored_scene.viewed_from(camera_position, np.ones(num, np.uint8))
    actual = shade_probes(viewed, vectors, others, tables)
    for point in range(0, num, num // 60):
        for arrays, expected in zip(
            actual,
            shade_probes_numpy(free_bake.stored_scene, vectors, others, tables, camera_position, point),
            strict=True,
        ):
            np.testing.assert_allclose(arrays[point], expected, atol=1e-4 * max(1.0, np.abs(expected).max()))
    assert actual.environment.any()
    unneeded = free_bake.stored_scene.viewed_from(camera_position, np.zeros(num, np.uint8))
    none = shade_probes(unneeded, vectors, others, tables)
    assert not none.radiance.any()
    assert not none.environment.any()
    has_highlight = (free_bake.stored_scene.material % 3 > 0) & (actual.radiance[:, 0].max(axis=1) > 0)
    assert has_highlight.any()
    assert not shade_probes(viewed, vectors, None, tables).radiance[has_highlight].any()


def test_textures_of_pixels_equal_those_of_bakes(free_bake):
    """White probes under a texture show the texture; with the filter of view samples."""
    scene, view, size = still_life(), free_bake.views["front"], (96, 72)
    surface = free_bake.stored_scene
    gbuffer = trace_primary(surface, free_bake.embree, view.camera, size)
    outgoing = np.zeros((len(surface.lattice_nodes.normal), 3, 3), np.float32)
    outgoing[:, 1] = 1
    angle = view.camera.yfov / size[1]
    dark = np.zeros((len(free_bake.material_names), 3), np.float32)
    mirrored = MirrorData(
        build_lobes([()] * len(dark)),
        PrefilteredEnvironment(
            free_bake.prefiltered(None),
            free_bake.bright_lights(EnvironmentKey(None, 0.0)),
            rotation_of(0.0),
            np.zeros(3, np.float32),
        ),
        np.zeros((len(outgoing), 3), np.float32),
        np.zeros((len(outgoing), 4), np.float32),
        False,
    )
    all_groups = InterpolatedProbes(outgoing, np.ones((len(dark), 3), bool), np.empty((0, 3), np.float32))
    image = shade_pixels(surface, gbuffer, angle, all_groups, dark, mirrored)
    textured = [k for k, material in enumerate(scene.materials) if "diffuse" in material.textures]
    assert textured
    for index in textured:
        rows = np.flatnonzero(
            (gbuffer.hits.face >= 0) & (surface.face_material[np.maximum(gbuffer.hits.face, 0)] == index)
        )
        corners = surface.faces[gbuffer.hits.face[rows]]
        b = np.column_stack([1 - gbuffer.hits.uv[rows].sum(axis=1), gbuffer.hits.uv[rows]])
        uv = np.einsum("nk,nkc->nc", b, surface.uvs[corners]).astype(np.float32)
        p, q = free_bake.light_transport.local.positions[corners], surface.uvs[corners]
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        area = np.linalg.norm(normal, axis=1)
        cosine = np.maximum(np.abs(np.einsum("nc,nc->n", normal, gbuffer.directions[rows])) / area, 0.05)
        (du0, dv0), (du1, dv1) = (q[:, 1] - q[:, 0]).T, (q[:, 2] - q[:, 0]).T
        footprint = gbuffer.hits.distance[rows] * angle * np.sqrt(np.abs(du0 * dv1 - dv0 * du1) / area / cosine)
        expected = MipMap.for_texture(scene.materials[index].textures["diffuse"]).sample(
            uv, footprint.astype(np.float32)
        )
        np.testing.assert_allclose(image[rows], expected, atol=2e-3)


@pytest.mark.parametrize("rotation", [0.0, 77.0, -130.0])
def test_the_background_equals_fixed_views(rotation):
    rng = np.random.default_rng(2)
    radiance, gain = rng.random((16, 32, 3), np.float32), np.array([1.0, 0.5, 2.0], np.float32)
    directions = rng.normal(size=(500, 3))
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    face, out = np.full(500, -1, np.int32), np.zeros((500, 3), np.float32)
    face[::7] = 3
    sample(radiance, rotation, gain, face, directions, out)
    expected = gain * lookup(radiance, rotate_about_y(directions.astype(np.float64), -rotation).astype(np.float32))
    assert not out[::7].any()
    np.testing.assert_allclose(out[face < 0], expected[face < 0], atol=2e-3)


def test_rays_pass_through_pixel_centers(free_bake):
    camera = Camera("level", np.eye(4), math.radians(90))
    gbuffer = trace_primary(free_bake.stored_scene, free_bake.embree, camera, (4, 2))
    first, last = gbuffer.directions[0], gbuffer.directions[7]
    np.testing.assert_allclose(first * np.sign(first), np.abs(last), atol=1e-6)
    np.testing.assert_allclose(first / -first[2], [-1.5, 0.5, -1], atol=1e-5)
