"""An edited material as a file, imported again."""

import numpy as np
import pytest
from merl_files import PLASTIC, make_planes
from test_measured_interpolation import directions

from relume.assets.measured.interpolate import build_table, evaluate_measured
from relume.assets.measured.measured_store import STORE, store_material
from relume.assets.measured.merl import grid_directions, is_measured, read_merl, write_merl
from relume.brdf.curves import curve_bands
from relume.brdf.evaluate import eval_brdf
from relume.brdf.merl_export import sample_terms
from relume.brdf.registry import TERMS
from relume.core.errors import MaterialError


@pytest.fixture(scope="module")
def edited(data):
    diffuse = {"model": "measured_lv", "data": data, "color": [0.2, 1.0, 1.5]}
    specular = {"model": "measured_hd", "data": data, "color": [1.0, 1.0, 1.0]}
    curve = TERMS["measured_hd"].normalized(specular).curve("theta_h")
    drawn = 2 * curve_bands(specular, curve)
    return [diffuse, {**specular, "curves": {"theta_h": {"bands": drawn.tolist(), "channels": "rg"}}}]


def test_an_unedited_material_is_exported_as_it_was_measured(data, planes):
    found = sample_terms([{"model": model, "data": data} for model in ("measured_lv", "measured_hd")])
    np.testing.assert_array_equal(is_measured(found), is_measured(planes))
    kept = is_measured(planes)
    # the table keeps float32
    np.testing.assert_allclose(found[:, kept], planes[:, kept], rtol=2e-7, atol=1e-6)


def test_an_edited_material_is_the_same_when_it_is_imported_again(shelf, edited, tmp_path):
    write_merl(tmp_path / "edited.binary", sample_terms(edited))
    again = store_material(shelf, tmp_path / "edited.binary", "Edited")
    try:
        wi, wo = grid_directions()
        kept = is_measured(read_merl(tmp_path / "edited.binary"))
        wi, wo = wi[kept][::7], wo[kept][::7]
        value = sum(eval_brdf(term, wi, wo) for term in again.terms())
        np.testing.assert_allclose(value, sum(eval_brdf(t, wi, wo) for t in edited), rtol=1e-6, atol=1e-8)
    finally:
        STORE.remove(shelf, again.id)


def test_between_the_nodes_an_edited_export_is_near_the_edit(edited):
    rng = np.random.default_rng(1)
    wi, wo = directions(rng, 5000, 0.3), directions(rng, 5000, 0.3)
    expected = sum(eval_brdf(term, wi, wo) for term in edited)
    found = evaluate_measured(build_table(sample_terms(edited)), wi, wo)
    # linear between nodes up to 2° apart, of curves that step from band to band
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.01 * np.sqrt(np.mean(expected**2))


def test_analytic_terms_are_exported_too():
    np.testing.assert_allclose(sample_terms(PLASTIC), make_planes(PLASTIC), rtol=1e-12)


def test_what_a_merl_file_cannot_hold_is_refused():
    with pytest.raises(MaterialError, match="anisotropic"):
        sample_terms([{"model": "ashikhmin_shirley", "params": {"nu": 10, "nv": 400, "f0": 0.5}}])
    with pytest.raises(MaterialError, match="above"):
        sample_terms([{"model": "lambert", "color": [1e8, 0, 0]}])
