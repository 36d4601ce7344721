"""The mean BRDF of a BTF is held to the properties of every term."""

from __future__ import annotations

from for_all import for_all
from hypothesis import strategies as st
from term_documents import SEEDS, terms
from term_properties import NOT_RECIPROCAL, assert_conserves_energy, assert_finite_and_not_negative, assert_reciprocal

from relume.assets.btf.btf_store import STORE
from relume.brdf.registry import TERMS

MODELS = sorted(term.model for term in TERMS.values() if term.data is STORE)


@for_all(10, random=st.data(), seed=SEEDS, cos_theta_o=st.floats(0.02, 1.0), phi_o=st.floats(0.0, 6.28))
def test_mean_brdfs_have_the_properties_of_terms(small_btf, random, seed, cos_theta_o, phi_o):
    for model in MODELS:
        document = random.draw(terms(model, data=small_btf.record.data))
        assert_finite_and_not_negative(document, seed)
        assert_conserves_energy({**document, "color": [1.0, 1.0, 1.0]}, cos_theta_o, phi_o)
        if model not in NOT_RECIPROCAL:
            assert_reciprocal(document, seed)
