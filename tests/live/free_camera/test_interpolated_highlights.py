"""Highlights between probes: environment lobes are evaluated per pixel, and only the rest is interpolated."""

import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_scenes import make_camera, make_tiny_scene, mesh, quad, sphere, studio

from relume.assets.environments.equirect import lookup, rotate_about_y, texel_directions
from relume.core.cache import Cache
from relume.lights.prefilter import prefiltered
from relume.lights.sun_disks import BRIGHT_LIGHT_BOUNDS as LAMPS_OF_SKIES
from relume.lights.sun_disks import remove_sun_disks
from relume.live.free_camera import frame as frame_module
from relume.live.free_camera.basis import highlight_lobes as lobes_module
from relume.live.free_camera.basis.highlight_lobes import build_lobes, is_narrow
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS, white_coefficients
from relume.live.free_camera.basis.table_index import MIN_COSINE
from relume.live.free_camera.environment_lookup import build_environment_lookup, rotation_of
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.highlights.interpolated_highlights import ProbeHighlights, add_environment_highlights
from relume.live.free_camera.highlights.lobe_light_lists import (
    _DIRECTION_BINS,
    _SHARPNESS,
    NUM_LISTED,
    NUM_WIDTHS,
    SIDE,
    LobeLightLists,
    build_light_lists,
    lobe_widths,
    sigma_at_width,
)
from relume.live.free_camera.highlights.lobe_visibility import trace_lobe_visibility
from relume.live.free_camera.shade_pixels import shade_pixels
from relume.live.free_camera.shade_probes import ProbeRadiance
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.probes.density import density_from_distance
from relume.probes.mesh_lattice import make_corner_grid, mesh_components, place_probes
from relume.probes.visible_sides import visible_sides
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

GLOSSY = {"model": "blinn_phong", "color": [0.9, 0.6, 0.3], "params": {"exponent": 30.0}}
BROAD_TERM = {"model": "ward_anisotropic", "color": [0.9, 0.6, 0.3], "params": {"alpha_x": 0.5, "alpha_y": 0.35}}
TWO_LOBE_TERM = {"model": "ggx", "color": [0.9, 0.6, 0.3], "params": {"roughness": 0.6, "f0": 0.9}}
NARROW = {"model": "blinn_phong", "color": [0.9, 0.6, 0.3], "params": {"exponent": 3000.0}}
CAMERA = make_camera("front", [0, 0.5, 3], [0, 0, 0], 0.75)


def lists_numpy(lobe_lights: LobeLightLists, width: int, bin_index: int) -> NDArray[np.intp]:
    """Reference of a light list in plain NumPy, in any order.

    Args:
        lobe_lights: the lights. width, bin_index: of the list.
    """
    centers, farthest = _DIRECTION_BINS
    lights = lobe_lights.lights.astype(np.float64)
    angle = np.maximum(np.arccos(np.clip(lights[:, :3] @ centers[bin_index], -1, 1)) - farthest[bin_index], 0)
    variance = sigma_at_width(width) ** 2 + lights[:, 3]
    weight = lights[:, 4] / variance * np.maximum(1 - (1 - np.cos(angle)) / (_SHARPNESS * variance), 0) ** _SHARPNESS
    heaviest = np.argsort(-weight)[:NUM_LISTED]
    return np.asarray(heaviest[weight[heaviest] > 0])


def ball(terms):
    material = Material("Ball", terms)
    return make_tiny_scene(
        sphere("ball", [0, 0, 0], 1, 0, 48), camera=CAMERA, environment=studio(64, 20.0), materials=[material]
    )


def opened(scene, method, folder, num_points=400):
    recipe = Recipe(method, ("front",), (64, 48), 2000, num_probes=num_points)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def picture_of(bake):
    return render_image(bake, "front", validate(complete({}, bake.default_look), bake.default_look))


