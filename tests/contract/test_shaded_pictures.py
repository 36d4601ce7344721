"""The product's own shading, by boxes: what a picture shows before a curve is touched, and after."""

import pytest
from looks_of_pictures import EDITS, EDITS_OFTEN, lit
from oracle import copied, rendered_afresh
from sessions import BUDGET, look_of, relative_rmse, settle

import relume.operators.shade
from relume.memory import Memory
from relume.picture.picture import Picture
from relume.project.projector import Projector
from relume.project.shading.shader import Shader

A_THOUSANDTH = 1e-3


@pytest.fixture
def by_boxes(by_leaves, monkeypatch):
    monkeypatch.setattr(relume.operators.shade, "Shader", Shader)


def shown(transfer, *changes, touched=None):
    """A picture at rest, what a hand touches made ready."""
    picture = Picture(transfer, "front", Memory(BUDGET))
    picture.set_look(look_of(transfer, lit(*changes)))
    settle(picture)
    if touched is not None:
        picture.touch(touched)
        settle(picture)
    return picture


@pytest.mark.parametrize("edit", EDITS_OFTEN)
def test_an_edited_picture_is_the_shaded_one_to_a_thousandth(by_boxes, transfer, edit):
    pointer, change = EDITS[edit]
    with copied(transfer) as fresh:
        picture = shown(fresh, touched=pointer)
        picture.set_look(look_of(fresh, lit(change)))
        picture.advance(8)
        found = settle(picture).image()
    expected = rendered_afresh(transfer, look_of(transfer, lit(change)))
    assert relative_rmse(found, expected) < A_THOUSANDTH


def test_boxes_are_not_leaves(by_boxes, transfer, monkeypatch):
    """Were they the same, the above would hold whatever boxes give."""
    if transfer.method == "furnace":
        pytest.skip("it has no light triangles to take boxes of")
    look = look_of(transfer, lit())
    by_boxes = rendered_afresh(transfer, look)
    monkeypatch.setattr(relume.operators.shade, "Shader", Projector)
    assert 0 < relative_rmse(by_boxes, rendered_afresh(transfer, look)) < A_THOUSANDTH
