"""What is seen behind objects, and a ground that catches their shadows, against sums over all directions."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import BUDGET, bake_corner_scene, make_look, relative_rmse, run_until_exact
from shadow_catcher_scenes import (
    CAMERA,
    CENTRE,
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
from relume.live.fixed_camera.background.background import MAX_CATCHER_RATIO, Background
from relume.live.fixed_camera.picture import Picture
from relume.output.render_image import render_image
from relume.scene.model import Material


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    """Of direct light alone, opened."""
    return bake_corner_scene(ball_scene(studio()), "direct", tmp_path_factory.mktemp("standing"))


@pytest.fixture(scope="module")
def reflecting(tmp_path_factory):
    """The same with light between surfaces."""
    return bake_corner_scene(ball_scene(studio()), "gather", tmp_path_factory.mktemp("reflecting"))


def rendered(transfer, *several):
    return render_image(transfer, "front", make_look(transfer, changes(*several)))


def directions(transfer):
    """In which every pixel's first sample is seen. (height, width, 3)"""
    view = transfer.views["front"]
    position = transfer.store.read("views/0/position")
    position[: view.num_surface_samples] -= CAMERA.to_world[:3, 3].astype(np.float32)
    towards = position[view.order[view.first[:-1]]]
    return (towards / np.linalg.norm(towards, axis=1, keepdims=True)).reshape(view.height, view.width, 3)


def ground_points(transfer):
    """Where the camera meets the ground, in its inner pixels. (n, 3)"""
    towards = directions(transfer)[inner(transfer, "Ground")].astype(float)
    camera_position = CAMERA.to_world[:3, 3]
    height = camera_position[1] - (CENTRE[1] - RADIUS)
    return camera_position + towards * (height / -towards[:, 1])[:, None]


def free_share(points, environment, degrees=0.0):
    """Brute force: irradiance of a level ground over that without the ball, by sums over a fine map. (n, 3)"""
    height = 128
    w = texel_directions(height, 2 * height).reshape(-1, 3).astype(float)
    light = lookup(environment, rotate_about_y(w, -degrees)) * np.maximum(w[:, 1:2], 0)
    light = light * np.repeat(texel_solid_angles(height, 2 * height), 2 * height)[:, None]
    shares = []
    for point in points:
        along = w @ (CENTRE - point)
        nearest = np.sum((CENTRE - point) ** 2) - along**2
        is_free = (along < 0) | (nearest > RADIUS**2)
        shares.append(light[is_free].sum(0) / light.sum(0))
    return np.array(shares)