@pytest.fixture(scope="module")
def shiny_ball(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    scene = ball((GLOSSY,))
    return opened(scene, "probes", folder), picture_of(opened(scene, "direct", folder))


def test_highlights_of_few_probes_equal_a_fixed_view(shiny_ball, monkeypatch):
    """A few hundred probes under a bright light; without their lobes the highlights are patchy."""
    free_bake, expected = shiny_ball

    def error():
        actual = picture_of(free_bake)
        return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))

    interpolated_error = error()
    monkeypatch.setattr(lobes_module, "_has_highlight", lambda probes: False)
    assert interpolated_error < 0.08
    assert error() > 2.5 * interpolated_error


def test_probes_subtract_at_most_half_of_a_pixels_lobe(shiny_ball, monkeypatch):
    def shown_beside(broad):
        def changed(surface, gbuffer, pixel_angle, outgoing, *others):
            return shade_pixels(
                surface,
                gbuffer,
                pixel_angle,
                outgoing._replace(radiance=np.full_like(outgoing.radiance, broad)),
                *others,
            )

        monkeypatch.setattr(frame_module, "shade_pixels", changed)
        return picture_of(shiny_ball[0])[18:30, 26:38]  # the center of the ball, without edges, which have more rays

    alone, limit = shown_beside(0.0), shown_beside(-1e4)
    assert alone.max() > 0.1
    np.testing.assert_allclose(limit, alone / 2, rtol=1e-5, atol=1e-7)


BRIGHT_LIGHTS = np.array([[0.0, 0.6, 0.8, 3.0, 2.0, 1.0, 3e-4], [1.0, 0.0, 0.0, 0.5, 1.0, 2.0, 1e-3]], np.float32)


def lobe_environment(rotation=0.0, gain=(1.0, 0.5, 2.0), bright_lights=BRIGHT_LIGHTS):
    rng = np.random.default_rng(5)
    lookup_tables = build_environment_lookup(
        rng.random((16, 32, 3), np.float32), lambda degrees: rng.random((16, 32, 3), np.float32)
    )
    return PrefilteredEnvironment(lookup_tables, bright_lights, rotation_of(rotation), np.array(gain, np.float32))


def lobe_lookup(lobes, surface, camera_position, point):
    """Lobe tables for a probe in plain NumPy: lookup function, normal, and reflected direction."""
    lobe = lobes.lobe_index[surface.material[point]]
    n = surface.probes.normal[point].astype(np.float64)
    wo = camera_position - surface.probes.position[point].astype(np.float64)
    wo /= np.linalg.norm(wo)
    row_position = np.sqrt(1 - np.clip(wo @ n, MIN_COSINE, 1)) * (NUM_ROWS - 1)
    row = min(int(row_position), NUM_ROWS - 2)
    aside = (wo @ n) * n - wo

    def at(table):
        return table[lobe, row] + (row_position - row) * (table[lobe, row + 1] - table[lobe, row])

    return at, n, aside / np.linalg.norm(aside)


def two_lobes_numpy(lobes, surface, camera_position, point):
    """Directions, weights and σ of both lobes of a probe."""
    at, n, aside = lobe_lookup(lobes, surface, camera_position, point)
    directions = [np.sqrt(1 - cosine**2) * aside + cosine * n for cosine in at(lobes.cosine)]
    return np.array(directions), np.array([at(lobes.first), 1 - at(lobes.first)]), at(lobes.sigma)


def one_lobe_numpy(lobes, surface, camera_position, point):
    """Direction, weight and width of a pixel's lobe at a probe."""
    at, n, aside = lobe_lookup(lobes, surface, camera_position, point)
    return (np.sqrt(1 - at(lobes.mean) ** 2) * aside + at(lobes.mean) * n)[None], np.ones(1), at(lobes.single_sigma)


def environment_in_lobes_numpy(directions, shares, sigma, light, visibility):
    """Reference of the environment in lobes in plain NumPy. (3,)"""
    every = zip(directions, shares, np.broadcast_to(sigma, shares.shape), strict=True)
    return sum(
        fraction * environment_in_lobe_numpy(direction, width, light, visibility)
        for direction, fraction, width in every
    )


