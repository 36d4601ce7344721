"""Pending jobs of a picture: eviction, sharing, cancellation, and results of outdated looks."""

from __future__ import annotations

import threading

import numpy as np
import numpy_reference as ref
import pytest
from picture_edits import BALL, WALL, ignore_progress, open_exact_picture, set_sigma, set_single_term_ball
from session_edits import BUDGET, kind_of, make_look, relative_rmse, run_until_exact, task_of

from relume.core.cache import Cache
from relume.core.errors import CancelledError, MemoryBudgetError
from relume.live.fixed_camera.picture import Picture
from relume.operators.linear_operator import operator_bytes


def test_an_eviction_during_a_drag_recovers(transfer):
    """Half of a change is shown when another session takes the cache; the rest follows after freezing again."""
    rows = transfer.views["front"].rows(2)
    cache = Cache(operator_bytes(rows.stop - rows.start, 256) + 200_000)  # one operator, and the images
    picture = open_exact_picture(transfer, BALL + "theta_h", cache=cache)
    look = make_look(transfer, set_sigma(0.06))
    picture.set_look(look)
    assert not picture.advance(5).exact
    open_exact_picture(transfer, BALL + "theta_h", cache=cache, look=make_look(transfer, set_sigma(0.3, ior=2.5)))
    assert picture.next_job() is not None
    assert not picture.advance(5).exact
    run_until_exact(picture)
    assert np.isfinite(picture.image()).all()
    assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_sessions_share_equal_operators_only(transfer):
    cache = Cache(BUDGET)
    open_exact_picture(transfer, BALL + "theta_h", cache=cache)
    used = cache.used_bytes
    second = Picture(transfer, "front", cache)
    second.set_look(make_look(transfer, set_sigma(0.5)))
    second.prepare(BALL + "theta_h")
    run_until_exact(second)
    assert cache.used_bytes - used < operator_bytes(297, 256) / 2  # values of θh are not part of its operator
    third = open_exact_picture(
        transfer, BALL + "theta_h", cache=cache, look=make_look(transfer, set_sigma(0.5, ior=3.0))
    )
    assert relative_rmse(third.image(), second.image()) > 1e-3
    for picture, change in ((second, set_sigma(0.5)), (third, set_sigma(0.5, ior=3.0))):
        expected = ref.full_evaluation(transfer, "front", make_look(transfer, change))
        assert relative_rmse(picture.image(), expected) < 1e-6


def test_a_cancelled_freeze_changes_neither_picture_nor_cache(transfer):
    cache = Cache(BUDGET)
    picture = open_exact_picture(transfer, cache=cache)
    before, used = picture.image(), cache.used_bytes
    look = make_look(transfer, set_sigma(0.07))
    picture.set_look(look)
    waiting = picture.next_job().key
    with pytest.raises(CancelledError):
        picture.run_next_job(ignore_progress, lambda: True)
    assert cache.used_bytes == used
    assert picture.next_job().key == waiting
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)
    assert relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def drawn(document):
    document["materials"]["Ball"]["terms"][1]["curves"] = {"theta_h": {"points": [[0, 1], [90, 0]]}}


def test_a_curve_whose_operator_does_not_fit_is_shaded(transfer):
    """It can be prepared and drawn; the picture stays until the edit stops, and is then updated."""
    picture = open_exact_picture(transfer, cache=Cache(400_000))
    before = picture.image()
    picture.prepare(BALL + "theta_h")
    assert picture.next_job() is None
    look = make_look(transfer, drawn)
    picture.set_look(look, active_pointer=BALL + "theta_h")
    advance = picture.advance(None)
    assert advance.fidelity == "approximate"
    np.testing.assert_array_equal(picture.image(), before)
    job = picture.next_job()
    assert kind_of(job) == "image"
    assert job.is_refinement
    expected = ref.full_evaluation(transfer, "front", look)
    assert relative_rmse(run_until_exact(picture).image(), expected) < 1e-6
    picture.set_look(make_look(transfer), active_pointer=BALL + "theta_h")
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_a_curve_without_operator_is_shaded_while_a_rotation_is_prepared(transfer):
    picture = open_exact_picture(transfer, cache=Cache(600_000))
    picture.prepare("/environment/rotation")
    job = picture.next_job()
    assert kind_of(job) == "preview"
    look = make_look(transfer, drawn)
    picture.check(look)
    picture.set_look(look)
    job.apply(job.run(ignore_progress, lambda: False))
    assert relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def many_terms(document):
    for material in document["materials"].values():
        material["terms"] = [{"model": "lambert", "color": [0.1, 0.1, 0.1], "texture": None}] * 16


