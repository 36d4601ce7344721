"""Properties of the curves of every registered term: projection onto bands and back, parameters, freehand edits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from for_all import for_all
from hypothesis import strategies as st
from term_documents import handles, params, points, terms

from relume.brdf.curve_edits import curve_edit
from relume.brdf.curves import curve_bands, curve_values, generated_bands
from relume.brdf.parameter_sweep import curve_at_value
from relume.brdf.registry import TERMS
from relume.math.angle_bands import band_edges

MODELS = sorted(ANALYTIC)


def range_in_bands(document, curve):
    """Least and greatest value of the displayed curve in each band. (3, J) each"""
    edges, drawn = band_edges(curve.num_bands), (document.get("curves") or {}).get(curve.name, [])
    objects = drawn if isinstance(drawn, list) else [drawn]
    # splines are monotone between their points; the first band has the narrowest peaks
    corners = [np.radians(x) for item in objects for x, *_ in item.get("points", [])]
    inner = [np.geomspace(1e-6, edges[1], 40), np.pi / 2 - np.geomspace(1e-6, edges[1], 40)]
    gamma = np.unique(np.concatenate([np.linspace(0, np.pi / 2, 16 * curve.num_bands + 1), corners, *inner]))
    values = curve_values(document, curve, gamma)
    bands = [slice(*np.searchsorted(gamma, [low - 1e-12, high + 1e-12])) for low, high in itertools.pairwise(edges)]
    return tuple(np.stack([pick(values[:, inside], axis=1) for inside in bands], axis=1) for pick in (np.min, np.max))


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_band_averages_lie_between_the_values_of_their_band(model, data):
    """So a curve and its projection onto bands differ by no more than the curve varies within a band."""
    for curve in TERMS[model].curves:
        document = {"model": model, "params": data.draw(params(model))}
        if data.draw(st.booleans()):
            document["curves"] = {curve.name: {"points": data.draw(points)}}
        bands, (low, high) = curve_bands(document, curve), range_in_bands(document, curve)
        tolerance = 1e-6 * high + 1e-9 * high.max()
        assert (bands >= low - tolerance).all()
        assert (bands <= high + tolerance).all()


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_projection_onto_bands_is_idempotent(model, data):
    """A curve drawn as its own bands has these bands, and their values at exact angles."""
    document = data.draw(terms(model))
    for curve in TERMS[model].curves:
        bands = curve_bands(document, curve)
        again = {**document, "curves": {curve.name: {"bands": bands.tolist()}}}
        np.testing.assert_array_equal(curve_bands(again, curve), bands)
        centers = (np.arange(curve.num_bands) + 0.5) * (np.pi / 2 / curve.num_bands)
        np.testing.assert_array_equal(curve_values(again, curve, centers), bands)


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_each_channel_of_a_curve_is_that_of_its_parameters(model, data):
    document = {"model": model, "params": data.draw(params(model))}
    term = TERMS[model]
    for curve in term.curves:
        bands = generated_bands(document, curve)
        for channel in range(3):
            values = {
                name: value[channel] if isinstance(value, list) else value for name, value in document["params"].items()
            }
            np.testing.assert_array_equal(bands[channel], curve_at_value(term, curve, values))
            np.testing.assert_array_equal(bands[channel], generated_bands({"model": model, "params": values}, curve)[0])


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_freehand_edits_are_finite_and_leave_other_channels(model, data):
    document = data.draw(terms(model))
    plain = {**document, "curves": {}}
    for curve in TERMS[model].curves:
        gamma = np.linspace(0, np.pi / 2, 300)
        bands, values = curve_bands(document, curve), curve_values(document, curve, gamma)
        for result in (bands, values):
            assert np.isfinite(result).all()
            assert (result >= 0).all()
        drawn = document["curves"].get(curve.name, [])
        edited = "".join(item.get("channels", "rgb") for item in (drawn if isinstance(drawn, list) else [drawn]))
        untouched = [channel for channel, name in enumerate("rgb") if name not in edited]
        np.testing.assert_array_equal(bands[untouched], curve_bands(plain, curve)[untouched])
        np.testing.assert_array_equal(values[untouched], curve_values(plain, curve, gamma)[untouched])


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_relative_edits_are_neutral_without_a_change_and_bounded_by_it(model, data):
    """Handles that stay change no bit; no band moves farther than the handle that moves farthest."""
    document = {"model": model, "params": data.draw(params(model))}
    for curve in TERMS[model].curves:
        before = curve_bands(document, curve)
        moves = data.draw(handles)
        still = [[x, was, was] for x, was, _ in moves]
        neutral = {"handles": still, "factors": [1.0] * curve.num_bands, "offsets": [0.0] * curve.num_bands}
        np.testing.assert_array_equal(curve_bands({**document, "curves": {curve.name: neutral}}, curve), before)
        factor, offset = curve_edit({"handles": moves}, before)
        farthest = max(abs(becomes - was) for _, was, becomes in moves)
        assert (factor >= -1e-12).all()
        assert (np.abs(factor * before + offset - before) <= farthest * (1 + 1e-9) + 1e-9 * before).all()


@pytest.mark.parametrize("model", MODELS)
@for_all(5, data=st.data())
def test_an_edit_and_the_opposite_edit_return_the_curve(model, data):
    """Factors and offsets are undone by their inverses, which is how the editor goes back."""
    document = {"model": model, "params": data.draw(params(model))}
    for curve in TERMS[model].curves:
        before = curve_bands(document, curve)
        factors = np.repeat(data.draw(st.lists(st.floats(0.1, 10), min_size=4, max_size=4)), curve.num_bands // 4)
        there = {**document, "curves": {curve.name: {"factors": factors.tolist()}}}
        back = {"bands": curve_bands(there, curve).tolist(), "factors": (1 / factors).tolist()}
        np.testing.assert_allclose(
            curve_bands({**document, "curves": {curve.name: back}}, curve), before, rtol=1e-14, atol=1e-300
        )