def environment_in_lobe_numpy(direction, sigma, light, visibility):
    """Environment light in one lobe."""
    level = np.clip(2 * np.log2(np.degrees(sigma) / 2) + 1, 0, len(light.environment.levels) - 1)
    rotated = rotate_about_y(direction[None], 360 * (0.5 - float(light.rotation)))
    total = np.zeros(3)
    for k, fraction in ((int(level), 1 - level % 1), (int(np.ceil(level)), level % 1)):
        first, height, width = light.environment.levels[k]
        radiance = light.environment.texels[first : first + height * width].reshape(height, width, 3)
        total += fraction * lookup(radiance, rotated.astype(np.float32))[0]
    shown = visibility[0] * total
    for k, bright_light in enumerate(light.bright_lights.astype(np.float64)):
        towards, power, per = bright_light[:3], bright_light[3:6], 1 / (sigma**2 + bright_light[6])
        density = np.exp(per * (direction @ towards - 1)) * per / (2 * np.pi) / (1 - np.exp(-2 * per))
        shown = shown + visibility[1 + k] * min(level, 1) * density * power
    return shown * light.gain


@pytest.mark.parametrize("term", [BROAD_TERM, GLOSSY, TWO_LOBE_TERM])
@pytest.mark.parametrize(("rotation", "is_fine"), [(0.0, False), (123.0, False), (123.0, True)])
def test_probes_add_the_difference_to_the_lobe_of_pixels(shiny_ball, term, rotation, is_fine):
    free_bake, _ = shiny_ball
    surface, rng, light = free_bake.stored_scene, np.random.default_rng(7), lobe_environment(rotation)
    num, camera_position = surface.probes.num_points, np.array([0.4, 1.5, 3.0], np.float32)
    visibility = rng.random((num, 3), np.float32)
    lobes = build_lobes([[{**term, "texture": "diffuse"}]])
    assert (lobes.max_ratio[0] > 1) == (lobes.lobe_confidence == 1).all() == (term is not TWO_LOBE_TERM)
    lit = rng.random((num, 3), np.float32)
    environment_light = rng.normal(1, 2, size=(num, 3, 3)).astype(np.float32)
    sent = np.zeros((num, 3, 3), np.float32)
    is_needed = (np.arange(num) % 3 > 0).astype(np.uint8)
    viewed, highlights = surface.viewed_from(camera_position, is_needed), ProbeHighlights(visibility, lit)
    outgoing = ProbeRadiance(sent, environment_light)
    add_environment_highlights(viewed, lobes, light, highlights, surface.normal_variation, outgoing, is_fine=is_fine)
    assert not sent[is_needed == 0].any()
    held, max_ratio = 0, float(lobes.max_ratio[0])
    for point in np.flatnonzero(is_needed)[::17]:
        at, _, _ = lobe_lookup(lobes, surface, camera_position.astype(np.float64), point)
        with_lights, shown = (
            environment_in_lobes_numpy(
                *lobe(lobes, surface, camera_position.astype(np.float64), point), light, visibility[point]
            )
            for lobe in (two_lobes_numpy, two_lobes_numpy if is_fine or lobes.is_two[0] else one_lobe_numpy)
        )
        reference, actual = (
            at(lobes.albedo) * (at(lobes.lobe_confidence) * with_lights + lit[point] * light.gain),
            at(lobes.albedo) * shown,
        )
        expected = np.clip(environment_light[point], reference / max_ratio, reference * max_ratio)
        held += int((expected != environment_light[point]).sum()) if term is not TWO_LOBE_TERM else 9
        np.testing.assert_allclose(
            sent[point], expected - actual, rtol=2e-3, atol=3e-4 * max(1, np.abs(reference).max())
        )
    assert held > 3
    assert sent[:, 1].any()
    assert not sent[:, [0, 2]].any()


