"""Operators too large in float32: in 16 bits, or of some samples; the picture is exact when the edit stops."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from picture_edits import open_exact_picture
from session_edits import kind_of, make_look, relative_rmse, run_until_exact, task_of

from relume.core.cache import Cache
from relume.live.fixed_camera import operator_budget
from relume.live.fixed_camera.picture import Picture
from relume.math.daubechies import analysis
from relume.operators.linear_operator import operator_bytes

FLOOR, WALL = "/materials/Floor/terms/1/", "/materials/Wall/terms/1/"
IMAGES = 400_000  # images of the still life and other data of its pictures
A_THOUSANDTH = 1e-3


def rough(roughness):
    def change(document):
        document["materials"]["Floor"]["terms"][1].setdefault("params", {})["roughness"] = roughness

    return change


def bent(points, material="Floor", curve="theta_h"):
    def change(document):
        document["materials"][material]["terms"][1]["curves"] = {curve: {"points": points}}

    return change


def num_samples(transfer, material):
    rows = transfer.views["front"].rows(transfer.material_names.index(material))
    return rows.stop - rows.start


@pytest.fixture
def half(transfer):
    """Memory for the floor's operator in 16 bits."""
    num = num_samples(transfer, "Floor")
    memory = Cache(operator_bytes(num, 256, bits=16) + IMAGES)
    assert memory.budget_bytes < operator_bytes(num, 256)
    return memory


@pytest.fixture
def small(transfer):
    """Memory for operators of some of the floor's samples only."""
    return Cache(operator_bytes(num_samples(transfer, "Floor"), 256, bits=16) - IMAGES)


def drag(picture, transfer, change, pointer, max_coefficients=None):
    picture.set_look(make_look(transfer, change), active_pointer=pointer)
    assert picture.next_job() is None or picture.next_job().is_refinement
    return picture.advance(max_coefficients)


def shown_exactly(transfer, change):
    return ref.full_evaluation(transfer, "front", make_look(transfer, change))


def test_a_16_bit_operator_is_near_exact_and_then_exact(transfer, half):
    picture = open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=half)
    before = picture.image()
    for points in ([[0, 3.0], [20, 0.5], [90, 0]], [[0, 9.0], [5, 0.1], [90, 0.02]]):
        advance = drag(picture, transfer, bent(points), FLOOR + "curves/theta_h")
        assert (advance.fidelity, advance.exact) == ("near_exact", False)
        error = relative_rmse(picture.image(), shown_exactly(transfer, bent(points)))
        assert 1e-8 < error < A_THOUSANDTH
    assert kind_of(picture.next_job()) == "image"
    assert relative_rmse(run_until_exact(picture).image(), shown_exactly(transfer, bent(points))) < 1e-6
    assert half.used_bytes <= half.budget_bytes
    picture.set_look(make_look(transfer))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_a_hundred_drags_in_16_bits_leave_no_error(transfer, half):
    rng = np.random.default_rng(3)
    picture = open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=half)
    before = picture.image()
    for _ in range(100):
        drag(picture, transfer, rough(float(rng.uniform(0.1, 0.9))), FLOOR + "curves/theta_h", 20)
    drag(picture, transfer, lambda document: None, FLOOR + "curves/theta_h")
    assert relative_rmse(picture.image(), before) < A_THOUSANDTH
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


@pytest.mark.parametrize("held", ["curves/theta_h", pytest.param("params/roughness", marks=pytest.mark.slow)])
def test_a_subsampled_operator_is_used_if_16_bits_are_too_large(transfer, small, monkeypatch, held):
    if held == "params/roughness":  # its few nodes would fit
        small._state.budget_bytes = operator_bytes(num_samples(transfer, "Floor"), 12, bits=16)
        monkeypatch.setattr(operator_budget, "_SUBSAMPLED_BUDGET_DIVISOR", 1)
    picture = open_exact_picture(transfer, cache=small)
    before = picture.image()
    picture.prepare(FLOOR + held)
    job = picture.next_job()
    assert kind_of(job) == "operator"
    assert task_of(job).form.step > 1
    assert job.run(lambda fraction: None, lambda: False).interpolation is not None
    run_until_exact(picture)
    drags = [rough(0.35), rough(0.25)]
    if held == "curves/theta_h":
        drags = [bent([[0, value], [20, 0.5], [90, 0]]) for value in (3, 5)]
    for change in drags:
        advance = drag(picture, transfer, change, FLOOR + held)
        assert (advance.fidelity, advance.exact) == ("incremental", False)
        expected = shown_exactly(transfer, change)
        assert relative_rmse(picture.image(), expected) < 0.5 * relative_rmse(before, expected)
    assert kind_of(picture.next_job()) == "image"
    assert relative_rmse(run_until_exact(picture).image(), expected) < 1e-6
    assert small.used_bytes <= small.budget_bytes
    picture.set_look(make_look(transfer))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_a_drag_back_restores_the_picture(transfer, small):
    """Shadows and edges of an image are restored to the last digit."""
    picture = open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=small)
    before = picture.image()
    drag(picture, transfer, rough(0.2), FLOOR + "curves/theta_h")
    assert relative_rmse(picture.image(), before) > 0.005
    drag(picture, transfer, lambda document: None, FLOOR + "curves/theta_h")
    assert relative_rmse(picture.image(), before) < 1e-6


