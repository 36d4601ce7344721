"""Incremental pictures against full evaluation: long sessions, small budgets, the paper's own examples."""

from __future__ import annotations

import copy

import identity_basis
import numpy as np
import numpy_reference as ref
import pytest
from session_edits import BUDGET, apply_random_edit, kind_of, make_look, relative_rmse, run_until_exact

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.strategies.operator import advance
from relume.look import BAKED_ENVIRONMENT, LightPaths, validate
from relume.math.daubechies import analysis, synthesis
from relume.operators.edit_basis import CurveBasis, precompute
from relume.operators.linear_operator import LinearOperator

BALL = "/materials/Ball/terms/1/curves/"


@pytest.mark.parametrize(
    ("seed", "budget_bytes", "num_steps"),
    [
        pytest.param(3, BUDGET, 15, id="short"),
        pytest.param(1, BUDGET, 250, id="roomy", marks=pytest.mark.slow),
        pytest.param(2, 9_000_000, 250, id="tight", marks=pytest.mark.slow),
    ],
)
def test_a_long_session_of_random_edits_equals_a_full_evaluation(transfer, seed, budget_bytes, num_steps):
    rng, cache = np.random.default_rng(seed), Cache(budget_bytes)
    picture = run_until_exact(Picture(transfer, "front", cache))
    document, checked, inexact = copy.deepcopy(transfer.default_look), 0, 0
    for step in range(num_steps):
        for _ in range(int(rng.integers(1, 3))):
            document = copy.deepcopy(document)
            apply_random_edit(rng, document)
        look = validate(document, transfer.default_look)
        picture.set_look(look)
        for _ in range(int(rng.integers(0, 4))):
            if picture.next_job() is not None:
                picture.run_next_job(lambda fraction: None, lambda: False)
            advance = picture.advance(int(rng.integers(1, 30)) if rng.random() < 0.8 else None)
        advance = picture.advance(int(rng.integers(1, 30)))
        inexact += not advance.exact
        if advance.exact and step % 2 == 0:
            assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-4, step
            checked += 1
        assert cache.used_bytes <= cache.budget_bytes
    run_until_exact(picture)
    assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-4
    assert checked > num_steps // 10
    assert inexact > num_steps // 25


SLOW = [pytest.param(number, marks=pytest.mark.slow) for number in (1, 20)]


@pytest.mark.parametrize("max_coefficients", [3, *SLOW])
def test_five_hundred_drags_of_one_curve_leave_no_trace(transfer, max_coefficients):
    rng = np.random.default_rng(3)
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.prepare(BALL + "theta_h")
    run_until_exact(picture)
    for _ in range(500):
        sigma = float(rng.uniform(0.05, 0.6))
        picture.set_look(make_look(transfer, lambda d, s=sigma: set_param(d, s)))
        picture.advance(max_coefficients)
    assert picture.next_job() is None or kind_of(picture.next_job()) == "resum"
    look = make_look(transfer, lambda d: set_param(d, 0.11))
    picture.set_look(look)
    steps = 1
    while not picture.advance(max_coefficients).exact:
        steps += 1
        assert steps <= np.ceil(256 / max_coefficients)
    assert relative_rmse(picture.image(), ref.full_evaluation(transfer, "front", look)) < 1e-5


def set_param(document, sigma):
    document["materials"]["Ball"]["terms"][1]["params"] = {"sigma": sigma, "ior": 1.8, "extinction": 0.0}


