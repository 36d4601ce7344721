"""Background and shadow catchers with a free camera, against fixed views of the same camera."""

import numpy as np
import pytest
from session_edits import bake_corner_scene, make_look
from shadow_catcher_scenes import (
    POINT_LIGHT,
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
from tiny_scenes import studio

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

WHITE, COLOR = background(kind="color", color=[1.0, 1.0, 1.0]), background(kind="color", color=[2.0, 1.0, 0.5])
TRANSPARENT = background(kind="transparent")


@pytest.fixture(scope="module")
def fixed(tmp_path_factory):
    return bake_corner_scene(ball_scene(studio()), "gather", tmp_path_factory.mktemp("fixed"))


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    recipe = Recipe("probes", ("front",), SIZE, 400, num_probes=20000)
    store = bake_in_process(
        METHODS["probes"], ball_scene(studio()), recipe, tmp_path_factory.mktemp("moving") / "s.zarr"
    )
    return open_bake(store, Cache(1 << 30))


def rendered(transfer, *changes_applied, **kwargs):
    return render_image(transfer, "front", make_look(transfer, changes(*changes_applied)), **kwargs)


@pytest.mark.parametrize(
    ("changes_applied", "at_most"),
    [
        ((), 0.03),
        ((WHITE,), 0.05),
        ((WHITE, environment(rotation=70.0)), 0.05),
        ((background(kind="blurred", blur=12.0), environment(rotation=40.0, intensity=2.0)), 0.03),
        ((COLOR, set_only_area_light), 0.15),
        ((COLOR, set_only_spot_light, set_paths("direct")), 0.15),
        ((COLOR, set_only_emissive_ball), 0.01),
        ((WHITE, set_paths("direct")), 0.05),
        ((WHITE, plain_ground), 0.05),
    ],
)
def test_shadow_catchers_equal_fixed_views(fixed, free_bake, changes_applied, at_most):
    """Except for edges, which are not antialiased, and for shadows limited by the probe density."""
    expected, actual = rendered(fixed, *changes_applied), rendered(free_bake, *changes_applied)
    is_compared = inner(fixed, "Ground") | inner(fixed, None)
    assert np.sqrt(np.mean((actual - expected)[is_compared] ** 2) / np.mean(expected[is_compared] ** 2)) < at_most


def test_unoccluded_grounds_are_transparent(free_bake, fixed):
    """To rounding: both are sums of the same light."""
    lit = changes(WHITE, set_paths("direct"), lambda d: d["lights"].update(Lamp=POINT_LIGHT))
    ground = rendered(free_bake, lit)[inner(fixed, "Ground")]
    assert (np.abs(ground - 1) < 1e-3).all(axis=1).mean() > 0.25  # some probes are occluded
    assert ground.min() < 0.5


def test_indirect_light_alone_has_no_background(free_bake, fixed):
    image = rendered(free_bake, COLOR, set_paths("first_bounce"))
    assert not image[inner(fixed, None)].any()
    assert image[inner(fixed, "Ground")].any()


def test_transparent_pictures_have_the_alpha_of_fixed_views(fixed, free_bake):
    expected, actual = rendered(fixed, TRANSPARENT), rendered(free_bake, TRANSPARENT)
    assert actual.shape == (*SIZE[::-1], 4)
    is_ground = inner(fixed, "Ground")
    assert np.sqrt(np.mean((actual - expected)[is_ground, 3] ** 2)) < 0.05
    assert (actual[inner(fixed, None)] == 0).all()
    assert (actual[inner(fixed, "Ball")][:, 3] == 1).all()
    shown, shown_fixed = (rendered(t, TRANSPARENT, for_display=True) for t in (free_bake, fixed))
    assert np.sqrt(np.mean((shown - shown_fixed)[is_ground, 3] ** 2)) < 0.05


def test_a_live_picture_becomes_transparent_and_opaque_again(free_bake):
    picture = FreeCameraPicture(free_bake, "front")
    for _ in range(2):
        picture.set_look(make_look(free_bake, TRANSPARENT))
        picture.advance(None)
        alpha = np.frombuffer(picture.encode_alpha(picture.all_tiles()), np.uint8)
        assert len(alpha) == SIZE[0] * SIZE[1]
        assert {0, 255} <= set(alpha)
        picture.set_look(make_look(free_bake))
        picture.advance(None)
        assert picture.encode_alpha(picture.all_tiles()) is None
