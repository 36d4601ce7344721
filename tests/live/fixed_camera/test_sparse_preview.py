"""Pictures while the environment is rotated: a few samples shaded at once, all when the edit stops."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from session_edits import BUDGET, kind_of, make_look, relative_rmse, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.strategies.sparse_preview import choose_samples
from relume.views.pixel_blocks import block_sizes

FEW = 600  # samples


def rotated(degrees):
    def change(document):
        document["environment"]["rotation"] = degrees

    return change


@pytest.fixture
def picture(transfer):
    return run_until_exact(Picture(transfer, "front", Cache(BUDGET)))


def make(picture, need):
    need.apply(need.run(lambda fraction: None, lambda: False))


@pytest.fixture
def few(monkeypatch):
    """As few samples as for a picture of 200 × 150, and no light of all samples."""
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", FEW)
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._MAX_PAIRS", 0)


@pytest.mark.usefixtures("few")
def test_a_rotation_is_previewed_at_once_and_then_shaded(transfer, picture):
    still = picture.image()
    picture.set_look(make_look(transfer, rotated(70)))
    need = picture.next_job()
    assert kind_of(need) == "preview"
    assert not need.is_refinement
    make(picture, need)
    advance = picture.advance(None)
    assert advance.changed
    assert not advance.exact
    expected = ref.full_evaluation(transfer, "front", make_look(transfer, rotated(70)))
    preview_error = relative_rmse(picture.image(), expected)
    assert preview_error < 0.5 * relative_rmse(still, expected)
    assert preview_error > 1e-3
    assert picture.next_job().is_refinement
    assert relative_rmse(run_until_exact(picture).image(), expected) < 1e-6
    assert picture.next_job() is None


@pytest.mark.usefixtures("few")
def test_a_continuous_rotation_is_followed(transfer, picture):
    picture.set_look(make_look(transfer, rotated(20)))
    need = picture.next_job()
    picture.set_look(make_look(transfer, rotated(40)))
    make(picture, need)
    assert picture.advance(None).changed
    assert kind_of(picture.next_job()) == "preview"
    assert picture.next_job().key != need.key
    make(picture, picture.next_job())
    picture.advance(None)
    assert picture.next_job().is_refinement


@pytest.mark.usefixtures("few")
def test_preparing_the_rotation_selects_samples_only(transfer, picture):
    before = picture.image()
    picture.prepare("/environment/rotation")
    need = picture.next_job()
    assert kind_of(need) == "preview"
    make(picture, need)
    assert picture.next_job() is None
    assert picture.advance(None).exact
    np.testing.assert_array_equal(picture.image(), before)


def test_an_empty_picture_is_shaded_without_preview(transfer):
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(make_look(transfer, rotated(70)))
    assert kind_of(picture.next_job()) != "preview"
    assert not picture.next_job().is_refinement


def test_without_memory_there_is_no_preview(transfer):
    picture = run_until_exact(Picture(transfer, "front", Cache(200_000)))
    picture.set_look(make_look(transfer, rotated(70)))
    assert kind_of(picture.next_job()) != "preview"


@pytest.mark.usefixtures("few")
def test_other_samples_are_means_of_their_neighbors(transfer):
    view = transfer.views["front"]
    sizes = block_sizes(view, FEW)
    for material in range(len(transfer.material_names)):
        sparse = choose_samples(transfer, view, material, int(sizes[material]), has_indirect=True)
        rows = view.rows(material)
        num_samples, num_shaded = sparse.weights.shape
        assert num_samples == rows.stop - rows.start
        assert 0 < num_shaded < num_samples
        np.testing.assert_allclose(sparse.weights.sum(axis=1), 1, rtol=1e-5)
        assert sparse.weights.data.min() > 0
        whole = view.receivers(material)
        spread = sparse.weights @ sparse.samples.receivers(is_lit=True).normal
        assert np.mean(np.einsum("nc,nc->n", spread, whole.normal)) > 0.9
        assert sparse.num_bytes > sparse.weights.data.nbytes
