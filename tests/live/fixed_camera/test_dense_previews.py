"""Previews shade a part of the environment's direct light at all samples: on Lambertian terms, and in highlights."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import BUDGET, kind_of, make_look, relative_rmse, run_until_exact

from relume.core.cache import Cache
from relume.lights.refined_environment import RefinedEnvironment
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.strategies.dense_light import find_dense_terms
from relume.live.opened.refined_environments import LightsOfHighlights, RefinedEnvironments
from relume.views.pixel_blocks import block_sizes


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """As few shaded samples as for a picture of 200 × 150."""
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 300)


@pytest.fixture(autouse=True)
def in_baked_tiles(monkeypatch):
    """Exact pictures and previews in the tiles of the bake, which are not divided for another environment."""

    def exact(environments, environment):
        bake = environments._bake
        lights = bake.environment_lights(environment, LightQuality.EXACT)
        return RefinedEnvironment(bake.tiles, lights, np.empty(0, np.intp))

    def of_highlights(environments, environment):
        lights = environments._bake.environment_lights(environment, LightQuality.PREVIEW)
        return LightsOfHighlights(lights, np.arange(lights.num_lights))

    monkeypatch.setattr(RefinedEnvironments, "exact", exact)
    monkeypatch.setattr(RefinedEnvironments, "of_highlights", of_highlights)
    monkeypatch.setattr(RefinedEnvironments, "strong_tiles", lambda *_: None)


def turned(document):
    document["environment"]["rotation"] = 71.25  # no other test has cached images of it


def term_images(picture):
    return {
        (name, k): live.displayed.image.copy()
        for name, material in picture._images.by_name.items()
        if material.num_samples
        for k, live in enumerate(material.terms)
    }


def is_lambert(picture, key):
    name, k = key
    return picture._images.by_name[name].terms[k].term.model == "lambert"


def preview_and_exact(bake, change, budget=BUDGET):
    """Images of all terms of the preview of a change, then of the exact picture, and which are Lambertian."""
    picture = run_until_exact(Picture(bake, "front", Cache(budget)))
    picture.set_look(make_look(bake, change))
    picture.advance(None)
    assert kind_of(picture.next_job()) == "preview"
    picture.run_next_job(lambda fraction: None, lambda: False)
    assert not picture.advance(None).exact
    preview = term_images(picture)
    exact = term_images(run_until_exact(picture))
    return preview, exact, {key: is_lambert(picture, key) for key in preview}


def test_direct_light_on_lambertian_terms_is_exact(transfer):
    preview, exact, is_diffuse = preview_and_exact(transfer, turned)
    assert set(is_diffuse.values()) == {False, True}
    for key in (key for key in preview if is_diffuse[key]):
        np.testing.assert_allclose(preview[key], exact[key], rtol=1e-5, atol=1e-6)


def showing(show):
    def change(document):
        turned(document)
        document["transport"].update(show=show, bounces=1)

    return change


def test_interpolated_indirect_light_is_added_to_exact_direct_light(gathered):
    of_all, _, is_diffuse = preview_and_exact(gathered, showing("all"))
    indirect, _, _ = preview_and_exact(gathered, showing("first_bounce"))
    _, direct, _ = preview_and_exact(gathered, showing("direct"))
    assert set(is_diffuse.values()) == {False, True}
    for key in (key for key in of_all if is_diffuse[key]):
        assert indirect[key].max() > 0
        np.testing.assert_allclose(of_all[key], direct[key] + indirect[key], rtol=1e-4, atol=1e-5)


def glossy_errors(preview, exact, is_diffuse):
    return {key: relative_rmse(preview[key], exact[key]) for key in preview if not is_diffuse[key]}


def test_with_all_lights_and_whole_curves_highlights_are_exact(transfer, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._NUM_BRIGHT", 1000)
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._LEAST_PART", 0.0)
    errors = glossy_errors(*preview_and_exact(transfer, turned))
    assert errors
    assert max(errors.values()) < 0.03


def test_bright_highlights_are_not_interpolated(transfer, monkeypatch):
    dense = glossy_errors(*preview_and_exact(transfer, turned))
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._MAX_GLOSSY", 0)
    sparse = glossy_errors(*preview_and_exact(transfer, turned))
    assert all(dense[key] < 0.5 * sparse[key] for key in dense)


def test_materials_that_bend_most_come_first(transfer, monkeypatch):
    """With time for the samples of one material alone."""
    images = Picture(transfer, "front", Cache(BUDGET))._images
    targets, sizes = list(images.targets()), block_sizes(images.view, 1)
    glossy = {k: target for k, target in enumerate(targets) if not target.live.term.is_lambertian}
    first = min(glossy, key=lambda k: sizes[targets[k].material.index])
    assert len(glossy) > 1
    num_samples = targets[first].material.num_samples
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._MAX_GLOSSY", num_samples)
    assert first in find_dense_terms(images, targets, images.light).glossy
    assert sum(targets[k].material.num_samples for k in find_dense_terms(images, targets, images.light).glossy) <= (
        num_samples
    )


def test_images_that_take_too_long_stay_sparse(transfer, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._MAX_PAIRS", 1000)
    preview, exact, is_diffuse = preview_and_exact(transfer, turned)
    assert all(relative_rmse(preview[key], exact[key]) > 1e-3 for key in preview if is_diffuse[key])


def test_the_first_frame_stays_sparse(transfer, monkeypatch):
    """Before its samples are read, a dense preview takes longer."""

    def turned_further(document):
        document["environment"]["rotation"] = 123.0  # no other test has stored images of this look

    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MAX_SHADED_AT_ONCE", 100)
    picture = Picture(transfer, "front", Cache(BUDGET), is_watched=True)
    picture.set_look(make_look(transfer, turned_further))
    job = picture.next_job()
    assert kind_of(job) == "preview"
    job.apply(job.run(lambda fraction: None, lambda: False))
    picture.advance(None)
    first = term_images(picture)
    exact = term_images(run_until_exact(picture))
    assert any(relative_rmse(first[key], exact[key]) > 1e-3 for key in first if is_lambert(picture, key))
