"""Properties of every registered term, with random parameters over the whole range of its sliders."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from brdf_closed_forms import CLOSED_FORMS
from for_all import for_all
from hypothesis import strategies as st
from term_documents import SEEDS, params, terms
from term_properties import (
    ENERGY_BOUNDS,
    NOT_RECIPROCAL,
    assert_conserves_energy,
    assert_finite_and_not_negative,
    assert_reciprocal,
    directional_albedo,
    directions,
)

from relume.assets.btf import btf_store
from relume.assets.measured import measured_store
from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS

MODELS = sorted(ANALYTIC)


def test_every_term_is_held_to_the_properties():
    """Terms with data are tested where their data is made: tests/assets/measured and tests/assets/btf."""
    stores = measured_store.STORE, btf_store.STORE
    assert all(term.data is None or term.data in stores for term in TERMS.values())
    assert {*NOT_RECIPROCAL, *ENERGY_BOUNDS} <= set(TERMS)


@pytest.mark.parametrize("model", sorted(set(MODELS) - set(NOT_RECIPROCAL)))
@for_all(10, data=st.data(), seed=SEEDS)
def test_terms_are_reciprocal(model, data, seed):
    assert_reciprocal({"model": model, "params": data.draw(params(model))}, seed)


@pytest.mark.parametrize("model", MODELS)
@for_all(15, data=st.data(), seed=SEEDS)
def test_terms_are_finite_and_not_negative(model, data, seed):
    assert_finite_and_not_negative(data.draw(terms(model)), seed)


@pytest.mark.parametrize("model", MODELS)
@for_all(8, data=st.data(), cos_theta_o=st.floats(0.02, 1.0), phi_o=st.floats(0.0, 6.28))
def test_terms_conserve_energy(model, data, cos_theta_o, phi_o):
    assert_conserves_energy({"model": model, "params": data.draw(params(model, one_value=True))}, cos_theta_o, phi_o)


@pytest.mark.parametrize("model", sorted(CLOSED_FORMS))
@for_all(10, data=st.data(), seed=SEEDS)
def test_quotient_times_curves_is_the_closed_form_of_the_paper(model, data, seed):
    rng = np.random.default_rng(seed)
    wi, wo = directions(rng, 300), directions(rng, 300)
    drawn = data.draw(params(model, one_value=True))
    given = {name: round(value, 4) for name, value in drawn.items()}  # Fresnel terms cancel below the steps of sliders
    expected = CLOSED_FORMS[model](wi, wo, **given)
    value = eval_brdf({"model": model, "params": given, "color": [1.0, 0.5, 0.0]}, wi, wo)
    scale = (
        expected.max() * 1e-12 + 1e-25
    )  # in the tail of a lobe, or without a boundary, only the absolute error counts
    np.testing.assert_allclose(value[:, 0], expected, rtol=1e-7, atol=scale)
    np.testing.assert_allclose(value[:, 1], 0.5 * expected, rtol=1e-7, atol=scale)
    assert not value[:, 2].any()


@pytest.mark.parametrize("exponent", [1.0, 50.0, 1e5])
def test_the_quadrature_of_the_energy_is_exact_for_cosine_lobes(exponent):
    """At normal incidence, ∫ (s + 1)/2π cos^(s + 1) dω."""
    albedo = directional_albedo({"model": "phong", "params": {"exponent": exponent}}, np.array([0.0, 0.0, 1.0]))
    assert albedo == pytest.approx((exponent + 1) / (exponent + 2), rel=5e-4)
