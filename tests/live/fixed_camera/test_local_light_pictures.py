"""Pictures under local lights: linear in their gains, followed while they move, frozen and edited like others."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import exact_image, render_uncached
from session_edits import BUDGET, make_look, run_until_exact
from tiny_scenes import make_camera, mesh, quad

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.live.opened.patch_direct_light import SAMPLES_PER_PATCH_POINT, LocalPatchLight
from relume.look import LightGeometry
from relume.methods.registry import METHODS
from relume.scene.model import Light, Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

POINT_LIGHT = {"kind": "point", "position": [0.9, 1.4, 1.2], "emission": [2.0, 2.0, 2.0]}
PANEL = {
    "kind": "rectangle",
    "position": [-1.0, 1.5, 1.0],
    "direction": [1, -1, -1],
    "size": [0.6, 0.4],
    "emission": [5.0, 5.0, 5.0],
}
SPOT = {"kind": "spot", "position": [0.0, 2.0, 1.5], "direction": [0, -1, -0.7], "emission": [9.0, 5.0, 5.0]}
SUN = {"kind": "directional", "direction": [-1, -2, -1]}
ENVIRONMENT_OFF = {"intensity": 0.0}


def rendered(transfer, lights, environment=None, change=lambda document: None, view="front"):
    def edit(document):
        document["lights"].update(lights)
        document["environment"].update(environment or {})
        change(document)

    return render_uncached(transfer, make_look(transfer, edit), view)


@pytest.mark.parametrize("light", [POINT_LIGHT, PANEL, SPOT, SUN], ids=lambda light: light["kind"])
def test_local_lights_add_to_the_environment(transfer, light):
    alone = rendered(transfer, {"A": light}, ENVIRONMENT_OFF)
    beside = rendered(transfer, {"A": light}, {"intensity": 0.5, "color": [1.0, 0.5, 0.2]})
    environment = rendered(transfer, {}, {"intensity": 0.5, "color": [1.0, 0.5, 0.2]})
    assert alone.mean() > 0.01
    np.testing.assert_allclose(beside, alone + environment, rtol=1e-3, atol=1e-5)


def test_picture_is_linear_in_the_gains_of_lights(transfer):
    apart = [rendered(transfer, {"A": light}, ENVIRONMENT_OFF) for light in (POINT_LIGHT, PANEL)]
    dimmed = {
        "A": POINT_LIGHT | {"intensity": 3.0, "color": [1.0, 0.5, 0.0]},
        "B": PANEL | {"emission": [10.0, 5.0, 5.0]},
    }
    together = rendered(transfer, dimmed, ENVIRONMENT_OFF)
    expected = apart[0] * np.array([3.0, 1.5, 0.0]) + apart[1] * np.array([2.0, 1.0, 1.0])
    np.testing.assert_allclose(together, expected, rtol=1e-3, atol=1e-5)


def test_disabled_lights_do_not_change_the_picture(transfer):
    difference = {
        "A": POINT_LIGHT | {"enabled": False},
        "B": SUN | {"intensity": 0.0},
        "C": SPOT | {"color": [0, 0, 0]},
    }
    np.testing.assert_array_equal(rendered(transfer, difference), rendered(transfer, {}))


def test_curves_are_edited_under_local_lights_and_stay_exact(transfer):
    """A highlight is frozen, dragged, and compared with a picture of the final curve."""
    lights = {"A": POINT_LIGHT, "B": PANEL}

    def steeper(document):
        document["lights"].update(lights)
        document["materials"]["Wall"]["terms"][1]["params"]["exponent"] = 90.0

    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(make_look(transfer, lambda document: document["lights"].update(lights)))
    run_until_exact(picture)
    picture.prepare("/materials/Wall/terms/1/params/exponent")
    run_until_exact(picture)
    picture.set_look(make_look(transfer, steeper))
    image = run_until_exact(picture).image()
    np.testing.assert_allclose(image, exact_image(transfer, make_look(transfer, steeper)), rtol=2e-3, atol=1e-4)


def test_a_moving_light_is_followed_and_then_exact(transfer):
    def moved(document):
        document["lights"]["A"] = POINT_LIGHT | {"position": [-0.9, 1.2, 1.0]}

    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(make_look(transfer, lambda document: document["lights"].update(A=POINT_LIGHT)))
    before = run_until_exact(picture).image()
    picture.set_look(make_look(transfer, moved))
    assert not picture.advance(None).exact
    followed, exact = picture.image(), exact_image(transfer, make_look(transfer, moved))
    assert np.abs(followed - exact).mean() < 0.1 * np.abs(before - exact).mean()
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def showing(show):
    """A change of a look that shows some of its light paths."""
    return lambda document: document.update(transport={"show": show, "bounces": 24})


def room(*, has_sides=True, lights=(), emitter=None):
    """A floor below an emitter that faces down, with a camera at the side."""
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    emitter = emitter or quad("lamp", [[-0.3, 1, -0.3], [0.3, 1, -0.3], [0.3, 1, 0.3], [-0.3, 1, 0.3]], 1)
    gray = ({"model": "lambert", "color": [0.5, 0.5, 0.5]},)
    materials = [Material("Floor", gray), Material("Lamp", gray, double_sided=has_sides)]
    cameras = [
        make_camera("below", [0, 0.3, 3], [0, 0.55, 0], 0.8),
        make_camera("above", [0, 2.0, 3], [0, 0.55, 0], 0.8),
    ]
    environment = Environment("dim", np.full((4, 8, 3), 1e-3, np.float32))
    return make_scene("room", [floor, emitter], materials, cameras, environment, lights=lights)


SHINING = Light("Lamp", {"kind": "mesh", "material": "Lamp", "emission": [4.0, 2.0, 1.0]})
OFF = {"Lamp": {"enabled": False}}


def baked(scene, folder, method="direct"):
    views = tuple(camera.name for camera in scene.cameras)
    return open_transfer(
        bake_in_process(METHODS[method], scene, Recipe(method, views, (48, 36), 100), folder / "store.zarr"),
        Cache(1 << 30),
    )


@pytest.mark.parametrize("is_two_sided", [True, False])
def test_an_emissive_surface_is_visible_and_lights_the_floor(tmp_path, is_two_sided):
    transfer = baked(room(has_sides=is_two_sided, lights=[SHINING]), tmp_path)
    assert [transfer.local.num_samples(LightGeometry(kind)) for kind in ("mesh", "rectangle")] == [256, 64]
    assert transfer.local.num_samples(LightGeometry("mesh"), SAMPLES_PER_PATCH_POINT) == 4 * SAMPLES_PER_PATCH_POINT
    below, above = (rendered(transfer, {}, view=view) for view in ("below", "above"))
    is_emitter = transfer.views["above"].material_ids() == 1
    assert np.all(np.abs(below.max(axis=(0, 1)) - [4, 2, 1]) < 0.1), "its lower side shines"
    emitter_radiance = above[is_emitter][len(above[is_emitter]) // 2]
    assert np.allclose(emitter_radiance, [4, 2, 1], rtol=0.05) == is_two_sided
    floor = transfer.views["above"].material_ids() == 0
    assert above[floor].mean() > 20 * rendered(transfer, OFF, view="above")[floor].mean()
    for show, is_visible in (("direct", True), ("first_bounce", False)):
        picture = rendered(transfer, {}, None, showing(show), "below")
        np.testing.assert_array_equal(picture, below if is_visible else 0 * below)


def test_emitter_without_area_or_pixels_changes_nothing(tmp_path):
    nowhere = mesh("lamp", [[5, 1, 5]] * 3, [[0, 1, 2]], 1, np.tile([0.0, 1.0, 0.0], (3, 1)))
    transfer = baked(room(lights=[SHINING], emitter=nowhere), tmp_path)
    emissive, difference = (rendered(transfer, lights, view="above") for lights in ({}, OFF))
    np.testing.assert_allclose(emissive, difference, rtol=1e-5)


def test_patches_reflect_local_light(tmp_path):
    """A spot below the emitter lights its underside only indirectly; irradiance of patches equals the formula."""
    transfer = baked(room(has_sides=False), tmp_path, "gather")
    lights = {"A": {"kind": "spot", "position": [0, 0.9, 0], "cone": [10, 40], "emission": [5.0, 5.0, 5.0]}}
    shown = {
        show: rendered(
            transfer,
            lights,
            ENVIRONMENT_OFF,
            lambda d, show=show: d.update(transport={"show": show, "bounces": 24}),
            "below",
        )
        for show in ("all", "direct", "first_bounce", "further_bounces")
    }
    ids = transfer.views["below"].material_ids()
    assert not shown["direct"][ids == 1].any()
    assert shown["first_bounce"][ids == 1].mean() > 0.01
    parts = shown["direct"] + shown["first_bounce"] + shown["further_bounces"]
    np.testing.assert_allclose(shown["all"], parts, rtol=1e-3, atol=1e-5)
    patches = transfer.patches
    on_patches = LocalPatchLight(transfer.local, patches, transfer.cache, transfer.key, ())
    irradiance = on_patches.irradiance(LightGeometry("spot", (0, 0.9, 0), (0, -1, 0), (10, 40)))
    on_floor = patches.material == 0
    position = transfer.store.read("patches/position").mean(axis=1)[on_floor]
    away = np.linalg.norm(position - [0, 0.9, 0], axis=1)
    cosine = 0.9 / away
    falloff = np.clip((cosine - np.cos(np.radians(40))) / (np.cos(np.radians(10)) - np.cos(np.radians(40))), 0, 1)
    expected = falloff**2 * cosine / away**2
    assert np.abs(irradiance[on_floor] - expected).mean() < 0.05 * expected.mean()


def test_a_closed_box_contains_its_light(tmp_path):
    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], float)
    up = np.array([0, 2, 0])
    sides = [corners[::-1], corners + up]
    sides += [np.array([corners[k], corners[k - 1], corners[k - 1] + up, corners[k] + up]) for k in range(4)]
    meshes = [quad(f"side {k}", side, 0) for k, side in enumerate(sides)]
    white = [Material("Wall", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))]
    camera = make_camera("inside", [0, 1, 0.9], [0, 1, 0], 1.2)
    box = make_scene("box", meshes, white, [camera], Environment("sky", np.ones((4, 8, 3), np.float32)))
    transfer = baked(box, tmp_path, "gather")
    assert not rendered(transfer, {}, view="inside").any()
    outside = {"A": POINT_LIGHT | {"position": [0, 3, 0]}}
    assert not rendered(transfer, outside, view="inside").any()
    inside = rendered(transfer, {"A": POINT_LIGHT | {"position": [0, 1.5, 0]}}, view="inside")
    assert inside.min() > 0.01
