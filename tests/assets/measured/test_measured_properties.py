"""Measured terms are held to the properties of every term; MERL files and exports survive their round trips."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from for_all import for_all
from hypothesis import strategies as st
from merl_files import make_planes
from term_documents import SEEDS, params, terms
from term_properties import (
    NOT_RECIPROCAL,
    assert_conserves_energy,
    assert_finite_and_not_negative,
    assert_reciprocal,
)

from relume.assets.measured.interpolate import build_table, evaluate_measured
from relume.assets.measured.measured_store import STORE
from relume.assets.measured.merl import SHAPE, grid_directions, is_measured, read_merl, write_merl
from relume.brdf.evaluate import eval_brdf
from relume.brdf.merl_export import sample_terms
from relume.brdf.registry import TERMS
from relume.brdf.symmetry import is_isotropic
from relume.core.errors import MaterialError

ISOTROPIC = sorted(model for model in ANALYTIC if model != "lafortune" and is_isotropic({"model": model}))
MODELS = sorted(term.model for term in TERMS.values() if term.data is STORE)


@pytest.mark.parametrize("model", sorted(set(MODELS) - set(NOT_RECIPROCAL)))
@for_all(3, seed=SEEDS)
def test_measured_terms_are_reciprocal(model, data, seed):
    assert_reciprocal({"model": model, "data": data}, seed)


@pytest.mark.parametrize("model", MODELS)
@for_all(5, random=st.data(), seed=SEEDS)
def test_measured_terms_are_finite_and_not_negative(model, data, random, seed):
    assert_finite_and_not_negative(random.draw(terms(model, data=data)), seed)


@pytest.mark.parametrize("model", MODELS)
@for_all(3, cos_theta_o=st.floats(0.02, 1.0), phi_o=st.floats(0.0, 6.28))
def test_measured_terms_conserve_energy(model, data, cos_theta_o, phi_o):
    assert_conserves_energy({"model": model, "data": data}, cos_theta_o, phi_o)


@for_all(2, seed=SEEDS)
def test_any_planes_are_read_as_written(seed, tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "random.binary"
    planes = np.random.default_rng(seed).uniform(-1, 1000, (3, *SHAPE))
    write_merl(path, planes)
    np.testing.assert_array_equal(read_merl(path), planes)


@for_all(2, random=st.data())
def test_an_exported_term_is_itself_at_the_nodes_of_the_grid(random):
    model = random.draw(st.sampled_from(ISOTROPIC))
    document = {"model": model, "params": random.draw(params(model)), "color": [0.2, 0.5, 0.9]}
    try:
        planes = sample_terms([document])
    except MaterialError:  # the peak of a sharp highlight may exceed what the format allows
        return
    np.testing.assert_allclose(planes, make_planes([document]), rtol=1e-12, atol=1e-12)
    wi, wo = grid_directions()
    nodes = np.flatnonzero(is_measured(planes).ravel())[::977]
    wi, wo = wi.reshape(-1, 3)[nodes], wo.reshape(-1, 3)[nodes]
    expected = eval_brdf(document, wi, wo)
    # between nodes that float64 angles miss by 1e-12 the table is interpolated: of a sharp lobe this is 1e-6 of it
    np.testing.assert_allclose(
        evaluate_measured(build_table(planes), wi, wo), expected, rtol=1e-5, atol=1e-5 * expected.max()
    )
