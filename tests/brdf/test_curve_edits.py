"""Edits relative to a curve: untouched bands stay bit-identical, and no band moves farther than the edit."""

from __future__ import annotations

import numpy as np
import pytest

from relume.brdf.curve_edits import curve_edit
from relume.brdf.curves import curve_bands, curve_values, generated_bands
from relume.brdf.registry import TERMS

CASES = [("cook_torrance", {"sigma": 0.01}), ("ggx", {"roughness": 0.05}), ("ggx", {"roughness": 0.245})]
ANGLES = np.array([0.0, 0.879, 3.0, 20.0, 90.0])
# the same numbers are in client_web/tests/curveEdits.test.ts
TWIN = [12, 4.6061477767732395, 7.98575, 8.031796875, 6.723032069970845, 3.425655976676385, 1.1938775510204083, 0]


def document(model, params, drawn, name="theta_h"):
    return {"model": model, "params": params, "curves": {name: drawn}}, TERMS[model].curve(name)


def handles_of(bands, angles=ANGLES):
    """Handles without displacement."""
    centers = (np.arange(len(bands)) + 0.5) * (90 / len(bands))
    values = np.interp(angles, centers, bands)
    return [[float(x), float(v), float(v)] for x, v in zip(angles, values, strict=True)]


@pytest.mark.parametrize(("model", "params"), CASES)
def test_handles_without_displacement_change_no_bit(model, params):
    plain = {"model": model, "params": params}
    for curve in TERMS[model].curves:
        before = generated_bands(plain, curve)
        term, _ = document(model, params, {"handles": handles_of(before[0])}, curve.name)
        np.testing.assert_array_equal(curve_bands(term, curve), before)
        gamma = np.linspace(0, np.pi / 2, 1000)
        np.testing.assert_array_equal(curve_values(term, curve, gamma), curve_values(plain, curve, gamma))


@pytest.mark.parametrize("fraction", [1e-3, -1e-3])
@pytest.mark.parametrize("index", range(5))
@pytest.mark.parametrize(("model", "params"), CASES)
def test_a_small_displacement_stays_local_and_bounded(model, params, index, fraction):
    curve = TERMS[model].curve("theta_h")
    before = generated_bands({"model": model, "params": params}, curve)
    handles = handles_of(before[0])
    handles[index][2] = handles[index][1] * (1 + fraction)
    after = curve_bands(document(model, params, {"handles": handles})[0], curve)
    change = after - before
    assert (np.abs(change) <= abs(fraction) * before * (1 + 1e-9)).all()
    assert np.abs(change).max() <= abs(handles[index][2] - handles[index][1]) * (1 + 1e-9)
    centers = (np.arange(256) + 0.5) * (90 / 256)
    low, high = handles[max(0, index - 1)][0], handles[min(4, index + 1)][0]
    beyond = (centers < low) | (centers > high)
    np.testing.assert_array_equal(after[:, beyond], before[:, beyond])
    at = int(np.argmin(np.abs(centers - handles[index][0])))
    assert change[0, at] == pytest.approx(fraction * before[0, at], rel=0.1)


def test_a_curve_passes_through_its_handles():
    params = {"sigma": 0.1}
    curve = TERMS["cook_torrance"].curve("theta_h")
    before = generated_bands({"model": "cook_torrance", "params": params}, curve)[0]
    centers = (np.arange(256) + 0.5) * (90 / 256)
    angles = centers[[0, 10, 40, 120, 255]]
    for becomes in ([0.0, 50.0, 20.0, 0.0, 3.0], [1e6, 0.0, 1e6, 1e-3, 0.0]):
        handles = [[x, v, y] for (x, v, _), y in zip(handles_of(before, angles), becomes, strict=True)]
        after = curve_bands(document("cook_torrance", params, {"handles": handles})[0], curve)[0]
        np.testing.assert_allclose(after[[0, 10, 40, 120, 255]], becomes, rtol=1e-9, atol=1e-9)
        assert (after >= 0).all()


def test_blended_handles_at_zero_leave_no_negative_band():
    term, curve = document("sheen", {"roughness": 0.07}, {"handles": [[0.0, 1.0, 0.0], [6.48, 1.0, 0.0]]})
    assert (curve_bands(term, curve) >= 0).all()


