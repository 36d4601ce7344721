"""Reported in-out factorization error of a term."""

import numpy as np
import pytest
from hemisphere_quadrature import hemisphere
from test_outgoing_coefficients import document

from relume.brdf.evaluate import eval_brdf
from relume.live.free_camera.basis.outgoing_coefficients import cosines, outgoing_coefficients, white_coefficients
from relume.live.free_camera.factorization_error import BOUND, factorization_errors
from relume.math.zernike import DEGREE, NUM_FUNCTIONS, basis_functions, num_functions


def error_of(term, basis_functions=None):
    return factorization_errors([term], basis_functions)[0]


def test_one_function_is_enough_for_a_diffuse_surface():
    error = error_of(document("lambert"))
    assert error[:2] == (1, NUM_FUNCTIONS)
    assert (error.required_functions, error.drawn_by) == (1, "functions")
    assert error.residual < 1e-3


def test_sharper_highlights_need_more_functions_up_to_mirrors():
    errors = [error_of(document("phong", params={"exponent": e})) for e in (4.0, 8.0, 10.0, 300.0)]
    needed = [error.required_functions or 1000 for error in errors]
    assert needed == sorted(needed)
    assert len(set(needed)) > 2
    assert [error.drawn_by for error in errors] == ["functions"] * 3 + ["lights"]
    assert errors[-1].required_functions is None
    missed = [error.residual for error in errors]
    assert missed == sorted(missed)


def test_narrow_lobes_are_traced_and_other_terms_of_the_material_are_as_ever():
    rough, sharp = document("ggx", params={"roughness": 0.4}), document("ggx", params={"roughness": 0.1})
    assert [error.drawn_by for error in factorization_errors([document("lambert"), rough, sharp])] == [
        "functions",
        "lights",
        "rays",
    ]


@pytest.mark.parametrize("degree", range(DEGREE + 1))
def test_a_chosen_number_of_functions_has_the_residual_of_its_degree(degree):
    term = document("phong", params={"exponent": 30.0})
    error = error_of(term, num_functions(degree))
    assert (error.functions, error.drawn_by) == (num_functions(degree), "functions")
    assert error.residual == white_coefficients(term).residual_by_degree[degree]


@pytest.mark.parametrize("exponent", [3.0, 15.0])
def test_the_error_is_the_residual_of_a_projection(exponent):
    term = document("blinn_phong", params={"exponent": exponent})
    wi, weight = hemisphere(64, 128)
    functions, cosine = basis_functions(wi), cosines()
    missed = outgoing_coefficients(term).residual_by_degree
    for degree in (0, 3, 7):
        basis, left = functions[:, : num_functions(degree)], []
        for z in cosine:
            value = eval_brdf(term, wi, np.array([np.sqrt(1 - z * z), 0, z]))[:, 0]
            fitted = basis @ np.linalg.lstsq(basis * np.sqrt(weight)[:, None], value * np.sqrt(weight), rcond=None)[0]
            left.append(np.sqrt((weight * (value - fitted) ** 2).sum() / (weight * value**2).sum()))
        assert missed[degree] == pytest.approx(np.average(left, weights=cosine), abs=0.01)
    assert error_of(term).required_functions in (
        None,
        *(num_functions(n) for n, fraction in enumerate(missed) if fraction <= BOUND),
    )