def test_lobes_narrower_than_lights_use_the_lobe_only(shiny_ball):
    surface, rng = shiny_ball[0].stored_scene, np.random.default_rng(7)
    assert is_narrow(white_coefficients(NARROW))
    lobes = build_lobes([[NARROW, GLOSSY]])
    assert lobes.max_ratio.tolist() == [1]
    np.testing.assert_allclose(lobes.lobe_confidence, 1, atol=1e-5)
    num = surface.probes.num_points
    sent, everywhere = np.zeros((num, 3, 3), np.float32), np.ones(num, np.uint8)
    environment_light = rng.normal(size=(num, 3, 3)).astype(np.float32)
    camera_position, visibility = CAMERA.to_world[:3, 3], np.ones((num, 3), np.float32)
    nothing, light = np.zeros((num, 3), np.float32), lobe_environment()
    viewed, highlights = surface.viewed_from(camera_position, everywhere), ProbeHighlights(visibility, nothing)
    outgoing = ProbeRadiance(sent, environment_light)
    add_environment_highlights(viewed, lobes, light, highlights, surface.normal_variation, outgoing, is_fine=True)
    assert np.abs(sent).max() < 1e-4 * lobes.albedo.max()


def test_lobe_visibility_equals_the_visibility_bits(shiny_ball):
    surface, rng = shiny_ball[0].stored_scene, np.random.default_rng(3)
    num, num_lights, lobes = surface.probes.num_points, 20, build_lobes([[NARROW]])
    directions = rng.normal(size=(num_lights, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lobe_weights = np.zeros((2, num_lights), np.float32)
    lobe_weights[0, [2, 5]], lobe_weights[1, 11] = (0.25, 0.75), 1
    radius, luminous = (rng.uniform(low, high, num_lights).astype(np.float32) for low, high in ((0.3, 0.8), (1, 9)))
    listed = build_light_lists(directions, radius, luminous, lobe_weights, lobe_widths(lobes))
    bits = rng.integers(0, 2, (num, 8 * ((num_lights + 7) // 8)), np.uint8)
    camera_position, is_needed = np.array([0.4, 1.5, 3.0], np.float32), (np.arange(num) % 3 > 0).astype(np.uint8)
    viewed = surface.viewed_from(camera_position, is_needed)
    actual = trace_lobe_visibility(viewed, np.packbits(bits, axis=1, bitorder="little"), listed, lobes)
    assert not actual[is_needed == 0].any()
    for point in np.flatnonzero(is_needed)[::13]:
        towards, shares, sigma = two_lobes_numpy(lobes, surface, camera_position.astype(np.float64), point)
        center = shares @ towards
        size = np.linalg.norm(center)
        variance = shares @ sigma**2 + 1 - size + listed.lights[:, 3].astype(np.float64)
        weight = luminous / variance * np.maximum(1 - (1 - directions @ center / size) / (8 * variance), 0) ** 8
        if not weight.any():
            continue  # no light is near the lobe
        expected = weight @ bits[point, :num_lights] / weight.sum()
        fractions = [expected, *(lobe_weights @ bits[point, :num_lights])]
        np.testing.assert_allclose(actual[point], fractions, atol=2e-3)


@pytest.mark.parametrize("width", [0, 3, 9])
def test_light_lists_have_the_lights_of_largest_weight(width):
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(300, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radius, luminous = rng.uniform(0.02, 0.3, 300).astype(np.float32), rng.uniform(0, 9, 300).astype(np.float32)
    listed = build_light_lists(directions, radius, luminous, np.zeros((0, 300), np.float32), (width,))
    for square in range(0, SIDE * SIDE, 31):
        light_list = listed.lists[listed.first[width] + square]
        assert set(light_list[light_list >= 0]) == set(lists_numpy(listed, width, square))


def test_light_lists_are_full_if_weights_are_equal():
    directions, radius = np.tile(np.array([0, 0.6, 0.8], np.float32), (100, 1)), np.full(100, 0.1, np.float32)
    luminous = np.where(np.arange(100) < 20, 2, 1).astype(np.float32)
    none = np.zeros((0, 100), np.float32)
    for light_list in build_light_lists(directions, radius, luminous, none, (NUM_WIDTHS - 1,)).lists:
        assert len(set(light_list)) == NUM_LISTED
        assert set(range(20)) < set(light_list) <= set(range(100))
    few = np.where(np.arange(100) < 90, 0, 1).astype(np.float32)
    light_list = {tuple(each[each >= 0]) for each in build_light_lists(directions, radius, few, none, (0,)).lists}
    assert light_list == {(), tuple(range(90, 100))}


@pytest.mark.parametrize("degrees", [4.0, 16.0])
def test_prefiltered_environment_and_bright_light_sum_to_the_whole(degrees):
    """A bright region of two degrees, too wide for a sun disk."""
    towards, axis = texel_directions(256, 512), np.array([0.0, 0.6, 0.8])
    radiance = np.where((towards @ axis > np.cos(np.radians(2)))[..., None], 3000.0, 1 + towards[..., 1:2] ** 2)
    whole = np.repeat(radiance, 3, axis=2).astype(np.float32)
    assert not remove_sun_disks(whole).sun_disks
    (disk,), beside = remove_sun_disks(whole, LAMPS_OF_SKIES)
    spread = 1 - np.linalg.norm(disk.mean)
    expected, rest, per = (
        prefiltered(whole, degrees),
        prefiltered(beside, degrees),
        1 / (np.radians(degrees) ** 2 + spread),
    )
    cosine = texel_directions(*expected.shape[:2]) @ disk.mean / np.linalg.norm(disk.mean)
    density = np.exp(per * (cosine - 1)) * per / (2 * np.pi) / (1 - np.exp(-2 * per))
    actual = rest + density[..., None] * disk.irradiance
    assert np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2)) < 0.03
    assert np.sqrt(np.mean((rest - expected) ** 2) / np.mean(expected**2)) > 0.5


def test_a_surface_interpolates_its_own_probes_only():
    """Two balls that almost touch, and a ground: probes of the other ball are as near, with the same normals."""
    balls = [sphere(f"ball {k}", [0.102 * k, 0.05, 0], 0.05, 0, 24) for k in range(2)]
    ground = quad("ground", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 1)
    materials = [Material(name, ({"model": "lambert", "color": [1, 1, 1]},)) for name in ("Balls", "Ground")]
    scene = make_tiny_scene(*balls, ground, camera=make_camera("front", [0, 1, 3], [0, 0, 0], 0.5), materials=materials)
    geometry, camera_positions = build_scene_buffers(scene), np.array([[0.0, 1.0, 3.0]])
    is_open = visible_sides(geometry, scene.cameras, 1)
    placed = place_probes(
        geometry, is_open, density_from_distance(geometry, camera_positions, make_corner_grid(is_open)), 1500
    )
    vertices, points = placed.lattice_nodes, placed.probes
    of_ball = placed.material[vertices.probe[:, 0]] == 0
    position = np.einsum("vk,vkc->vc", vertices.weight, points.position[vertices.probe])
    for vertex in np.flatnonzero(of_ball):
        taken = points.position[vertices.probe[vertex][vertices.weight[vertex] > 0], 0]
        assert len(np.unique(taken > 0.051)) == 1, position[vertex]


def test_faces_are_connected_by_vertex_positions():
    """Vertices that differ in normals or textures only are one position."""
    apart = [
        mesh("a", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 0),
        mesh("b", [[1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2]], 0),
    ]
    far = mesh("c", [[5, 0, 0], [6, 0, 0], [5, 1, 0]], [[0, 1, 2]], 0)
    components = mesh_components(build_scene_buffers(make_tiny_scene(*apart, far, camera=CAMERA)))
    assert components[0] == components[1] != components[2]