def test_no_band_moves_farther_than_the_neighboring_handles():
    rng = np.random.default_rng(9)
    curve = TERMS["cook_torrance"].curve("theta_h")
    for sigma in rng.uniform(0.005, 0.5, 40):
        before = generated_bands({"model": "cook_torrance", "params": {"sigma": sigma}}, curve)
        handles = handles_of(before[0], np.sort(rng.uniform(0, 90, 6)))
        for handle in handles:
            handle[2] = float(rng.choice([handle[1], handle[1] * rng.uniform(0, 2), before.max() * rng.uniform(0, 2)]))
        term, _ = document("cook_torrance", {"sigma": float(sigma)}, {"handles": handles})
        after = curve_bands(term, curve)
        moves = np.array([abs(becomes - was) for _, was, becomes in handles])
        assert (after >= 0).all()
        assert (np.abs(after - before) <= moves.max() * (1 + 1e-9) + 1e-12 * before).all()


@pytest.mark.parametrize("name", ["theta_h", "theta_d"])
def test_factors_and_offsets_apply_to_band_averages(name):
    curve = TERMS["ggx"].curve(name)
    plain = {"model": "ggx", "params": {"roughness": 0.05}}
    before = generated_bands(plain, curve)
    rng = np.random.default_rng(3)
    factors, offsets = rng.uniform(0, 2, curve.num_bands), rng.uniform(0, 3, (3, curve.num_bands))
    drawn = {"factors": factors.tolist(), "offsets": offsets.tolist()}
    term, _ = document("ggx", plain["params"], drawn, name)
    np.testing.assert_allclose(curve_bands(term, curve), factors * before + offsets, rtol=1e-14)
    edges = np.linspace(0, np.pi / 2, curve.num_bands + 1)
    gamma = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(4000) + 0.5) / 4000
    values = curve_values(term, curve, gamma.ravel()).reshape(3, curve.num_bands, -1)
    # around a highlight directions have equal weight; their density is proportional to the angle
    averages = np.average(values, axis=2, weights=np.broadcast_to(gamma if name == "theta_h" else 1.0, values.shape))
    np.testing.assert_allclose(averages, curve_bands(term, curve), rtol=2e-3)


def test_an_outgoing_curve_has_no_steps():
    curve = TERMS["ggx"].curve("theta_o")
    plain = {"model": "ggx", "params": {"roughness": 0.4}}
    handles = handles_of(generated_bands(plain, curve)[0], np.array([0.0, 50.0, 90.0]))
    handles[1][2] *= 2
    term, _ = document("ggx", plain["params"], {"handles": handles}, "theta_o")
    gamma = np.linspace(0, np.radians(80), 4000)
    steps = np.diff(curve_values(term, curve, gamma)[0])
    assert np.abs(steps).max() < 3 * np.abs(np.diff(curve_values(plain, curve, gamma)[0])).max()
    assert curve_values(term, curve, np.radians([50.0]))[0, 0] == pytest.approx(handles[1][2], rel=1e-3)


def test_edits_apply_to_current_points_bands_and_parameters():
    edges = np.linspace(0, 90, 257)
    ramp = np.diff(edges**3 / 3) / np.diff(edges**2 / 2)  # mean angle over the directions of each band
    handles = [[0.0, 10.0, 20.0], [90.0, 10.0, 20.0]]
    for ground in ({"points": [[0, 0], [90, 90]]}, {"bands": ramp.tolist()}):
        term, curve = document("cook_torrance", {"sigma": 0.2}, {**ground, "handles": handles})
        low = ramp <= 10  # lower values double, higher ones move by ten
        np.testing.assert_allclose(curve_bands(term, curve)[1], np.where(low, 2 * ramp, ramp + 10), rtol=1e-9)
    halves = {"factors": [0.5] * 256}
    for sigma in (0.1, 0.3):
        term, curve = document("cook_torrance", {"sigma": sigma}, halves)
        plain = {"model": "cook_torrance", "params": {"sigma": sigma}}
        np.testing.assert_array_equal(curve_bands(term, curve), 0.5 * generated_bands(plain, curve))


def test_the_editor_gives_the_same_curves():
    eight = {"factors": [1, 1, 2, 0, 1, 1, 1, 1], "offsets": [0, 0, 0, 3, 0, 0, 0, 0]}
    drawn = {**eight, "handles": [[0, 8, 12], [20, 4, 2], [45, 3, 9], [90, 0, 0]]}
    ground = np.broadcast_to([8.0, 6, 4, 3, 2, 1, 0.5, 0], (3, 8))
    factor, offset = curve_edit(drawn, ground)
    np.testing.assert_allclose((factor * ground + offset)[0], TWIN, rtol=1e-12)