def test_edits_during_the_computation_of_an_operator_are_applied(transfer, small):
    picture = open_exact_picture(transfer, cache=small)
    picture.prepare(FLOOR + "curves/theta_h")
    job = picture.next_job()
    look = bent([[0, 3.0], [20, 0.5], [90, 0]])
    picture.set_look(make_look(transfer, look), active_pointer=FLOOR + "curves/theta_h")
    job.apply(job.run(lambda fraction: None, lambda: False))
    assert picture.advance(None).fidelity == "incremental"
    assert relative_rmse(run_until_exact(picture).image(), shown_exactly(transfer, look)) < 1e-6


@pytest.mark.slow
def test_two_curves_one_after_another(transfer, small):
    """The second has memory and another material; then both change at once, as in an undo."""
    picture = open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=small)
    before = picture.image()
    first, second = rough(0.3), bent([[0, 5.0], [9, 0.5], [90, 0]], "Wall")

    def both(document):
        first(document)
        second(document)

    drag(picture, transfer, first, FLOOR + "curves/theta_h")
    picture.prepare(WALL + "curves/theta_h")
    run_until_exact(picture)
    drag(picture, transfer, both, WALL + "curves/theta_h")
    assert relative_rmse(run_until_exact(picture).image(), shown_exactly(transfer, both)) < 1e-6
    picture.set_look(make_look(transfer))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)
    assert small.used_bytes <= small.budget_bytes


@pytest.mark.slow
def test_a_second_curve_of_a_term_waits_for_the_first(transfer, small):
    """For an edit that switches curves before it stops: the operator of neither curve includes the other."""
    picture = open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=small)
    drag(picture, transfer, bent([[0, 3.0], [20, 0.5], [90, 0]]), FLOOR + "curves/theta_h", 3)

    def both(document):
        bent([[0, 3.0], [20, 0.5], [90, 0]])(document)
        document["materials"]["Floor"]["terms"][1]["curves"]["theta_d"] = {"points": [[0, 0.3], [90, 1]]}

    picture.set_look(make_look(transfer, both), active_pointer=FLOOR + "curves/theta_d")
    for _ in range(3):
        picture.advance(5)
    assert relative_rmse(run_until_exact(picture).image(), shown_exactly(transfer, both)) < 1e-6


def test_subsampled_operators_include_indirect_light(gathered, monkeypatch):
    monkeypatch.setattr(operator_budget, "_MIN_SAMPLES", 64)
    memory = Cache(operator_bytes(num_samples(gathered, "Floor"), 256, bits=16) - 200_000)
    picture = run_until_exact(Picture(gathered, "front", memory))
    before = picture.image()
    picture.prepare(FLOOR + "curves/theta_h")
    job = picture.next_job()
    assert task_of(job).form.step > 1
    task = task_of(job)
    change, images = 1e-2 * np.ones((3, 256)), np.zeros((2, *task.target.live.ready.image.shape), np.float32)
    for form, image in zip((task.form, operator_budget.EXACT), images, strict=True):
        some = replace(task, form=form, key=form, target=task.target._replace(images=with_budget(picture._images)))
        some.run(lambda fraction: None, lambda: False).add(analysis(change), image)
    assert relative_rmse(images[0], images[1]) < 0.05
    look = bent([[0, 9.0], [25, 1.5], [90, 0]])
    job.apply(job.run(lambda fraction: None, lambda: False))
    picture.set_look(make_look(gathered, look), active_pointer=FLOOR + "curves/theta_h")
    assert relative_rmse(run_until_exact(picture).image(), shown_exactly(gathered, look)) < 1e-6
    picture.set_look(make_look(gathered))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def with_budget(images):
    """Copy the images with another budget."""
    copied = copy.copy(images)
    copied.cache = Cache(1 << 28)
    return copied