def test_a_look_whose_images_do_not_fit_is_rejected_and_the_picture_stays(transfer):
    picture = open_exact_picture(transfer, cache=Cache(400_000))
    before = picture.image()
    with pytest.raises(MemoryBudgetError):
        picture.check(make_look(transfer, many_terms))
    assert picture.next_job() is None
    assert picture.advance(None).exact
    np.testing.assert_array_equal(picture.image(), before)


def test_a_prepared_curve_is_followed_during_another_freeze(transfer):
    """A job's result does not depend on edits of its picture."""
    picture = open_exact_picture(transfer, BALL + "theta_h")
    picture.prepare(WALL + "alpha")
    need = picture.next_job()
    assert "Wall" in need.label
    made = []
    thread = threading.Thread(target=lambda: made.append(need.run(ignore_progress, lambda: False)))
    thread.start()
    for value in (0.1, 0.4, 0.15):
        look = make_look(transfer, set_sigma(value))
        picture.set_look(look)
        assert picture.advance(None).exact
        assert picture.next_job().key == need.key
        assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-5
    thread.join()
    before = picture.image()
    need.apply(made[0])
    job = picture.next_job()
    assert job is None or kind_of(job) == "resum"  # rounding of the drag's steps, when it stops
    np.testing.assert_array_equal(picture.image(), before)
    picture.highlight_pixels(WALL + "alpha", 0, 10)  # it is prepared now


def test_an_operator_with_outdated_fixed_curves_is_not_used(transfer):
    picture = open_exact_picture(transfer, BALL + "theta_d")
    picture.prepare(BALL + "theta_h")
    need = picture.next_job()
    look = make_look(transfer, set_sigma(0.2, ior=3.0))
    picture.set_look(look)
    assert picture.advance(None).exact  # θd, which is fixed in the operator
    need.apply(need.run(ignore_progress, lambda: False))
    assert picture.next_job().key != need.key
    assert relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_an_older_image_is_shown_until_a_newer_one_is_ready(transfer):
    """Otherwise a continuous edit would never show the material."""
    picture = Picture(transfer, "front", Cache(BUDGET))
    while task_of(need := picture.next_job()).term.model != "cook_torrance":
        need.apply(need.run(ignore_progress, lambda: False))
    look = make_look(transfer, set_sigma(0.1))
    picture.set_look(look)
    need.apply(need.run(ignore_progress, lambda: False))
    advance = picture.advance(None)
    assert advance.changed
    assert not advance.exact
    assert task_of(picture.next_job()).basis.affected_curves == ("theta_h",)
    assert relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", look)) < 1e-6


def test_an_opening_picture_shows_cheap_terms_first(transfer):
    def lambert_and_glossy(document):
        for material in document["materials"].values():
            material["terms"] = [{"model": "cook_torrance"}, {"model": "lambert"}]

    def order(*touched):
        picture = Picture(transfer, "front", Cache(BUDGET))
        picture.set_look(make_look(transfer, lambert_and_glossy))
        for pointer in touched:
            picture.prepare(pointer)
        made = []
        while (need := picture.next_job()) is not None and kind_of(need) == "image":
            made.append((task_of(need).target.name, task_of(need).term.model))
            need.apply(need.run(ignore_progress, lambda: False))
        return made, need

    shaded, _ = order()
    num_materials = len({name for name, _ in shaded})
    assert [model for _, model in shaded] == ["lambert"] * num_materials + ["cook_torrance"] * num_materials
    sizes = {name: np.diff(transfer.views["front"].bounds)[k] for k, name in enumerate(transfer.material_names)}
    assert [name for name, _ in shaded[:num_materials]] == sorted(sizes, key=sizes.get)[-num_materials:]
    shaded, need = order("/materials/Wall/terms/0/curves/theta_d")
    assert shaded == [("Wall", "lambert")]
    assert task_of(need).basis.affected_curves == ("theta_d",)  # its operator also gives the image


def test_results_of_a_removed_term_are_discarded(transfer):
    picture = open_exact_picture(transfer)
    picture.prepare(BALL + "theta_h")
    need = picture.next_job()
    look = make_look(transfer, set_single_term_ball)
    picture.set_look(look)
    need.apply(need.run(ignore_progress, lambda: False))
    assert relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", look)) < 1e-6
