"""The product's own shading, by boxes: what a picture shows before a curve is touched, and after."""

import pytest
from looks_of_pictures import EDITS, LOBE, lit
from sessions import BUDGET, look_of, relative_rmse, settle

import relume.operators.shade
from relume.memory import Memory
from relume.picture.picture import Picture
from relume.project.projector import Projector
from relume.project.shader import Shader

A_THOUSANDTH = 1e-3


@pytest.fixture
def by_boxes(by_leaves, monkeypatch):
    monkeypatch.setattr(relume.operators.shade, "Shader", Shader)


def shown(transfer, *changes, touched=None):
    picture = Picture(transfer, "front", Memory(BUDGET))
    picture.set_look(look_of(transfer, lit(*changes)))
    settle(picture)
    if touched is not None:
        picture.touch(touched)
        settle(picture)
    return picture


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_picture_is_the_shaded_one_to_a_thousandth(by_boxes, transfer, edit):
    pointer, change = EDITS[edit]
    picture = shown(transfer, touched=pointer)
    picture.set_look(look_of(transfer, lit(change)))
    picture.advance(8)
    assert relative_rmse(settle(picture).image(), shown(transfer, change).image()) < A_THOUSANDTH


def test_touching_a_curve_moves_the_picture_by_less_than_a_thousandth(by_boxes, transfer):
    assert relative_rmse(shown(transfer, touched=LOBE).image(), shown(transfer).image()) < A_THOUSANDTH


def test_operators_and_boxes_are_two_quadratures(by_boxes, transfer, monkeypatch):
    """Were they the same, the two above would hold whatever boxes give."""
    picture = shown(transfer)
    monkeypatch.setattr(relume.operators.shade, "Shader", Projector)
    assert relative_rmse(picture.image(), shown(transfer).image()) > 0
