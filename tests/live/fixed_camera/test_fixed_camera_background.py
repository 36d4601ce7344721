"""Background and shadow catchers of fixed views, against sums over all directions."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import BUDGET, bake_corner_scene, make_look, relative_rmse, run_until_exact
from shadow_catcher_scenes import (
    CAMERA,
    CENTER,
    POINT_LIGHT,
    RADIUS,
    SIZE,
    background,
    ball_scene,
    changes,
    environment,
    inner,
    plain_ground,
    set_only_area_light,
    set_only_emissive_ball,
    set_only_spot_light,
    set_paths,
)
from tiny_scenes import make_tiny_scene, quad, studio

from relume.assets.environments.equirect import lookup, rotate_about_y, texel_directions, texel_solid_angles
from relume.core.cache import Cache
from relume.core.color import srgb_encode
from relume.image_io.write_image import to_bytes
from relume.lights.prefilter import downsampled, prefiltered
from relume.live.fixed_camera.background import MAX_CATCHER_RATIO, Background
from relume.live.fixed_camera.picture import Picture
from relume.output.render_image import render_image
from relume.scene.model import Material


@pytest.fixture(scope="module")
def direct_bake(tmp_path_factory):
    """A bake of direct light, opened."""
    return bake_corner_scene(ball_scene(studio()), "direct", tmp_path_factory.mktemp("standing"))


@pytest.fixture(scope="module")
def indirect_bake(tmp_path_factory):
    """A bake with indirect light, opened."""
    return bake_corner_scene(ball_scene(studio()), "gather", tmp_path_factory.mktemp("reflecting"))


def rendered(transfer, *several):
    return render_image(transfer, "front", make_look(transfer, changes(*several)))


def directions(transfer):
    """View direction of every pixel's first sample. (height, width, 3)"""
    view = transfer.views["front"]
    position = transfer.store.read("views/0/position")
    position[: view.num_surface_samples] -= CAMERA.to_world[:3, 3].astype(np.float32)
    towards = position[view.order[view.first[:-1]]]
    return (towards / np.linalg.norm(towards, axis=1, keepdims=True)).reshape(view.height, view.width, 3)


def ground_points(transfer):
    """Points of the ground at the centers of its inner pixels. (n, 3)"""
    towards = directions(transfer)[inner(transfer, "Ground")].astype(float)
    camera_position = CAMERA.to_world[:3, 3]
    height = camera_position[1] - (CENTER[1] - RADIUS)
    return camera_position + towards * (height / -towards[:, 1])[:, None]


def unoccluded_fraction(points, environment, degrees=0.0):
    """Brute force: irradiance of a horizontal ground over that without the ball, by sums over a fine map. (n, 3)"""
    height = 128
    w = texel_directions(height, 2 * height).reshape(-1, 3).astype(float)
    light = lookup(environment, rotate_about_y(w, -degrees)) * np.maximum(w[:, 1:2], 0)
    light = light * np.repeat(texel_solid_angles(height, 2 * height), 2 * height)[:, None]
    fractions = []
    for point in points:
        along = w @ (CENTER - point)
        nearest = np.sum((CENTER - point) ** 2) - along**2
        is_free = (along < 0) | (nearest > RADIUS**2)
        fractions.append(light[is_free].sum(0) / light.sum(0))
    return np.array(fractions)


