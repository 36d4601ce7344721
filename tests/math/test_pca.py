"""Principal components of the curves along a slider."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from relume.brdf.curves import generated_bands
from relume.brdf.parameter_sweep import curve_at_value, curves_of_parameter, slider_values
from relume.brdf.registry import TERMS
from relume.math.pca import decompose, joint, relative_rms, worst_relative_rms

BLINN_PHONG = TERMS["blinn_phong"]
EXPONENT = replace(BLINN_PHONG.parameter("exponent"), minimum=3.0, maximum=300.0, scale="linear")


def lobes(values):
    (curve,) = curves_of_parameter(BLINN_PHONG, "exponent")
    return np.array([curve_at_value(BLINN_PHONG, curve, {"exponent": value}) for value in values])


def test_vectors_are_orthonormal_and_reconstruct_the_curves():
    curves = lobes(slider_values(EXPONENT, 40))
    components = decompose(curves)
    # forty curves minus their mean span at most 39 dimensions; the last vector is arbitrary
    gram = components.vectors @ components.vectors.T
    np.testing.assert_allclose(gram, np.eye(40), atol=1e-12)
    np.testing.assert_allclose(components.mean, curves.mean(axis=0))
    reconstructed = components.synthesis(components.analysis(curves))
    np.testing.assert_allclose(reconstructed, curves, atol=1e-12 * curves.max())


def test_no_other_vectors_of_that_number_are_better():
    curves = lobes(slider_values(EXPONENT, 60))
    best = decompose(curves).first(4)
    error = relative_rms(best.synthesis(best.analysis(curves)), curves)
    rng = np.random.default_rng(1)
    for _ in range(20):
        rotated, _ = np.linalg.qr(best.vectors.T + 0.02 * rng.normal(size=best.vectors.T.shape))
        other = replace(best, vectors=rotated.T)
        assert relative_rms(other.synthesis(other.analysis(curves)), curves) > error


def test_figure_5_of_nguyen_2010():
    """Blinn-Phong on [3, 300], exponents evenly spaced; RMS over bands and exponents, relative to the curves."""
    components = decompose(lobes(slider_values(EXPONENT, 298)))
    exact = lobes(slider_values(EXPONENT, 297, at_midpoints=True))
    errors = {}
    for k in range(1, 13):
        few = components.first(k)
        errors[k] = relative_rms(few.synthesis(few.analysis(exact)), exact)
    assert all(b < a for a, b in itertools.pairwise(errors.values()))
    assert errors[6] == pytest.approx(4.1e-4, rel=0.1)
    assert errors[10] == pytest.approx(1.3e-5, rel=0.1)


def test_slider_runs_through_its_range():
    exponent = BLINN_PHONG.parameter("exponent")
    values = slider_values(exponent, 5)
    assert values[[0, -1]] == pytest.approx([exponent.minimum, exponent.maximum])
    np.testing.assert_allclose(values[1:] / values[:-1], values[1] / values[0])
    between = slider_values(exponent, 4, at_midpoints=True)
    np.testing.assert_allclose(between, np.sqrt(values[1:] * values[:-1]))
    np.testing.assert_allclose(slider_values(EXPONENT, 3), [3, 151.5, 300])
    np.testing.assert_allclose(slider_values(EXPONENT, 2, at_midpoints=True), [77.25, 225.75])


def test_bands_along_a_slider_equal_those_of_a_look():
    for term in TERMS.values():
        for parameter in term.parameters:
            for curve in curves_of_parameter(term, parameter.name):
                for value in slider_values(parameter, 3):
                    look = {"model": term.model, "params": {parameter.name: float(value)}}
                    np.testing.assert_allclose(
                        curve_at_value(term, curve, {parameter.name: value}),
                        generated_bands(look, curve)[0],
                        rtol=1e-12,
                    )


def test_product_of_curves_has_every_pair():
    left, right = np.array([1.0, 2, 3]), np.array([5.0, 7])
    assert joint([left, right]).tolist() == [5, 7, 10, 14, 15, 21]
    assert joint([left]).tolist() == [1, 2, 3]
    assert [curve.name for curve in curves_of_parameter(TERMS["ggx"], "roughness")] == ["theta_h", "theta_i"]


def test_norms():
    exact = np.array([[3.0, 4.0], [30.0, 40.0], [0.0, 0.0]])
    approximation = exact + np.array([[0.0, 0.5], [0.0, 0.5], [0.0, 0.0]])
    assert worst_relative_rms(approximation, exact) == pytest.approx(0.1)
    assert relative_rms(approximation, exact) == pytest.approx(np.sqrt(0.5 / 2525))