def test_ground_alone_is_not_seen(tmp_path):
    floor = quad("Ground", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    catcher = Material("Ground", ({"model": "lambert", "color": [0.2, 0.5, 0.2]},), shadow_catcher=True)
    for k, around in enumerate((np.full((16, 32, 3), [0.5, 0.7, 2.0], np.float32), studio())):
        scene = make_tiny_scene(floor, camera=CAMERA, environment=around, materials=[catcher])
        transfer = bake_corner_scene(scene, "direct", tmp_path / str(k))
        is_inner = inner(transfer, "Ground") | inner(transfer, None)
        is_inner |= k == 0  # in even light nothing may show where it ends
        assert is_inner.sum() > 700
        image = rendered(transfer)
        expected = lookup(around, directions(transfer).reshape(-1, 3)).reshape(image.shape)
        np.testing.assert_allclose(image[is_inner], expected[is_inner], rtol=2e-5)
        lit = rendered(
            transfer, lambda d: d["lights"].update(Lamp=POINT_LIGHT), background(kind="color", color=[1, 2, 3])
        )
        np.testing.assert_allclose(lit, np.broadcast_to([1, 2, 3], lit.shape), rtol=2e-5)


@pytest.mark.parametrize("degrees", [0.0, 70.0])
def test_shadows_are_those_of_brute_force(standing, degrees):
    image = rendered(standing, background(kind="color", color=[1.0, 1.0, 1.0]), environment(rotation=degrees))
    ours, expected = image[inner(standing, "Ground")], free_share(ground_points(standing), studio(), degrees)
    assert expected.min() < 0.5 < 0.98 < expected.max()
    assert np.sqrt(np.mean((ours - expected) ** 2)) < 0.012
    assert np.quantile(np.abs(ours - expected), 0.99) < 0.05


def miss_of(points):
    """How far from the middle of the ball the way from points to the lamp passes. (n,)"""
    light_position = np.array(POINT_LIGHT["position"])
    towards = (light_position - points) / np.linalg.norm(light_position - points, axis=1, keepdims=True)
    along = np.einsum("nc,nc->n", towards, CENTRE - points)
    return np.sqrt(np.sum((CENTRE - points) ** 2, axis=1) - along**2)


def test_ground_is_as_dark_as_its_lamp_says(standing):
    image = rendered(standing, set_only_area_light, background(kind="color", color=[2.0, 1.0, 0.5]))
    miss = miss_of(ground_points(standing))
    shares = image[inner(standing, "Ground")] / [2.0, 1.0, 0.5]
    assert (shares[miss < 0.97 * RADIUS] == 0).all()
    assert (miss < 0.97 * RADIUS).sum() > 10
    np.testing.assert_allclose(shares[miss > 1.03 * RADIUS], 1, rtol=1e-4)


def blue_lamp_alone(document):
    document["environment"]["intensity"] = 0.0
    document["lights"]["Lamp"] = {**POINT_LIGHT, "emission": [0.0, 0.0, 5.0]}


def test_ground_where_no_light_would_fall_shows_what_is_behind(standing):
    """Nothing shadows it there: outside the cone of a spot, around a lamp that is itself an object."""
    colour, ground, points = np.array([2.0, 1.0, 0.5]), inner(standing, "Ground"), ground_points(standing)
    behind = background(kind="color", color=colour.tolist())
    below = points - POINT_LIGHT["position"]
    is_outside = np.degrees(np.arctan2(np.hypot(below[:, 0], below[:, 2]), -below[:, 1])) > 20.5
    lit_by_spot = rendered(standing, set_only_spot_light, behind)
    shares = lit_by_spot[ground] / colour
    assert 50 < is_outside.sum() < len(points) - 50
    np.testing.assert_allclose(shares[is_outside], 1, rtol=1e-5)
    miss = np.where(is_outside, np.inf, miss_of(points))
    np.testing.assert_array_equal(shares[miss < 0.97 * RADIUS], 0)
    assert (miss < 0.97 * RADIUS).sum() > 5
    lit_by_ball = rendered(standing, set_only_emissive_ball, behind)
    np.testing.assert_allclose(lit_by_ball[ground] / colour, 1, rtol=1e-5)
    for alone, expected in ((set_only_spot_light, lit_by_spot), (set_only_emissive_ball, lit_by_ball)):
        *image, alpha = np.moveaxis(rendered(standing, alone, background(kind="transparent")), 2, 0)
        composed = np.dstack(image) + (1 - alpha[..., None]) * colour
        np.testing.assert_allclose(composed, expected, rtol=3e-4, atol=1e-5)  # alpha says nothing of shares over one
        assert not rendered(standing, alone, behind, set_paths("further_bounces"))[ground].any()


def test_reflected_light_beside_the_rim_of_a_cone_is_held_against_no_less_than_there_is(reflecting):
    """Else single pixels would shine thousands of times as bright as what is behind."""
    image = rendered(reflecting, set_only_spot_light, background(kind="color", color=[2.0, 1.0, 0.5]))
    shares = image[inner(reflecting, "Ground")] / [2.0, 1.0, 0.5]
    assert shares.max() <= MAX_CATCHER_RATIO * (1 + 1e-5)
    assert np.median(shares) == pytest.approx(1, abs=0.01)


def test_ground_under_a_lamp_of_one_channel_hides_that_channel_alone(standing):
    shares = rendered(standing, blue_lamp_alone, background(kind="color", color=[1.0, 1.0, 1.0]))
    shares = shares[inner(standing, "Ground")]
    np.testing.assert_allclose(shares[:, :2], 1, rtol=1e-5)
    assert (shares[:, 2].min(), shares[:, 2].max()) == (0, pytest.approx(1, rel=1e-4))


def test_there_is_no_seam_where_the_ground_ends():
    scene = ball_scene(studio())
    rim = scene.meshes[-1].positions[1:]
    assert np.abs(free_share(rim.astype(float), studio()) - 1).max() < 1e-3
    assert rim[:, 1].max() < CENTRE[1] - RADIUS < rim[:, 1].min() + 1e-3


def test_reflected_light_colours_the_ground(reflecting, standing):
    """What is shown is the light that a white ground has, over that without the ball, in front of what is behind."""
    white = background(kind="color", color=[1.0, 1.0, 1.0])
    catcher, ground = rendered(reflecting, white), inner(reflecting, "Ground")
    plain = rendered(reflecting, plain_ground)
    level = texel_directions(128, 256).reshape(-1, 3).astype(float)
    weights = np.maximum(level[:, 1], 0) * np.repeat(texel_solid_angles(128, 256), 256)
    unoccluded = weights @ lookup(studio(), level.astype(np.float32))
    expected = plain[ground] / (0.5 / np.pi * unoccluded)
    np.testing.assert_allclose(catcher[ground], expected, rtol=0.01)
    gained = catcher[ground] / rendered(standing, white)[ground]
    assert gained[:, 0].max() > 1.05
    assert gained[:, 1].max() < 0.5 * (gained[:, 0].max() - 1) + 1
    parts = [rendered(reflecting, white, set_paths(paths)) for paths in ("direct", "first_bounce", "further_bounces")]
    np.testing.assert_allclose(np.sum(parts, axis=0), catcher, rtol=1e-3, atol=1e-4)


def test_background_is_the_map_or_a_colour_or_blurred(standing):
    outside, plain = inner(standing, None), rendered(standing)
    if not outside.any():
        pytest.fail("the view shows no background")
    for scale in (2.0, 0.0):
        image = rendered(standing, background(kind="color", color=[0.3, 0.2, 0.1]), environment(intensity=scale))
        np.testing.assert_allclose(image[outside], np.broadcast_to([0.3, 0.2, 0.1], image[outside].shape), rtol=1e-5)
    image = rendered(standing, background(kind="color"))
    ball = inner(standing, "Ball")
    np.testing.assert_array_equal(image[ball], plain[ball])
    turn = 40.0
    image = rendered(standing, background(kind="blurred", blur=12.0), environment(rotation=turn, intensity=2.0))
    towards = rotate_about_y(directions(standing)[outside].astype(float), -turn).astype(np.float32)
    np.testing.assert_allclose(image[outside], 2 * lookup(prefiltered(downsampled(studio()), 12.0), towards), rtol=1e-4)


def test_transparent_pictures_compose_over_anything(tmp_path, standing):
    """Over a colour they are what that colour as a background gives, in grey light: shadows have no colour in alpha."""
    grey = np.repeat(studio()[..., :1], 3, axis=-1)
    transfer = bake_corner_scene(ball_scene(grey), "direct", tmp_path)
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


def test_a_live_picture_switches_at_once(standing):
    """Nothing has to be shaded for another background, and none for a catcher that becomes a plain ground."""
    picture = run_until_exact(Picture(standing, "front", Cache(BUDGET)))
    assert picture.encode_alpha(picture.all_tiles()) is None
    behind = [background(kind=kind) for kind in ("blurred", "color", "transparent")]
    for change in (*behind, plain_ground):
        picture.set_look(make_look(standing, change))
        advance = picture.advance(None)
        assert advance.exact
        assert advance.changed
        np.testing.assert_array_equal(picture.image(), rendered(standing, change)[..., :3])
    picture.set_look(make_look(standing, background(kind="transparent")))
    picture.advance(None)
    alpha = np.frombuffer(picture.encode_alpha(picture.all_tiles()), np.uint8)
    assert len(alpha) == SIZE[0] * SIZE[1]
    assert {0, 255} <= set(alpha)
    picture.set_look(make_look(standing))
    np.testing.assert_array_equal(run_until_exact(picture).image(), rendered(standing))


def test_lamps_that_move_keep_the_ground_near_its_look(standing):
    picture = Picture(standing, "front", Cache(BUDGET))
    behind = background(kind="color", color=[1.0, 1.0, 1.0])
    picture.set_look(make_look(standing, changes(set_only_area_light, behind)))
    before = run_until_exact(picture).image()
    moved = {**POINT_LIGHT, "position": [-0.5, 1.8, 0.4]}
    change = changes(set_only_area_light, behind, lambda d: d["lights"].update(Lamp=moved))
    picture.set_look(make_look(standing, change))
    picture.advance(None)
    ground, exact = inner(standing, "Ground"), rendered(standing, change)
    errors = [relative_rmse(image[ground], exact[ground]) for image in (picture.image(), before)]
    assert errors[0] < 0.5 * errors[1]
    np.testing.assert_allclose(run_until_exact(picture).image(), exact, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("kind", ["map", "blurred", "color"])
def test_brightness_of_the_environment_multiplies_what_is_there(standing, kind, monkeypatch):
    """Only a colour, which is not the light's own, is written anew."""
    brighter = changes(background(kind=kind), environment(intensity=2.0, color=[1.0, 0.5, 0.2]))
    expected = rendered(standing, brighter)
    picture = Picture(standing, "front", Cache(BUDGET))
    picture.set_look(make_look(standing, background(kind=kind)))
    run_until_exact(picture)
    write, written = Background._background_radiance, []
    monkeypatch.setattr(Background, "_background_radiance", lambda *given: written.append(given) or write(*given))
    picture.set_look(make_look(standing, brighter))
    assert picture.advance(None).changed
    assert bool(written) == (kind == "color")
    np.testing.assert_allclose(picture.image(), expected, rtol=1e-6)


def test_coverage_follows_the_ground_alone(standing, monkeypatch):
    """Whatever a hand does a live picture hides what a new one of the same look does, and asks no more than it must."""
    picture, asked = Picture(standing, "front", Cache(BUDGET)), []
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
        look = make_look(standing, changes(transparent, change))
        expected = render_image(standing, "front", look, for_display=True)[..., 3]
        picture.set_look(look)
        run_until_exact(picture)
        with monkeypatch.context() as patched:
            patched.setattr(Background, "_shadow_opacity", lambda *given: asked.append(given) or ask(*given))
            asked.clear()
            tiles = picture.encode_alpha([(0, 0, 40, 10), (0, 10, 15, 20), (15, 10, 25, 20)])
        assert len(asked) == max_error
        alpha = picture.alpha(for_display=True)
        np.testing.assert_allclose(alpha, expected, atol=1e-6)  # lamps are mixed in, which rounds otherwise
        shown = to_bytes(alpha)
        assert tiles == b"".join(tile.tobytes() for tile in (shown[:10], shown[10:, :15], shown[10:, 15:]))
