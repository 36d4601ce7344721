"""A downsampled bake gives the same pixels as the whole bake."""

import numpy as np
import pytest
from session_edits import make_look

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.output.render_image import render_image, render_small, small_size
from relume.views.downsampled import DownsampledStore


@pytest.mark.parametrize("step", [2, 3, 7])
@pytest.mark.parametrize("view", ["front", "left"])
def test_remaining_pixels_equal_those_of_the_whole_image(transfer, view, step):
    look = make_look(transfer)
    whole = render_image(transfer, view, look)
    small = render_image(transfer.downsampled(view, step), view, look)
    np.testing.assert_allclose(small, whole[step // 2 :: step, step // 2 :: step], rtol=2e-5, atol=1e-6)


def test_area_lights_on_remaining_pixels_equal_the_whole_image(gathered):
    """The seed of a point selects its samples of an area light; a downsampled bake keeps these seeds."""
    panel = {"kind": "rectangle", "position": [0.5, 1.2, 0.5], "direction": [-1, -1, -1], "size": [0.6, 0.4]}

    def change(document):
        document["environment"].update(intensity=0.0)
        document["transport"].update(show="direct")
        document["lights"].update(Panel={**panel, "emission": [5.0, 5.0, 5.0]})

    look = make_look(gathered, change)
    whole = render_image(gathered, "front", look)
    small = render_image(gathered.downsampled("front", 3), "front", look)
    assert whole.max() > 0.1
    np.testing.assert_allclose(small, whole[1::3, 1::3], rtol=2e-5, atol=1e-6)


def test_a_small_image_has_at_least_the_requested_width(transfer):
    look = make_look(transfer)
    widths = {width: render_small(transfer, "front", look, width).shape[1] for width in (10, 20, 32, 40, 64, 500)}
    for width in (10, 20, 40, 500):
        assert small_size(transfer, "front", width) == render_small(transfer, "front", look, width).shape[1::-1]
    assert widths == {10: 11, 20: 21, 32: 32, 40: 64, 64: 64, 500: 64}


def test_downsampled_views_store_nothing(baked):
    fresh = open_transfer(baked, Cache(1 << 30))
    before = sorted(baked.rglob("*"))
    small = fresh.downsampled("front", 4)
    render_image(small, "front", make_look(small))
    assert sorted(baked.rglob("*")) == before


def test_arrays_of_other_views_are_unchanged(transfer):
    store = DownsampledStore(transfer.store, 1, 4)
    np.testing.assert_array_equal(store.read("views/0/pixel", 5, 9), transfer.store.read("views/0/pixel", 5, 9))
    assert store.shape("lights/irradiance") == transfer.store.shape("lights/irradiance")
    assert store.shape("views/1/visibility")[0] == len(store.read("views/1/visibility"))
    assert store.read("views/1/pixel").max() < 16 * 12
