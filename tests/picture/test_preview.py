"""Pictures while the environment is turned: a few samples shaded at once, all of them at rest."""

from __future__ import annotations

import numpy as np
import pytest
import twins
from sessions import BUDGET, look_of, relative_rmse, settle

from relume.memory import Memory
from relume.picture.picture import Picture
from relume.picture.routes.preview import Preview, choose_sparse


def turned(degrees):
    def change(document):
        document["environment"]["rotation"] = degrees

    return change


@pytest.fixture
def picture(transfer):
    return settle(Picture(transfer, "front", Memory(BUDGET)))


def make(picture, need):
    picture.install(need, need.make(lambda share: None, lambda: False))


@pytest.fixture
def few(monkeypatch):
    """As few samples as a picture of 200 × 150 would have shaded."""
    monkeypatch.setattr("relume.picture.routes.preview._MOST_SHADED", 600)


@pytest.mark.usefixtures("few")
def test_a_turned_light_is_glimpsed_at_once_and_shaded_at_rest(transfer, picture):
    still = picture.image()
    picture.set_look(look_of(transfer, turned(70)))
    need = picture.next_job()
    assert isinstance(need, Preview)
    assert not need.refines
    make(picture, need)
    advance = picture.advance(None)
    assert advance.changed
    assert not advance.exact
    expected = twins.full_evaluation(transfer, "front", look_of(transfer, turned(70)))
    glimpse_error = relative_rmse(picture.image(), expected)
    assert glimpse_error < 0.5 * relative_rmse(still, expected)
    assert glimpse_error > 1e-3
    assert picture.next_job().refines
    assert relative_rmse(settle(picture).image(), expected) < 1e-6
    assert picture.next_job() is None


@pytest.mark.usefixtures("few")
def test_a_hand_that_never_rests_sees_the_light_go(transfer, picture):
    picture.set_look(look_of(transfer, turned(20)))
    need = picture.next_job()
    picture.set_look(look_of(transfer, turned(40)))
    make(picture, need)
    assert picture.advance(None).changed
    assert isinstance(picture.next_job(), Preview)
    assert picture.next_job().key != need.key
    make(picture, picture.next_job())
    picture.advance(None)
    assert picture.next_job().refines


@pytest.mark.usefixtures("few")
def test_touching_the_rotation_chooses_the_samples_and_changes_nothing(transfer, picture):
    before = picture.image()
    picture.touch("/environment/rotation")
    need = picture.next_job()
    assert isinstance(need, Preview)
    make(picture, need)
    assert picture.next_job() is None
    assert picture.advance(None).exact
    np.testing.assert_array_equal(picture.image(), before)


def test_a_picture_that_shows_nothing_yet_is_shaded_not_glimpsed(transfer):
    picture = Picture(transfer, "front", Memory(BUDGET))
    picture.set_look(look_of(transfer, turned(70)))
    assert not isinstance(picture.next_job(), Preview)
    assert not picture.next_job().refines


def test_where_memory_is_short_there_is_no_glimpse(transfer):
    picture = settle(Picture(transfer, "front", Memory(200_000)))
    picture.set_look(look_of(transfer, turned(70)))
    assert not isinstance(picture.next_job(), Preview)


@pytest.mark.usefixtures("few")
def test_samples_between_are_means_of_their_neighbours(transfer):
    view = transfer.views["front"]
    for material in range(len(transfer.material_names)):
        sparse, rows = choose_sparse(transfer, view, material, 0, reflects=True), view.rows(material)
        num_samples, num_shaded = sparse.weights.shape
        assert num_samples == rows.stop - rows.start
        assert 0 < num_shaded < num_samples
        np.testing.assert_allclose(sparse.weights.sum(axis=1), 1, rtol=1e-5)
        assert sparse.weights.data.min() > 0
        whole = view.receivers(material)
        spread = sparse.weights @ sparse.few.receivers.normal
        assert np.mean(np.einsum("nc,nc->n", spread, whole.normal)) > 0.9
        assert sparse.num_bytes > sparse.weights.data.nbytes
