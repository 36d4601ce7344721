"""Pictures while the environment is turned: a few samples shaded at once, all of them at rest."""

from __future__ import annotations

import numpy as np
import pytest
import twins
from sessions import BUDGET, look_of, relative_rmse, settle

from relume.transfer.cache import FrozenCache
from relume.transfer.glimpse import Glimpse, choose_sparse
from relume.transfer.picture import Picture


def turned(degrees):
    def change(document):
        document["environment"]["rotation"] = degrees

    return change


@pytest.fixture
def picture(transfer):
    return settle(Picture(transfer, "front", FrozenCache(BUDGET)))


def make(picture, need):
    picture.adopt(need, need.make(lambda share: None, lambda: False))


@pytest.fixture
def few(monkeypatch):
    """As few samples as a picture of 200 × 150 would have shaded."""
    monkeypatch.setattr("relume.transfer.glimpse._MOST_SHADED", 600)


@pytest.mark.usefixtures("few")
def test_a_turned_light_is_glimpsed_at_once_and_shaded_at_rest(transfer, picture):
    still = picture.image()
    picture.set_look(look_of(transfer, turned(70)))
    need = picture.waiting()
    assert isinstance(need, Glimpse)
    assert not need.refines
    make(picture, need)
    advance = picture.advance(None)
    assert advance.changed
    assert not advance.exact
    expected = twins.full_evaluation(transfer, "front", look_of(transfer, turned(70)))
    glimpse_error = relative_rmse(picture.image(), expected)
    assert glimpse_error < 0.5 * relative_rmse(still, expected)
    assert glimpse_error > 1e-3
    assert picture.waiting().refines
    assert relative_rmse(settle(picture).image(), expected) < 1e-6
    assert picture.waiting() is None


@pytest.mark.usefixtures("few")
def test_a_hand_that_never_rests_sees_the_light_go(transfer, picture):
    picture.set_look(look_of(transfer, turned(20)))
    need = picture.waiting()
    picture.set_look(look_of(transfer, turned(40)))
    make(picture, need)
    assert picture.advance(None).changed
    assert isinstance(picture.waiting(), Glimpse)
    assert picture.waiting().key != need.key
    make(picture, picture.waiting())
    picture.advance(None)
    assert picture.waiting().refines


@pytest.mark.usefixtures("few")
def test_touching_the_rotation_chooses_the_samples_and_changes_nothing(transfer, picture):
    before = picture.image()
    picture.touch("/environment/rotation")
    need = picture.waiting()
    assert isinstance(need, Glimpse)
    make(picture, need)
    assert picture.waiting() is None
    assert picture.advance(None).exact
    np.testing.assert_array_equal(picture.image(), before)


def test_a_picture_that_shows_nothing_yet_is_shaded_not_glimpsed(transfer):
    picture = Picture(transfer, "front", FrozenCache(BUDGET))
    picture.set_look(look_of(transfer, turned(70)))
    assert not isinstance(picture.waiting(), Glimpse)
    assert not picture.waiting().refines


def test_where_memory_is_short_there_is_no_glimpse(transfer):
    picture = settle(Picture(transfer, "front", FrozenCache(200_000)))
    picture.set_look(look_of(transfer, turned(70)))
    assert not isinstance(picture.waiting(), Glimpse)


@pytest.mark.usefixtures("few")
def test_samples_between_are_means_of_their_neighbours(transfer):
    view = transfer.views["front"]
    for material in range(len(transfer.material_names)):
        sparse, rows = choose_sparse(view, material, has_rays=False), view.rows(material)
        num_samples, num_shaded = sparse.weights.shape
        assert num_samples == rows.stop - rows.start
        assert 0 < num_shaded < num_samples
        np.testing.assert_allclose(sparse.weights.sum(axis=1), 1, rtol=1e-5)
        assert sparse.weights.data.min() > 0
        whole = view.receivers(material)
        spread = sparse.weights @ sparse.receivers.normal
        assert np.mean(np.einsum("nc,nc->n", spread, whole.normal)) > 0.9
        assert sparse.num_bytes > sparse.weights.data.nbytes
