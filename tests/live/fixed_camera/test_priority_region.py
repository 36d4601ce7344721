"""The visible region of a picture is exact first; results of the rest are kept, and the whole stays exact."""

from __future__ import annotations

from itertools import count

import numpy as np
import numpy_reference as ref
import pytest
from session_edits import BUDGET, kind_of, make_look, run_next_job, run_until_exact, task_of

from relume.core.cache import Cache
from relume.core.errors import CancelledError
from relume.live.fixed_camera.picture import Picture
from relume.operators.shade import shade_rows

REGION = (4, 6, 16, 12)


@pytest.fixture(autouse=True)
def large(monkeypatch):
    """Treat small pictures like large ones, in steps as small as the visible region."""
    for name, value in {
        "strategies.shade._MIN_HIDDEN_SAMPLES": 0,
        "strategies.sparse_preview._MAX_SHADED_AT_ONCE": 0,
        "strategies.sparse_preview._NUM_SHADED": 40,
    }.items():
        monkeypatch.setattr(f"relume.live.fixed_camera.{name}", value)
    monkeypatch.setattr("relume.operators.shade._MIN_ROWS_PER_STEP", 16)


def visible_part(image):
    x, y, width, height = REGION
    return image[y : y + height, x : x + width]


TURNS = count(1)


def opened(transfer, region=REGION):
    """A picture of a look without stored images, after its first preview."""
    picture = Picture(transfer, "front", Cache(BUDGET), is_watched=True)
    degrees = float(next(TURNS))
    picture.set_look(make_look(transfer, lambda document: document["environment"].update(rotation=degrees)))
    picture.look_at(region)
    picture.advance(None)
    assert kind_of(run_next_job(picture)) == "preview"
    return picture


def run_until_visible_is_exact(picture):
    """Run jobs until the visible region is exact; return them."""
    made = []
    while picture.advance(None).fidelity != "exact":
        made.append(run_next_job(picture))
    return made


@pytest.mark.parametrize("method", ["transfer", "gathered"])
def test_the_visible_region_is_exact_first(request, method):
    transfer = request.getfixturevalue(method)
    picture = opened(transfer)
    made = run_until_visible_is_exact(picture)
    assert any(kind_of(job) == "region" for job in made)
    assert not picture.advance(None).exact
    early = picture.image()
    whole = run_until_exact(picture).image()
    np.testing.assert_array_equal(visible_part(early), visible_part(whole))
    assert np.abs(early - whole).max() > 1e-3
    np.testing.assert_allclose(whole, ref.full_evaluation(transfer, "front", picture._look), rtol=1e-3, atol=1e-5)


def test_another_region_becomes_exact_when_it_is_visible(transfer):
    picture = opened(transfer)
    run_until_visible_is_exact(picture)
    picture.look_at((5, 7, 4, 4))
    assert picture.advance(None).fidelity == "exact"
    picture.look_at((20, 10, 16, 12))
    assert picture.advance(None).fidelity != "exact"
    picture.look_at(None)
    assert picture.advance(None).fidelity == "preview"


def test_interrupted_shading_resumes(transfer, monkeypatch):
    picture = opened(transfer, None)
    while kind_of(job := picture.next_job()) == "preview" or task_of(job).target.material.num_samples < 100:
        run_next_job(picture)
    shaded, requested = [], []
    monkeypatch.setattr(
        "relume.operators.shade.shade_rows", lambda *arguments: shaded.append(arguments[4:6]) or shade_rows(*arguments)
    )
    with pytest.raises(CancelledError):
        job.run(lambda fraction: None, lambda: requested.append(1) or len(requested) > 2)
    assert kind_of(job) == "image"
    assert shaded
    job.run(lambda fraction: None, lambda: False)
    assert sorted(shaded) == sorted(set(shaded))
    assert sum(stop - start for start, stop in shaded) == task_of(job).target.material.num_samples


def test_a_large_picture_is_refined_progressively(transfer, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 4)
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MIN_FINER_RATIO", 1)
    picture, images = opened(transfer, None), []
    while not picture.advance(None).exact:
        if kind_of(run_next_job(picture)) == "preview":
            picture.advance(None)
            images.append(picture.image())
    errors = [float(np.sqrt(np.mean((image - picture.image()) ** 2))) for image in images]
    assert len(errors) > 1
    assert errors == sorted(errors, reverse=True)