def test_refinement_decreases_the_error(transfer):
    """Every step adds the columns with the largest change of the picture; the remaining difference vanishes."""
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.prepare(BALL + "theta_h")
    run_until_exact(picture)
    look = make_look(transfer, lambda d: set_param(d, 0.07))
    expected = ref.full_evaluation(transfer, "front", look)
    picture.set_look(look)
    errors, exact = [], False
    while not exact:
        exact = picture.advance(8).exact
        errors.append(relative_rmse(picture.image(), expected))
    assert 5 < len(errors) <= 256 / 8
    assert errors[-1] < 1e-6
    assert errors[len(errors) // 4] > 1e-6
    assert errors[len(errors) // 2] < 0.1 * errors[0]
    assert not picture.advance(8).changed


def one_pixel(transport):
    """The operator of a single sample whose transport for a curve of 64 bands begins with these numbers."""
    columns = np.zeros((1, 3, 64, 16), np.float32)
    columns[0, :, : len(transport), 0] = transport
    return LinearOperator(columns, np.sqrt((columns**2).sum(axis=(0, 3))).astype(float))


def target_of(*bands):
    """A drawn curve of a diffuse term. (3, 64)"""
    return {"theta_i": np.tile([float(v) for v in bands] + [0.0] * (64 - len(bands)), (3, 1))}


def start(frozen):
    """One black pixel, under an operator of its whole curve."""
    light = Illumination(BAKED_ENVIRONMENT, (), LightPaths(True, 1, 0))
    empty = DisplayedImage(np.zeros((1, 3, frozen.transport.shape[3]), np.float32))
    return empty.evaluate_operator(frozen, CurveBasis("theta_i", "θi", 64), target_of(0), light)


def test_the_largest_changes_of_the_picture_come_first(monkeypatch):
    """A small change of a coefficient with much transport comes before a large one without."""
    monkeypatch.setattr("relume.operators.edit_basis.analysis", identity_basis.analysis)
    frozen = one_pixel([0.01, 100, 2])
    shown, target, order = start(frozen), target_of(50, 1, 10), []
    while shown.changed_curves(target):
        shown = advance(shown, target, frozen, 1)
        order.append(float(shown.image[0, 0, 0]))
    assert order == pytest.approx([100, 120, 120.5])


def test_didactic_example_of_table_2(monkeypatch):
    """One pixel, T = (3, 5, 2), one multiplication per frame; the bands are the basis, as in the paper."""
    monkeypatch.setattr("relume.operators.edit_basis.analysis", identity_basis.analysis)
    frozen = one_pixel([3, 5, 2])

    shown = start(frozen)
    assert not shown.image.any()
    session = [  # c_perfect, R_perfect, c_diff, R_effective, c_effective
        ((4, 2, 1), 24, (4, 2, 1), 12, (4, 0, 0)),  # a curve with geometric decay is loaded
        ((4, 5, 1), 39, (0, 5, 1), 37, (4, 5, 0)),  # its center is amplified
        ((4, 4, 0), 32, (0, -1, 0), 32, (4, 4, 0)),  # all but the left part decreases by one
    ]
    non_linear, incremental = [], []
    for perfect, r_perfect, difference, r_effective, effective in session:
        target = target_of(*perfect)
        np.testing.assert_array_equal(np.dot([3, 5, 2], perfect), r_perfect)
        np.testing.assert_array_equal(target["theta_i"][0, :3] - shown.coefficients[0, :3], difference)
        shown = advance(shown, target, frozen, 1)
        np.testing.assert_allclose(shown.image[0, :, 0], r_effective)
        np.testing.assert_allclose(shown.coefficients[:, :3], [effective] * 3)
        assert (not shown.changed_curves(target)) == (effective == perfect)
        largest = int(np.argmax(perfect))
        non_linear.append(abs(r_perfect - [3, 5, 2][largest] * perfect[largest]))
        incremental.append(abs(r_perfect - r_effective))
    assert incremental == [12, 2, 0]
    assert non_linear == [12, 14, 20]  # the largest coefficient alone, frame by frame


@pytest.mark.parametrize(("common", "is_exact"), [(0, True), (10_000, False)])
def test_images_track_the_rounding_of_float32_sums(common, is_exact):
    """A common offset of all columns cancels: if it is large, mostly rounding remains."""
    rng = np.random.default_rng(8)
    columns = (rng.normal(size=(1, 3, 64, 1024)) + common * rng.normal(size=1024)).astype(np.float32)
    coefficients = rng.integers(-100, 100, 64).astype(float)  # exact in float32
    coefficients[-1] -= coefficients.sum()
    frozen = LinearOperator(columns, np.sqrt((columns.astype(float) ** 2).sum(axis=(0, 3))))
    empty = start(frozen)
    shown = advance(empty, {"theta_i": synthesis(np.tile(coefficients, (3, 1)))}, frozen, None)
    true = np.einsum("j,tcjs->tcs", coefficients, columns, dtype=float)
    left = np.linalg.norm(shown.image - true)
    assert 0.5 * left < shown.rounding < 20 * left
    assert (shown.fidelity == Fidelity.EXACT) == is_exact


def test_local_edit_of_a_peaked_curve_is_exact_where_non_linear_approximation_is_not(transfer):
    """Figure 5: 20 of 256 wavelet terms. The constant peak costs nothing; in non-linear approximation it takes most."""
    wave = 3 + 2 * np.sin(np.linspace(0, 25, 156))

    def drawn(rise):
        bands = curve_bands(
            {"model": "cook_torrance", "params": {"sigma": 0.05}}, TERMS["cook_torrance"].curve("theta_h")
        )[0]
        bands = bands.copy()
        bands[100:] += wave
        bands[131:133] += rise  # 19 coefficients
        return bands

    def with_rise(rise):
        def change(document):
            document["materials"]["Ball"]["terms"][1]["curves"] = {"theta_h": {"bands": drawn(rise).tolist()}}

        return make_look(transfer, change)

    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(with_rise(0.0))
    picture.prepare(BALL + "theta_h")
    run_until_exact(picture)
    before = picture.image()
    picture.set_look(with_rise(6.0))
    assert picture.next_job() is None
    assert picture.advance(20).exact
    expected = ref.full_evaluation(transfer, "front", with_rise(6.0))
    assert relative_rmse(picture.image(), expected) < 1e-6
    assert relative_rmse(before, expected) > 1e-3  # the edit is visible

    view, term = transfer.views["front"], TERMS["cook_torrance"]
    document = with_rise(6.0).materials["Ball"].terms[1]
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves}
    basis = CurveBasis.from_curve(term.curve("theta_h"))
    operator = precompute(basis, term, bands, transfer.lights, view.receivers(2), lambda s: None, lambda: False)
    perfect = analysis(drawn(6.0))
    largest = np.where(np.abs(perfect) >= np.sort(np.abs(perfect))[-20], perfect, 0)
    exact, approximate = (ref.stream(operator.transport, np.tile(c, (3, 1)), 0) for c in (perfect, largest))
    assert relative_rmse(approximate, exact) > 0.02
