"""Pixel probe and highlighting: the terms of a pixel, and the pixels of a part of a curve."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from picture_edits import BALL, find_pure_ball_pixels, open_exact_picture, set_single_term_ball
from session_edits import make_look

from relume.core.errors import NotPrecomputedError, ParameterError


def test_probe_bands_sum_to_the_radiance_of_the_term(transfer):
    look = make_look(transfer, set_single_term_ball)
    pointer = "/materials/Ball/terms/0/curves/theta_h"
    picture = open_exact_picture(transfer, pointer, look=look)
    image, alone = picture.image(), find_pure_ball_pixels(transfer)
    y, x = np.nonzero(alone)
    assert len(y) > 100
    for k in range(0, len(y), 17):
        probe = picture.inspect(int(x[k]), int(y[k]))
        assert (probe["material"], probe["curve"]) == ("Ball", pointer)
        assert np.shape(probe["bands"]) == (3, 256)
        np.testing.assert_allclose(probe["radiance"], image[y[k], x[k]], rtol=1e-5)
        np.testing.assert_allclose(np.sum(probe["bands"], axis=1), image[y[k], x[k]], rtol=1e-4, atol=1e-6)
        assert np.min(probe["bands"]) > -1e-6 * image.max()


def test_each_band_of_the_probe_equals_that_band_alone(transfer):
    """A curve that is zero except for some bands gives the probe's values of these bands."""
    pointer = "/materials/Ball/terms/0/curves/theta_h"

    def only(first, last):
        def change(document):
            set_single_term_ball(document)
            bands = np.zeros(256)
            bands[first:last] = 2.0
            document["materials"]["Ball"]["terms"][0]["curves"] = {"theta_h": {"bands": bands.tolist()}}

        return make_look(transfer, change)

    whole = open_exact_picture(transfer, pointer, look=only(0, 256))
    image = open_exact_picture(transfer, pointer, look=only(40, 90)).image()
    y, x = (int(v) for v in np.argwhere(find_pure_ball_pixels(transfer))[150])
    bands = whole.inspect(x, y)["bands"]
    np.testing.assert_allclose(bands[:, 40:90].sum(axis=1), image[y, x], rtol=1e-3, atol=1e-5)


def test_the_probe_returns_the_visible_surface(transfer):
    picture, view = open_exact_picture(transfer), next(iter(transfer.views.values()))
    to_camera = np.linalg.inv(view.camera.to_world)
    height = 2 * np.tan(view.camera.yfov / 2)
    y, x = np.nonzero(find_pure_ball_pixels(transfer))
    for k in range(0, len(y), 37):
        probe = picture.inspect(int(x[k]), int(y[k]))
        position = (to_camera @ [*probe["position"], 1.0])[:3]
        column = view.width / 2 + position[0] / -position[2] / height * view.height
        row = view.height / 2 - position[1] / -position[2] / height * view.height
        assert 0 <= column - x[k] <= 1
        assert 0 <= row - y[k] <= 1
        assert np.linalg.norm(probe["normal"]) == pytest.approx(1, rel=1e-5)
        towards = view.camera.to_world[:3, 3] - probe["position"]
        assert probe["normal"] @ towards > 0


def test_probe_of_background_and_outside(transfer):
    picture = open_exact_picture(transfer)
    probe = picture.inspect(2, 2)
    assert (probe["material"], probe["bands"], probe["curve"]) == (None, None, None)
    assert (probe["position"], probe["normal"]) == (None, None)
    np.testing.assert_allclose(probe["radiance"], picture.image()[2, 2], rtol=1e-5)
    for x, y in ((-1, 0), (64, 0), (0, 48), (0, -1)):
        with pytest.raises(ParameterError):
            picture.inspect(x, y)


@pytest.mark.parametrize(("scale", "color"), [(2.0, [1.0, 1.0, 1.0]), (0.5, [1.0, 0.2, 3.0])])
def test_light_gains_scale_probe_and_picture_without_freezing(transfer, scale, color):
    def brighten(document):
        document["environment"] |= {"intensity": scale, "color": color}

    fresh = open_exact_picture(transfer, BALL + "theta_h")
    scaled = open_exact_picture(transfer, BALL + "theta_h")
    scaled.set_look(make_look(transfer, brighten))
    assert scaled.next_job() is None
    assert scaled.advance(None).tiles == scaled.all_tiles()
    gain = scale * np.array(color)
    np.testing.assert_allclose(scaled.image(), gain * fresh.image(), rtol=1e-6)
    y, x = (int(v) for v in np.argwhere(find_pure_ball_pixels(transfer))[100])
    for key in ("radiance", "bands"):
        actual, expected = np.asarray(scaled.inspect(x, y)[key]), np.asarray(fresh.inspect(x, y)[key])
        np.testing.assert_allclose(actual.T, gain * expected.T, rtol=1e-6)


def test_highlighting_all_bands_is_the_material_and_parts_add_up(transfer):
    pointer = "/materials/Ball/terms/0/curves/theta_h"
    picture = open_exact_picture(transfer, pointer, look=make_look(transfer, set_single_term_ball))
    whole = picture.highlight_pixels(pointer, 0, 90)
    lit = find_pure_ball_pixels(transfer) & (picture.image().max(axis=2) > 1e-3)
    assert lit.sum() > 100
    np.testing.assert_allclose(whole[lit], 1, atol=1e-4)
    none = ~np.isin(np.arange(48 * 64), transfer.views["front"].pixel[transfer.views["front"].rows(2)]).reshape(48, 64)
    assert not whole[none].any()
    cuts = [0, 3.3, 7, 20, 61.7, 90]
    parts = [picture.highlight_pixels(pointer, a, b) for a, b in pairwise(cuts)]
    np.testing.assert_allclose(np.sum(parts, axis=0)[lit], whole[lit], atol=2e-4)
    assert all(stretch.max() > 0.01 for stretch in parts[:3])
    assert not picture.highlight_pixels(pointer, 50, 50).any()
    assert whole.dtype == np.float32
    assert whole.shape == (48, 64)


def test_highlighting_equals_the_probe(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    brushed = picture.highlight_pixels(BALL + "theta_h", 90 * 10 / 256, 90 * 40 / 256)
    luminance = np.float64([0.2126, 0.7152, 0.0722])
    for y, x in np.argwhere(find_pure_ball_pixels(transfer))[::37]:
        probe = picture.inspect(int(x), int(y))
        fraction = luminance @ probe["bands"][:, 10:40].sum(axis=1) / (luminance @ probe["radiance"])
        assert brushed[y, x] == pytest.approx(fraction, abs=1e-4)


def test_highlighting_needs_a_prepared_curve(transfer):
    with pytest.raises(NotPrecomputedError, match="select it"):
        open_exact_picture(transfer).highlight_pixels(BALL + "theta_h", 0, 10)


@pytest.mark.parametrize("pointer", ["/materials/Nobody/terms/0/curves/theta_h", BALL + "nothing", "", "/", BALL[:-1]])
def test_pointers_to_no_curve_are_rejected(transfer, pointer):
    picture = open_exact_picture(transfer)
    for call in (picture.prepare, picture.curve, lambda p: picture.highlight_pixels(p, 0, 10)):
        with pytest.raises(ParameterError):
            call(pointer)
    assert picture.next_job() is None
