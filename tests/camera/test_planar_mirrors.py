"""Lights visible in planar mirrors, against geometry; light reflected by them, against a sun behind the mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from session_edits import make_look, relative_rmse, run_next_job, run_until_exact
from tiny_scenes import make_camera, make_surface_points, make_tiny_scene, quad, sphere

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.brdf.fresnel import schlick
from relume.brdf.lobe_sampling import sample_lobe
from relume.brdf.roughness_levels import NO_LEVELS
from relume.camera.planar_mirrors import find_planar_mirrors, lights_visible_in_mirrors
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake, open_transfer
from relume.live.opened.static_view import StaticViewBuilder
from relume.look.document import MAX_BOUNCES
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.transport.shading_points import MirrorRays

F0, COLOR, ALBEDO, ROWS = 0.7, 0.8, 0.6, 64
MIRROR = Material("Mirror", ({"model": "ggx", "color": [COLOR] * 3, "params": {"roughness": 0.03, "f0": F0}},))
FLOOR = Material("Floor", ({"model": "lambert", "color": [ALBEDO] * 3},))
SUN = 20, 62  # texel: 35° high, above +X


def hall(*others):
    """A mirror at x = −1, one high and four wide, that reflects light from +X onto a floor."""
    wall = quad("mirror", [[-1, 0, 2], [-1, 0, -2], [-1, 1, -2], [-1, 1, 2]], 0, tangent=(0, 0, 1))
    floor = quad("floor", [[-1, 0, 2], [3, 0, 2], [3, 0, -2], [-1, 0, -2]], 1)
    light = np.full((ROWS, 2 * ROWS, 3), 1e-4, np.float32)
    light[SUN] = 500
    return make_tiny_scene(
        floor, wall, *others, camera=make_camera("front", (1.0, 6.0, 0.01), (1.0, 0, 0), 0.6), environment=light,
        materials=[MIRROR, FLOOR],
    )  # fmt: skip


def sun():
    return texel_directions(ROWS, 2 * ROWS)[SUN].astype(np.float64)


def test_lights_are_visible_in_mirrors_unless_occluded():
    lid = quad("lid", [[-0.5, 0.2, 1], [0.5, 0.2, 1], [0.5, 0.2, 0], [-0.5, 0.2, 0]], 1)
    geometry = build_scene_buffers(hall(lid))
    x, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.9, 2.5, 35), np.linspace(-1.5, 1.5, 31)))
    floor = make_surface_points(np.stack([x, 0 * x + 1e-4, z], axis=1), np.tile([0, 1, 0], (len(x), 1)))
    lights = np.array([[0.8, 0.6, 0], [-0.8, 0.6, 0], [0.6, 0.5, 0.62449980]], np.float32)
    mirrored = lights_visible_in_mirrors(geometry, find_planar_mirrors(hall(lid), geometry), floor, lights)
    visible = np.unpackbits(mirrored.visible, axis=1, bitorder="little")[:, :3].astype(bool)
    for light, of_light in zip(lights.astype(float), visible.T, strict=True):
        going, back = (
            0.2 / light[1] * light[axis] for axis in (0, 2)
        )  # to the lid's height, and its displacement along z
        reach = (x + 1) / max(light[0], 1e-9)
        height, aside = reach * light[1], z + reach * light[2]
        is_met = (light[0] > 0) & (height < 1) & (np.abs(aside) < 2)
        x_there, z_there, x_back = x - going, z + back, -1 + (going - (x + 1))
        is_before = height > 0.2  # the mirror, along the ray
        across = np.where(is_before, x_there, x_back)
        is_hidden = (np.abs(across) < 0.5) & (np.abs(z_there - 0.5) < 0.5)
        edges = height - 1, np.abs(aside) - 2, np.abs(across) - 0.5, np.abs(z_there - 0.5) - 0.5
        is_clear = np.abs(edges).min(axis=0) > 0.02
        np.testing.assert_array_equal(of_light[is_clear], (is_met & ~is_hidden)[is_clear])
    assert visible[:, 0].any()
    assert not visible[:, 1].any()
    assert visible[:, 2].any()


def test_curved_normal_mapped_and_rough_mirrors_are_not_planar():
    def planes(scene):
        return find_planar_mirrors(scene, build_scene_buffers(scene)).num_planes

    scene, behind = hall(), quad("back", [[-1, 0, -2], [-1, 0, 2], [-1, 1, 2], [-1, 1, -2]], 0, tangent=(0, 0, 1))
    rough = {**MIRROR.terms[0], "params": {"roughness": 0.3, "f0": F0}}
    assert planes(scene) == 1
    assert planes(hall(behind)) == 1
    assert planes(hall(sphere("ball", [1, 1, 0], 0.4, 0))) == 1
    assert planes(replace(scene, materials=(replace(MIRROR, terms=(rough,)), FLOOR))) == 0


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    recipe = Recipe("gather", ("front",), (64, 32), 400, num_patches=1024, gather_rays=64)
    target = tmp_path_factory.mktemp("thrown") / "gather.zarr"
    return open_transfer(bake_in_process(METHODS["gather"], hall(), recipe, target), Cache(1 << 30))


def mirrored_light(transfer, change=lambda document: None):
    """Light reflected by surfaces onto the middle row of the floor, and its positions. (pixels,) each"""
    pictures = []
    for kind in ("all", "direct"):

        def shows(document, kind=kind):
            change(document)
            document["transport"] |= {"show": kind, "bounces": 1}

        (view,) = transfer.views
        pictures.append(render_image(transfer, view, make_look(transfer, shows)).astype(float)[16, :, 0])
    half = np.tan(0.3) * 6
    x = 1 + (np.arange(64) + 0.5 - 32) / 16 * half
    return x, pictures[0] - pictures[1]


def in_the_patch():
    """Light of the sun by the mirror, as from a sun behind the mirror."""
    across = 500 * texel_solid_angles(ROWS, 2 * ROWS)[SUN[0]]
    return ALBEDO / np.pi * across * sun()[1] * COLOR * float(schlick(np.array(sun()[0]), F0))


@pytest.fixture(scope="module")
def static(tmp_path_factory):
    """A static view of a free camera."""
    recipe = Recipe("probes", ("front",), (64, 32), 400, num_probes=300, num_patches=1024, gather_rays=64)
    target = tmp_path_factory.mktemp("resting") / "probes.zarr"
    free_bake = open_bake(bake_in_process(METHODS["probes"], hall(), recipe, target), Cache(1 << 30))
    builder, camera = StaticViewBuilder(free_bake.light_transport, hall()), free_bake.views["front"].camera
    return builder.make_static_view(camera, (64, 32), True, lambda fraction: None, lambda: False)


@pytest.mark.parametrize("bake", ["lit", pytest.param("static", marks=pytest.mark.slow)])
def test_a_planar_mirror_reflects_the_sun_within_its_extent(bake, request):
    x, radiance = mirrored_light(request.getfixturevalue(bake))
    edge = -1 + sun()[0] / sun()[1]
    inside, outside = (x > -0.7) & (x < edge - 0.15), (x > edge + 0.15) & (x < 2.5)
    np.testing.assert_allclose(radiance[inside], in_the_patch(), rtol=0.01)
    assert np.abs(radiance[outside]).max() < 0.01 * in_the_patch()


def test_mirror_light_follows_the_material_until_a_lobe_replaces_it(lit):
    def with_term(**fields):
        def change(document):
            document["materials"]["Mirror"]["terms"][0] |= fields

        return mirrored_light(lit, change)

    x, whole = mirrored_light(lit)
    _, dim = with_term(color=[COLOR / 2] * 3)
    _, half = with_term(params={"roughness": 0.05, "f0": F0})
    _, rough = with_term(params={"roughness": 0.2, "f0": F0})
    inside = np.abs(x) < 0.15
    np.testing.assert_allclose(dim[inside], whole[inside] / 2, rtol=0.03)
    # a narrow lobe reflects it there, too
    np.testing.assert_allclose(half[inside].mean(), whole[inside].mean(), rtol=0.15)
    beside = (x > 0.65) & (x < 0.95)
    assert whole[beside].max() < 0.02 * whole[inside].mean() < half[beside].mean() < rough[beside].mean()


def test_a_color_edit_of_the_mirror_updates_its_reflected_light(lit):
    """Within 1 % during the edit, while lobes instead of mirror lights would be 10 % off; exact when it stops."""

    def colored(color):
        def change(document):
            document["materials"]["Mirror"]["terms"][0]["color"] = [color] * 3
            document["transport"]["bounces"] = 1

        return make_look(lit, change)

    picture = Picture(lit, "front", lit.cache)
    picture.set_look(colored(COLOR))
    run_until_exact(picture)
    for color in (0.5, 0.1):
        picture.set_look(colored(color), active_pointer="/materials/Mirror/terms/0/color")
        while picture.advance(None).fidelity != "incremental":
            run_next_job(picture)
        exact = render_image(lit, "front", colored(color))
        assert 1e-6 < relative_rmse(picture.image(), exact) < 0.01
    assert relative_rmse(run_until_exact(picture).image(), exact) < 1e-6


@pytest.mark.parametrize(("bounces", "is_lit"), [(1, True), (MAX_BOUNCES, False)])
def test_a_narrow_lobe_whose_rays_follow_the_mirror_does_not_see_its_lights_again(lit, bounces, is_lit):
    def change(document):
        document["transport"]["bounces"] = bounces

    light = illumination_from_look(make_look(lit, change), lit.material_names, has_bounces=True)
    metal = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.1, "f0": 0.9}}
    samples = lit.samples(lit.views["front"], 1, lit.cache)
    _, receivers = lit.incident_light(samples, light, lobe=sample_lobe(metal, NO_LEVELS))
    (mirrored,) = (rays for rays in receivers.rays if isinstance(rays, MirrorRays))
    assert (mirrored.normal_irradiance.max() > 0) == is_lit
