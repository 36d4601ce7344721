"""The product's shading with prefiltered boxes, before and after a curve is prepared."""

import pytest
from exact_pictures import open_copy, render_uncached
from look_edits import EDITS, MARKED_EDITS, add_lights
from session_edits import BUDGET, make_look, relative_rmse, run_until_exact

import relume.operators.shade
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.transport.projector import Projector
from relume.transport.shading.shader import Shader

A_THOUSANDTH = 1e-3


@pytest.fixture
def by_boxes(shade_with_projector, monkeypatch):
    monkeypatch.setattr(relume.operators.shade, "Shader", Shader)


def converged_picture(transfer, *changes, touched=None):
    """A converged picture with a prepared pointer."""
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(make_look(transfer, add_lights(*changes)))
    run_until_exact(picture)
    if touched is not None:
        picture.prepare(touched)
        run_until_exact(picture)
    return picture


@pytest.mark.parametrize("edit", MARKED_EDITS)
def test_edited_picture_matches_shading_to_one_thousandth(by_boxes, transfer, edit):
    pointer, change = EDITS[edit]
    with open_copy(transfer) as fresh:
        picture = converged_picture(fresh, touched=pointer)
        picture.set_look(make_look(fresh, add_lights(change)))
        picture.advance(8)
        actual = run_until_exact(picture).image()
    expected = render_uncached(transfer, make_look(transfer, add_lights(change)))
    assert relative_rmse(actual, expected) < A_THOUSANDTH


def test_boxes_differ_from_subdivided_triangles(by_boxes, transfer, monkeypatch):
    """If they were equal, the test above could not detect errors of the boxes."""
    if transfer.method == "furnace":
        pytest.skip("it has no light triangles to take boxes of")
    look = make_look(transfer, add_lights())
    by_boxes = render_uncached(transfer, look)
    monkeypatch.setattr(relume.operators.shade, "Shader", Projector)
    assert 0 < relative_rmse(by_boxes, render_uncached(transfer, look)) < A_THOUSANDTH
