"""Mirrors: their images against those of mirrored cameras, and edits of mirrors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy_reference import unit
from session_edits import make_look, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.assets.environments.equirect import lookup, texel_directions
from relume.brdf.fresnel import schlick
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.camera_rays import camera_directions
from relume.scene.light_members import members_of
from relume.scene.model import Light, Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (64, 48)
F0 = [0.9, 0.6, 0.3]
RED = Material("Red", ({"model": "lambert", "color": [0.8, 0.2, 0.1]},))
GREEN = Material("Green", ({"model": "lambert", "color": [0.1, 0.7, 0.2]},))


def metal(roughness=0.03, name="Mirror"):
    term = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": roughness, "f0": F0}}
    return Material(name, (term,))


def box(name, x, material):
    """A sphere that stands for an object in a room."""
    return sphere(name, [x, 0.1, 0.6], 0.35, material, num_rings=24)


def room(mirror, light=None):
    """A mirror at z = −1 that fills the image, and two objects, one between the mirror and the camera."""
    wall = quad("mirror", [[-4, -4, -1], [4, -4, -1], [4, 4, -1], [-4, 4, -1]], 0)
    camera = make_camera("front", (0, 0.3, 2.4), (0.2, 0, -1), 0.8)
    return make_tiny_scene(
        wall, box("left", -0.9, 1), box("right", 1.0, 2), camera=camera, materials=[mirror, RED, GREEN],
        environment=studio(64) if light is None else light,
    )  # fmt: skip


def baked(scene, folder, method="direct", size=SIZE):
    recipe = Recipe(method, tuple(camera.name for camera in scene.cameras), size, 400)
    return open_transfer(bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def shown(transfer, change=lambda document: None):
    return render_image(transfer, "front", make_look(transfer, change)).astype(float)


def through_the_mirror(scene):
    """View the scene from behind the removed mirror: the image that the mirror shows."""
    flip = np.diag([1.0, 1.0, -1.0, 1.0])
    flip[2, 3] = -2.0
    to_world = (
        flip @ scene.cameras[0].to_world @ np.diag([-1.0, 1.0, 1.0, 1.0])
    )  # swaps right and left to stay right-handed
    return make_tiny_scene(
        *scene.meshes[1:], camera=replace(scene.cameras[0], to_world=to_world), materials=list(scene.materials),
        environment=scene.environment.radiance,
    )  # fmt: skip


@pytest.fixture(scope="module")
def mirror_bake(tmp_path_factory):
    return baked(room(metal()), tmp_path_factory.mktemp("mirrors"))


def angles(scene, size=SIZE):
    """Angles of all pixels at the mirror. (height, width)"""
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    rays = camera_directions(scene.cameras[0], size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    return rays, np.abs(rays[:, 2]).reshape(size[1], size[0])


def test_a_mirror_shows_the_image_of_a_mirrored_camera(tmp_path):
    light = studio(64)
    light[texel_directions(64, 128)[..., 2] < 0] = 0  # light that the wall would occlude
    scene = room(metal(), light)
    transfer = baked(scene, tmp_path / "mirror")
    expected = shown(baked(through_the_mirror(scene), tmp_path / "behind"))[:, ::-1]
    _, cosine = angles(scene)
    wanted = expected * np.stack([schlick(cosine, f0) for f0 in F0], axis=-1)
    is_mirror = transfer.views["front"].material_ids() == 0
    away = np.abs(shown(transfer) - wanted)[is_mirror]
    assert (wanted[is_mirror] > 0.01).mean() > 0.5
    assert np.quantile(away, 0.95) < 0.01 * wanted[is_mirror].mean()


def test_a_chrome_ball_reflects_the_environment(tmp_path):
    ball = sphere("ball", [0, 0, 0], 0.8, 0, num_rings=200)
    scene = make_tiny_scene(
        ball, camera=make_camera("front", (0, 0.3, 3), (0, 0, 0), 0.6), environment=studio(128), materials=[metal()]
    )
    picture = shown(baked(scene, tmp_path))
    rays, _ = angles(scene)
    camera_position = scene.cameras[0].to_world[:3, 3]
    along = rays.astype(float) @ camera_position
    root = along**2 - (camera_position @ camera_position - 0.64)
    on = root > 0.03
    normal = (camera_position + (-along - np.sqrt(np.maximum(root, 0)))[:, None] * rays) / 0.8
    cosine = -np.einsum("nc,nc->n", normal, rays)
    rotated = rays + 2 * cosine[:, None] * normal
    wanted = lookup(scene.environment.radiance, unit(rotated).astype(np.float32)) * np.stack(
        [schlick(np.clip(cosine, 0, 1), f0) for f0 in F0], axis=-1
    )
    difference = np.abs(picture.reshape(-1, 3) - wanted)[on]
    assert np.median(difference / wanted[on].clip(1e-3)) < 0.01


def test_facing_mirrors_terminate(tmp_path):
    front = quad("front", [[-2, -2, -1], [2, -2, -1], [2, 2, -1], [-2, 2, -1]], 0)
    back = quad("back", [[2, -2, 3], [-2, -2, 3], [-2, 2, 3], [2, 2, 3]], 0)
    camera = make_camera("front", (0, 0.1, 1), (0.1, 0, -1), 0.8)
    scene = make_tiny_scene(front, back, camera=camera, environment=studio(), materials=[metal()])
    transfer = baked(scene, tmp_path)
    mirrored = transfer.views["front"].mirrored
    assert mirrored.chain.material.shape[1] == 2
    assert (mirrored.chain.material == 0).all(axis=1).any()
    assert np.isfinite(shown(transfer)).all()
    assert shown(transfer).mean() > 0.01  # the last one reflects with its lobe


def set_roughness(value):
    def change(document):
        document["materials"]["Mirror"]["terms"][0]["params"]["roughness"] = value

    return change


def test_a_roughened_mirror_is_a_lobe(mirror_bake, tmp_path):
    rough = baked(room(metal(0.3)), tmp_path)
    assert rough.views["front"].mirrored is None
    away = np.abs(shown(mirror_bake, set_roughness(0.3)) - shown(rough))
    assert np.quantile(away, 0.9) < 1e-5  # except for pixels with more samples of their mirror image


def test_a_mirror_stays_until_its_lobe_is_ready(mirror_bake):
    picture = Picture(mirror_bake, "front", Cache(1 << 30))
    sharp, wanted = run_until_exact(picture).image(), shown(mirror_bake, set_roughness(0.3))
    is_mirror = mirror_bake.views["front"].material_ids() == 0
    for time in ("first", "second"):
        picture.set_look(make_look(mirror_bake, set_roughness(0.3)))
        step, at_once = picture.advance(None), picture.image()
        if time == "first":
            assert not step.exact
            np.testing.assert_array_equal(at_once, sharp)
        lobe = run_until_exact(picture).image()
        np.testing.assert_allclose(lobe, wanted, atol=1e-4)
        assert min(np.abs(at_once - other)[is_mirror].max() for other in (sharp, lobe)) < 1e-4
        picture.set_look(make_look(mirror_bake))
        picture.advance(None)
        np.testing.assert_allclose(picture.image()[is_mirror], sharp[is_mirror], atol=1e-4)
        run_until_exact(picture)


def test_a_mirror_stays_while_new_light_is_computed(mirror_bake):
    def rough_and_turned(document):
        set_roughness(0.3)(document)
        document["environment"]["rotation"] = 90.0

    picture = Picture(mirror_bake, "front", Cache(1 << 30))
    run_until_exact(picture)
    picture.prepare("/materials/Mirror/terms/0/params/roughness")  # the operator that the edit would use
    sharp = run_until_exact(picture).image()
    picture.set_look(make_look(mirror_bake, rough_and_turned))
    assert not picture.advance(None).exact
    np.testing.assert_array_equal(picture.image(), sharp)
    np.testing.assert_allclose(run_until_exact(picture).image(), shown(mirror_bake, rough_and_turned), atol=1e-4)


def test_mirror_and_lobe_are_blended(mirror_bake):
    sharp, soft = shown(mirror_bake, set_roughness(0.03)), shown(mirror_bake, set_roughness(0.06))
    half = shown(mirror_bake, set_roughness(0.05))
    is_mirror = mirror_bake.views["front"].material_ids() == 0
    assert np.abs(half - (sharp + soft) / 2)[is_mirror].mean() < 0.1 * np.abs(sharp - soft)[is_mirror].mean()


def test_a_drawn_highlight_is_a_lobe(mirror_bake):
    def draw(document):
        term = document["materials"]["Mirror"]["terms"][0]
        term["curves"] = {"theta_h": {"points": [[0, 0], [90, 0]], "channels": "rgb"}}

    is_mirror = mirror_bake.views["front"].material_ids() == 0
    inside = np.zeros_like(is_mirror)
    inside[10:-10, 20:-20] = is_mirror[10:-10, 20:-20]
    assert shown(mirror_bake, draw)[inside].max() < 1e-6


def test_mirror_color_and_fresnel_curve_multiply(mirror_bake):
    plain = shown(mirror_bake)

    def edit(document):
        term = document["materials"]["Mirror"]["terms"][0]
        term["color"] = [0.5, 1.0, 2.0]
        term["curves"] = {"theta_d": {"points": [[0, 0.25], [90, 0.25]], "channels": "rgb"}}

    _, cosine = angles(room(metal()))
    was = np.stack([schlick(cosine, f0) for f0 in F0], axis=-1)
    is_mirror = mirror_bake.views["front"].material_ids() == 0
    lit = is_mirror & (plain.min(axis=-1) > 0.01)
    ratio = (shown(mirror_bake, edit) / np.maximum(plain, 1e-6))[lit]
    np.testing.assert_allclose(np.median(ratio / (0.25 * np.array([0.5, 1, 2]) / was[lit]), axis=0), 1, rtol=0.01)


def test_edits_of_a_mirror_end_at_the_render(mirror_bake):
    picture = Picture(mirror_bake, "front", Cache(1 << 30))
    for roughness in (0.03, 0.3, 0.045, 0.03):
        look = make_look(mirror_bake, set_roughness(roughness))
        picture.set_look(look)
        run_until_exact(picture)
        np.testing.assert_allclose(picture.image(), render_image(mirror_bake, "front", look), rtol=1e-4, atol=1e-5)


def test_a_mirror_edit_sends_its_tiles_and_picking_hits_the_mirror(mirror_bake):
    picture = Picture(mirror_bake, "front", Cache(1 << 30))
    picture.set_look(make_look(mirror_bake))
    run_until_exact(picture)
    picture.advance(None)

    def tinted(document):
        document["materials"]["Mirror"]["terms"][0]["color"] = [1, 0.5, 0.5]

    picture.set_look(make_look(mirror_bake, tinted))
    assert set(mirror_bake.views["front"].material_tiles[0]) <= set(picture.advance(None).tiles)
    assert picture.inspect(SIZE[0] // 2, 4)["material"] == "Mirror"


def test_mirrors_reflect_the_environment_for_any_background(mirror_bake):
    def colored(document):
        document["background"] = {"kind": "color", "color": [0, 1, 0], "blur": 10.0}

    is_mirror = mirror_bake.views["front"].material_ids() == 0
    np.testing.assert_allclose(
        shown(mirror_bake, colored)[is_mirror], shown(mirror_bake)[is_mirror], rtol=1e-3, atol=1e-4
    )


def test_gather_pictures_have_mirrors_too(tmp_path):
    transfer = baked(room(metal()), tmp_path, "gather", (32, 24))
    direct = baked(room(metal()), tmp_path, "direct", (32, 24))
    is_mirror = transfer.views["front"].material_ids() == 0
    assert shown(transfer)[is_mirror].mean() > shown(direct)[is_mirror].mean()


def test_an_area_light_is_visible_in_a_mirror(mirror_bake):
    center, side = np.array([0.0, 1.6, 0.5]), 0.6

    def area_light(towards):
        def change(document):
            document["environment"]["intensity"] = 0
            document["lights"] = {
                "Panel": {"kind": "rectangle", "position": center.tolist(), "direction": [0, 0, towards],
                          "size": [side, side], "emission": [7, 7, 7]}
            }  # fmt: skip

        return change

    scene = room(metal())
    rays, cosine = angles(scene)
    camera_position = scene.cameras[0].to_world[:3, 3] * [1, 1, -1] + [0, 0, -2]  # behind the mirror
    directions = rays * [1, 1, -1]
    offset = camera_position + directions * ((center[2] - camera_position[2]) / directions[:, 2:]) - center
    is_in = (np.abs(offset[:, :2]) < side / 2 - 0.05).all(axis=1).reshape(cosine.shape)
    is_out = (np.abs(offset[:, :2]) > side / 2 + 0.05).any(axis=1).reshape(cosine.shape)
    is_mirror = mirror_bake.views["front"].material_ids() == 0
    assert is_in.sum() > 20
    picture = shown(mirror_bake, area_light(-1))
    wanted = 7 * np.stack([schlick(cosine, f0) for f0 in F0], axis=-1)
    np.testing.assert_allclose(picture[is_in & is_mirror], wanted[is_in & is_mirror], rtol=0.01)
    assert np.median(picture[is_out & is_mirror]) < 0.1
    assert np.abs(shown(mirror_bake, area_light(1))[is_in & is_mirror]).max() < 1  # it emits away from the mirror


def test_dimming_an_area_light_dims_its_mirror_image(mirror_bake):
    def area_light(emission, **fields):
        def change(document):
            document["lights"] = {
                "Panel": {"kind": "rectangle", "position": [0, 1.6, 0.5], "direction": [0, 0, -1], "size": [0.6, 0.6],
                          "emission": [emission] * 3, **fields}
            }  # fmt: skip

        return change

    picture = Picture(mirror_bake, "front", Cache(1 << 30))
    for change in (area_light(7), area_light(2), area_light(2, enabled=False), area_light(3), lambda document: None):
        look = make_look(mirror_bake, change)
        picture.set_look(look)
        run_until_exact(picture)
        np.testing.assert_allclose(picture.image(), render_image(mirror_bake, "front", look), rtol=1e-4, atol=1e-4)


PANELS = [
    {"kind": "rectangle", "position": [-0.5, 1.4, 0.5], "direction": [0, 0, -1], "size": [0.5, 0.4], "rotation": 20.0},
    {"kind": "rectangle", "position": [0.6, 1.4, 0.5], "direction": [0, 0, 1], "size": [0.5, 0.4], "rotation": 0.0},
    {"kind": "rectangle", "position": [0.6, 1.4, 0.6], "direction": [0, 0, -1], "size": [0.5, 0.4], "rotation": 0.0},
    {"kind": "disc", "position": [0.0, 0.9, 0.8], "direction": [0, 0.1, -1], "radius": 0.25},
]


def test_mirrors_show_the_panels_of_a_source(tmp_path):
    """As the panels show singly; one in front of another faces away from the mirror."""
    emissions = [2.0, 4.0, 8.0, 6.0]
    scene = room(metal(), np.full((4, 8, 3), 1e-6, np.float32))
    members = members_of(PANELS, emissions)
    source = Light("Panels", {"kind": "panels", "source": "Panels", "emission": [1.0, 2.0, 0.5]}, "", members)
    merged = baked(make_scene(scene.name, scene.meshes, scene.materials, scene.cameras, scene.environment,
                              lights=(source,)), tmp_path)  # fmt: skip

    def single(document):
        document["lights"]["Panels"]["enabled"] = False
        for k, (fields, emission) in enumerate(zip(PANELS, emissions, strict=True)):
            document["lights"][f"P{k}"] = {**fields, "emission": [emission, 2 * emission, emission / 2]}

    actual, expected = shown(merged), shown(merged, single)
    is_mirror = merged.views["front"].material_ids() == 0
    bright = is_mirror & (expected[..., 1] > 1)
    inner = bright & np.roll(bright, 1, 0) & np.roll(bright, -1, 0) & np.roll(bright, 1, 1) & np.roll(bright, -1, 1)
    assert inner.sum() > 20
    np.testing.assert_allclose(actual[inner], expected[inner], rtol=0.02)
    np.testing.assert_allclose(actual[is_mirror].sum(axis=0), expected[is_mirror].sum(axis=0), rtol=0.02)
