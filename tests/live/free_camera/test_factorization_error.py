"""Reported in-out factorization error of a term."""

import numpy as np
import pytest
from hemisphere_quadrature import hemisphere
from test_outgoing_coefficients import document

from relume.brdf.evaluate import eval_brdf
from relume.live.free_camera.basis.factorization_error import BOUND, factorization_error
from relume.live.free_camera.basis.outgoing_coefficients import cosines, outgoing_coefficients
from relume.math.zernike import NUM_FUNCTIONS, basis_functions, num_functions


def test_one_function_is_enough_for_a_diffuse_surface():
    error = factorization_error(document("lambert"))
    assert (error.functions, error.required_functions, error.is_mirror) == (NUM_FUNCTIONS, 1, False)
    assert error.residual < 1e-3


def test_sharper_highlights_need_more_functions_up_to_mirrors():
    errors = [factorization_error(document("phong", params={"exponent": e})) for e in (4.0, 8.0, 10.0, 300.0)]
    needed = [error.required_functions or 1000 for error in errors]
    assert needed == sorted(needed)
    assert len(set(needed)) > 2
    assert [error.is_mirror for error in errors] == [False, False, False, True]
    assert errors[-1].required_functions is None
    missed = [error.residual for error in errors]
    assert missed == sorted(missed)


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
    assert factorization_error(term).required_functions in (
        None,
        *(num_functions(n) for n, fraction in enumerate(missed) if fraction <= BOUND),
    )