def test_a_ground_without_objects_is_invisible(tmp_path):
    floor = quad("Ground", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    catcher = Material("Ground", ({"model": "lambert", "color": [0.2, 0.5, 0.2]},), shadow_catcher=True)
    for k, around in enumerate((np.full((16, 32, 3), [0.5, 0.7, 2.0], np.float32), studio())):
        scene = make_tiny_scene(floor, camera=CAMERA, environment=around, materials=[catcher])
        transfer = bake_corner_scene(scene, "direct", tmp_path / str(k))
        is_inner = inner(transfer, "Ground") | inner(transfer, None)
        is_inner |= k == 0  # in uniform light its border is invisible
        assert is_inner.sum() > 700
        image = rendered(transfer)
        expected = lookup(around, directions(transfer).reshape(-1, 3)).reshape(image.shape)
        np.testing.assert_allclose(image[is_inner], expected[is_inner], rtol=2e-5)
        lit = rendered(
            transfer, lambda d: d["lights"].update(Lamp=POINT_LIGHT), background(kind="color", color=[1, 2, 3])
        )
        np.testing.assert_allclose(lit, np.broadcast_to([1, 2, 3], lit.shape), rtol=2e-5)


@pytest.mark.parametrize("degrees", [0.0, 70.0])
def test_shadows_equal_brute_force(direct_bake, degrees):
    image = rendered(direct_bake, background(kind="color", color=[1.0, 1.0, 1.0]), environment(rotation=degrees))
    ours, expected = (
        image[inner(direct_bake, "Ground")],
        unoccluded_fraction(ground_points(direct_bake), studio(), degrees),
    )
    assert expected.min() < 0.5 < 0.98 < expected.max()
    assert np.sqrt(np.mean((ours - expected) ** 2)) < 0.012
    assert np.quantile(np.abs(ours - expected), 0.99) < 0.05


def distance_to_ray(points):
    """Distance of the ball's center to the ray from each point to the light. (n,)"""
    light_position = np.array(POINT_LIGHT["position"])
    towards = (light_position - points) / np.linalg.norm(light_position - points, axis=1, keepdims=True)
    along = np.einsum("nc,nc->n", towards, CENTER - points)
    return np.sqrt(np.sum((CENTER - points) ** 2, axis=1) - along**2)


def test_the_ground_has_the_shadow_of_its_light(direct_bake):
    image = rendered(direct_bake, set_only_area_light, background(kind="color", color=[2.0, 1.0, 0.5]))
    miss = distance_to_ray(ground_points(direct_bake))
    fractions = image[inner(direct_bake, "Ground")] / [2.0, 1.0, 0.5]
    assert (fractions[miss < 0.97 * RADIUS] == 0).all()
    assert (miss < 0.97 * RADIUS).sum() > 10
    np.testing.assert_allclose(fractions[miss > 1.03 * RADIUS], 1, rtol=1e-4)


def set_only_blue_light(document):
    document["environment"]["intensity"] = 0.0
    document["lights"]["Lamp"] = {**POINT_LIGHT, "emission": [0.0, 0.0, 5.0]}


def test_an_unlit_ground_shows_the_background(direct_bake):
    """Nothing is shadowed there: outside the cone of a spot light, around a light that is itself an object."""
    colour, ground, points = np.array([2.0, 1.0, 0.5]), inner(direct_bake, "Ground"), ground_points(direct_bake)
    behind = background(kind="color", color=colour.tolist())
    below = points - POINT_LIGHT["position"]
    is_outside = np.degrees(np.arctan2(np.hypot(below[:, 0], below[:, 2]), -below[:, 1])) > 20.5
    lit_by_spot = rendered(direct_bake, set_only_spot_light, behind)
    fractions = lit_by_spot[ground] / colour
    assert 50 < is_outside.sum() < len(points) - 50
    np.testing.assert_allclose(fractions[is_outside], 1, rtol=1e-5)
    miss = np.where(is_outside, np.inf, distance_to_ray(points))
    np.testing.assert_array_equal(fractions[miss < 0.97 * RADIUS], 0)
    assert (miss < 0.97 * RADIUS).sum() > 5
    lit_by_ball = rendered(direct_bake, set_only_emissive_ball, behind)
    np.testing.assert_allclose(lit_by_ball[ground] / colour, 1, rtol=1e-5)
    for alone, expected in ((set_only_spot_light, lit_by_spot), (set_only_emissive_ball, lit_by_ball)):
        *image, alpha = np.moveaxis(rendered(direct_bake, alone, background(kind="transparent")), 2, 0)
        composed = np.dstack(image) + (1 - alpha[..., None]) * colour
        np.testing.assert_allclose(composed, expected, rtol=3e-4, atol=1e-5)  # alpha cannot represent ratios above one
        assert not rendered(direct_bake, alone, behind, set_paths("further_bounces"))[ground].any()


def test_ratios_at_the_edge_of_a_cone_are_bounded(indirect_bake):
    """Otherwise single pixels would be thousands of times as bright as the background."""
    image = rendered(indirect_bake, set_only_spot_light, background(kind="color", color=[2.0, 1.0, 0.5]))
    fractions = image[inner(indirect_bake, "Ground")] / [2.0, 1.0, 0.5]
    assert fractions.max() <= MAX_CATCHER_RATIO * (1 + 1e-5)
    assert np.median(fractions) == pytest.approx(1, abs=0.01)


def test_a_light_of_one_channel_casts_a_shadow_in_that_channel(direct_bake):
    fractions = rendered(direct_bake, set_only_blue_light, background(kind="color", color=[1.0, 1.0, 1.0]))
    fractions = fractions[inner(direct_bake, "Ground")]
    np.testing.assert_allclose(fractions[:, :2], 1, rtol=1e-5)
    assert (fractions[:, 2].min(), fractions[:, 2].max()) == (0, pytest.approx(1, rel=1e-4))


def test_the_border_of_the_ground_has_no_seam():
    scene = ball_scene(studio())
    rim = scene.meshes[-1].positions[1:]
    assert np.abs(unoccluded_fraction(rim.astype(float), studio()) - 1).max() < 1e-3
    assert rim[:, 1].max() < CENTER[1] - RADIUS < rim[:, 1].min() + 1e-3


def test_indirect_light_colors_the_ground(indirect_bake, direct_bake):
    """The background times the light on a white ground, over that without the ball."""
    white = background(kind="color", color=[1.0, 1.0, 1.0])
    catcher, ground = rendered(indirect_bake, white), inner(indirect_bake, "Ground")
    plain = rendered(indirect_bake, plain_ground)
    level = texel_directions(128, 256).reshape(-1, 3).astype(float)
    weights = np.maximum(level[:, 1], 0) * np.repeat(texel_solid_angles(128, 256), 256)
    unoccluded = weights @ lookup(studio(), level.astype(np.float32))
    expected = plain[ground] / (0.5 / np.pi * unoccluded)
    np.testing.assert_allclose(catcher[ground], expected, rtol=0.01)
    gained = catcher[ground] / rendered(direct_bake, white)[ground]
    assert gained[:, 0].max() > 1.05
    assert gained[:, 1].max() < 0.5 * (gained[:, 0].max() - 1) + 1
    parts = [
        rendered(indirect_bake, white, set_paths(paths)) for paths in ("direct", "first_bounce", "further_bounces")
    ]
    np.testing.assert_allclose(np.sum(parts, axis=0), catcher, rtol=1e-3, atol=1e-4)


def test_the_background_is_the_map_a_color_or_blurred(direct_bake):
    outside, plain = inner(direct_bake, None), rendered(direct_bake)
    if not outside.any():
        pytest.fail("the view shows no background")
    for scale in (2.0, 0.0):
        image = rendered(direct_bake, background(kind="color", color=[0.3, 0.2, 0.1]), environment(intensity=scale))
        np.testing.assert_allclose(image[outside], np.broadcast_to([0.3, 0.2, 0.1], image[outside].shape), rtol=1e-5)
    image = rendered(direct_bake, background(kind="color"))
    ball = inner(direct_bake, "Ball")
    np.testing.assert_array_equal(image[ball], plain[ball])
    turn = 40.0
    image = rendered(direct_bake, background(kind="blurred", blur=12.0), environment(rotation=turn, intensity=2.0))
    towards = rotate_about_y(directions(direct_bake)[outside].astype(float), -turn).astype(np.float32)
    np.testing.assert_allclose(image[outside], 2 * lookup(prefiltered(downsampled(studio()), 12.0), towards), rtol=1e-4)


def test_transparent_images_composite_over_any_background(tmp_path, direct_bake):
    """Over a color they equal that color as a background, in gray light: alpha has no color."""
    gray = np.repeat(studio()[..., :1], 3, axis=-1)
    transfer = bake_corner_scene(ball_scene(gray), "direct", tmp_path)
    image = rendered(transfer, background(kind="transparent"))
    assert image.shape == (SIZE[1], SIZE[0], 4)
    behind = np.array([0.7, 0.4, 0.1])
    expected = rendered(transfer, background(kind="color", color=behind.tolist()))
    np.testing.assert_allclose(image[..., :3] + (1 - image[..., 3:]) * behind, expected, rtol=1e-4, atol=1e-5)
    assert np.all(image[inner(transfer, "Ball")][:, 3] == 1)
    assert np.all(image[inner(transfer, None)] == 0)
    assert 0.3 < image[inner(transfer, "Ground")][:, 3].max() < 1
    look = make_look(transfer, background(kind="transparent"))
    shown = render_image(transfer, "front", look, for_display=True)
    ground = inner(transfer, "Ground")
    np.testing.assert_allclose(1 - shown[ground][:, 3], srgb_encode(1 - image[ground][:, 3]), atol=1e-5)
    np.testing.assert_array_equal(shown[inner(transfer, "Ball")], image[inner(transfer, "Ball")])


def test_a_live_picture_switches_at_once(direct_bake):
    """Another background needs no shading, nor does switching a shadow catcher to a plain ground."""
    picture = run_until_exact(Picture(direct_bake, "front", Cache(BUDGET)))
    assert picture.encode_alpha(picture.all_tiles()) is None
    behind = [background(kind=kind) for kind in ("blurred", "color", "transparent")]
    for change in (*behind, plain_ground):
        picture.set_look(make_look(direct_bake, change))
        advance = picture.advance(None)
        assert advance.exact
        assert advance.changed
        np.testing.assert_array_equal(picture.image(), rendered(direct_bake, change)[..., :3])
    picture.set_look(make_look(direct_bake, background(kind="transparent")))
    picture.advance(None)
    alpha = np.frombuffer(picture.encode_alpha(picture.all_tiles()), np.uint8)
    assert len(alpha) == SIZE[0] * SIZE[1]
    assert {0, 255} <= set(alpha)
    picture.set_look(make_look(direct_bake))
    np.testing.assert_array_equal(run_until_exact(picture).image(), rendered(direct_bake))


def test_moving_lights_keep_an_approximate_shadow_catcher(direct_bake):
    picture = Picture(direct_bake, "front", Cache(BUDGET))
    behind = background(kind="color", color=[1.0, 1.0, 1.0])
    picture.set_look(make_look(direct_bake, changes(set_only_area_light, behind)))
    before = run_until_exact(picture).image()
    moved = {**POINT_LIGHT, "position": [-0.5, 1.8, 0.4]}
    change = changes(set_only_area_light, behind, lambda d: d["lights"].update(Lamp=moved))
    picture.set_look(make_look(direct_bake, change))
    picture.advance(None)
    ground, exact = inner(direct_bake, "Ground"), rendered(direct_bake, change)
    errors = [relative_rmse(image[ground], exact[ground]) for image in (picture.image(), before)]
    assert errors[0] < 0.5 * errors[1]
    np.testing.assert_allclose(run_until_exact(picture).image(), exact, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("kind", ["map", "blurred", "color"])
def test_environment_intensity_multiplies_the_picture(direct_bake, kind, monkeypatch):
    """Only a background color, which does not depend on light, is composited again."""
    brighter = changes(background(kind=kind), environment(intensity=2.0, color=[1.0, 0.5, 0.2]))
    expected = rendered(direct_bake, brighter)
    picture = Picture(direct_bake, "front", Cache(BUDGET))
    picture.set_look(make_look(direct_bake, background(kind=kind)))
    run_until_exact(picture)
    write, written = Background._background_radiance, []
    monkeypatch.setattr(Background, "_background_radiance", lambda *given: written.append(given) or write(*given))
    picture.set_look(make_look(direct_bake, brighter))
    assert picture.advance(None).changed
    assert bool(written) == (kind == "color")
    np.testing.assert_allclose(picture.image(), expected, rtol=1e-6)


def test_coverage_depends_on_the_ground_only(direct_bake, monkeypatch):
    """After any edit, a live picture has the alpha of a new picture of the same look, with minimal requests."""
    picture, requested = Picture(direct_bake, "front", Cache(BUDGET)), []
    ask = Background._shadow_opacity
    transparent = background(kind="transparent")
    ball = [lambda d, c=c: d["materials"]["Ball"]["terms"][0].update(color=[c, 0.1, 0.1]) for c in (0.3, 0.6)]
    area_light = changes(ball[1], set_only_area_light)
    steps = [
        (transparent, 1),
        (ball[0], 0),
        (ball[1], 0),
        (area_light, 1),
        (changes(area_light, plain_ground), 0),
        (area_light, 1),
    ]
    for change, max_error in steps:
        look = make_look(direct_bake, changes(transparent, change))
        expected = render_image(direct_bake, "front", look, for_display=True)[..., 3]
        picture.set_look(look)
        run_until_exact(picture)
        with monkeypatch.context() as patched:
            patched.setattr(Background, "_shadow_opacity", lambda *given: requested.append(given) or ask(*given))
            requested.clear()
            tiles = picture.encode_alpha([(0, 0, 40, 10), (0, 10, 15, 20), (15, 10, 25, 20)])
        assert len(requested) == max_error
        alpha = picture.alpha(for_display=True)
        np.testing.assert_allclose(alpha, expected, atol=1e-6)  # lights are mixed, with other rounding
        shown = to_bytes(alpha)
        assert tiles == b"".join(tile.tobytes() for tile in (shown[:10], shown[10:, :15], shown[10:, 15:]))
