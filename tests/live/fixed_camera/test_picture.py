"""Live pictures: switching curves, edits, exactness, and equal frames of a reopened store."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from exact_pictures import exact_image, render_uncached
from picture_edits import BALL, WALL, find_pure_ball_pixels, open_exact_picture, set_sigma, set_single_term_ball
from rgb9e5 import rgb9e5_pack
from session_edits import make_look, relative_rmse, run_until_exact

from relume.look import validate


@pytest.mark.parametrize("view", ["front", "left"])
def test_the_default_look_equals_a_full_evaluation(transfer, view):
    picture = open_exact_picture(transfer, view=view)
    expected = ref.full_evaluation(transfer, view, make_look(transfer))
    assert relative_rmse(picture.image(), expected) < 1e-6
    assert expected.std() > 0.1 * expected.mean()


@pytest.mark.parametrize("pointers", [("theta_h", "theta_d"), ("theta_d", "theta_h", "theta_d")])
def test_switching_curves_does_not_change_the_picture(transfer, pointers):
    picture = open_exact_picture(transfer)
    before = picture.image()
    for name in pointers:
        picture.prepare(BALL + name)
        run_until_exact(picture)
        assert relative_rmse(picture.image(), before) < 1e-6
    look = make_look(transfer, set_sigma(0.1))
    picture.set_look(look)
    edited = run_until_exact(picture).image()
    for name in pointers:
        picture.prepare(BALL + name)
        assert relative_rmse(run_until_exact(picture).image(), edited) < 1e-6
    assert relative_rmse(edited, ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_edits_of_one_curve_after_another_add_up(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    for value, ior in [(0.1, 1.8), (0.1, 3.0), (0.4, 3.0), (0.4, 1.2), (0.2, 1.2)]:
        look = make_look(transfer, set_sigma(value, ior=ior))
        picture.set_look(look)
        run_until_exact(picture)
        assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-5


def test_two_curves_edited_at_once(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    look = make_look(transfer, set_sigma(0.07, ior=4.0))
    picture.set_look(look)
    run_until_exact(picture)
    assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_a_prepared_curve_is_followed_at_once(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    picture.set_look(make_look(transfer, set_sigma(0.1)))
    assert picture.next_job() is None
    advance = picture.advance(None)
    assert advance.exact
    assert advance.changed


def test_only_exact_pictures_are_reported_as_exact(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    look = make_look(transfer, set_sigma(0.07))
    expected = ref.full_evaluation(transfer, "front", look)
    picture.set_look(look)
    first = picture.advance(2)
    assert not first.exact
    assert relative_rmse(picture.image(), expected) > 1e-4
    while not (advance := picture.advance(2)).exact:
        assert advance.changed
    assert relative_rmse(picture.image(), expected) < 1e-6


def test_a_picture_whose_curve_is_not_frozen_waits_and_is_not_exact(transfer):
    picture = open_exact_picture(transfer)
    before = picture.image()
    picture.set_look(make_look(transfer, set_sigma(0.07)))
    assert "Ball" in picture.next_job().label
    advance = picture.advance(None)
    assert not advance.exact
    np.testing.assert_array_equal(picture.image(), before)


def test_only_changed_tiles_are_sent(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h", WALL + "alpha")
    assert not picture.advance(None).changed
    before = picture.image()
    picture.set_look(make_look(transfer, set_sigma(0.1)))
    tiles = picture.advance(None).tiles
    inside = np.zeros(before.shape[:2], bool)
    for x, y, w, h in tiles:
        inside[y : y + h, x : x + w] = True
    np.testing.assert_array_equal(picture.image()[~inside], before[~inside])
    changed = np.any(picture.image() != before, axis=2)
    touches_ball = np.isin(np.arange(48 * 64), transfer.views["front"].pixel[transfer.views["front"].rows(2)])
    assert changed.any()
    assert not (changed.ravel() & ~touches_ball).any()


def test_payload_is_the_picture(transfer):
    picture = open_exact_picture(transfer)
    ((x, y, w, h),) = picture.all_tiles()
    assert (x, y, w, h) == (0, 0, 64, 48)
    floats = np.frombuffer(picture.encode(picture.all_tiles(), "f32"), "<f4").reshape(48, 64, 3)
    np.testing.assert_array_equal(floats, picture.image())
    words = np.frombuffer(picture.encode(picture.all_tiles(), "rgb9e5"), "<u4").reshape(48, 64)
    np.testing.assert_array_equal(words, rgb9e5_pack(picture.image()))


def test_a_flat_curve_gives_the_same_picture_with_any_prepared_curve(transfer):
    """A curve drawn flat: in a session that prepared it, and in a render of the same look."""

    def flat(document):
        document["materials"]["Ball"]["terms"] = [{"model": "cook_torrance", "color": [1, 1, 1]}]
        document["materials"]["Ball"]["terms"][0]["curves"] = {"theta_h": {"points": [[0, 3], [90, 3]]}}

    look, pointer = make_look(transfer, flat), "/materials/Ball/terms/0/curves/"
    images = [open_exact_picture(transfer, pointer + name, look=look).image() for name in ("theta_h", "theta_d")]
    picture = open_exact_picture(transfer, BALL + "theta_h")
    picture.set_look(look)
    images.append(run_until_exact(picture).image())
    expected = exact_image(transfer, look)
    for image in images:
        assert relative_rmse(image, expected) < 1e-4


def test_store_opened_again_gives_the_same_frame(transfer):
    looks = [
        make_look(transfer),
        make_look(transfer, set_sigma(0.1, ior=2.0)),
        make_look(transfer, set_single_term_ball),
    ]
    for look in looks:
        images = [render_uncached(transfer, look, "left") for _ in range(2)]
        np.testing.assert_array_equal(*images)
        session = open_exact_picture(transfer, look=look, view="left").image()
        assert relative_rmse(session, images[0]) < 1e-6


def test_render_is_a_full_evaluation(transfer):
    look = validate(
        {"materials": {"Wall": {"terms": [{"model": "ggx", "params": {"roughness": 0.2}}]}}}, transfer.default_look
    )
    image = render_uncached(transfer, look)
    assert image.dtype == np.float32
    assert relative_rmse(image, ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_curves_of_each_channel_reach_their_channel(transfer):
    def red(document):
        set_single_term_ball(document)
        term = document["materials"]["Ball"]["terms"][0]
        term["color"] = [1, 1, 1]
        term["curves"] = {"theta_h": {"points": [[0, 4], [30, 1], [90, 0]], "channels": "r"}}

    def plain(document):
        red(document)
        document["materials"]["Ball"]["terms"][0]["curves"] = {}

    colored, white = (open_exact_picture(transfer, look=make_look(transfer, change)).image() for change in (red, plain))
    alone = find_pure_ball_pixels(transfer)
    # lights below a billionth of a curve are omitted, and the curves of red omit others
    nothing = 1e-9 * white[alone].max()
    np.testing.assert_allclose(colored[alone][:, 1:], white[alone][:, 1:], rtol=1e-5, atol=nothing)
    assert relative_rmse(colored[alone][:, 0], white[alone][:, 0]) > 0.01
    expected = ref.full_evaluation(transfer, "front", make_look(transfer, red))
    assert relative_rmse(colored, expected) < 1e-6


def test_an_image_of_another_model_is_never_exact(transfer):
    """Lambert and Oren–Nayar have the same curve of the incident angle, and different images."""

    def rough(document):
        term = {"model": "oren_nayar", "color": [0.5, 0.5, 0.5], "params": {"sigma": 1.0}}
        document["materials"]["Ball"]["terms"][0] = term

    def smooth(document):
        document["materials"]["Ball"]["terms"][0] = {"model": "lambert", "color": [0.5, 0.5, 0.5]}

    picture = open_exact_picture(transfer, look=make_look(transfer, smooth))
    picture.set_look(make_look(transfer, rough))
    advance = picture.advance(None)
    assert not advance.exact
    assert advance.fidelity == "approximate"
