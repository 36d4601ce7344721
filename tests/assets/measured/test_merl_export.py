"""Export of an edited material, imported again."""

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
    exported = sample_terms([{"model": model, "data": data} for model in ("measured_lv", "measured_hd")])
    np.testing.assert_array_equal(is_measured(exported), is_measured(planes))
    was_measured = is_measured(planes)
    # the table keeps float32
    np.testing.assert_allclose(exported[:, was_measured], planes[:, was_measured], rtol=2e-7, atol=1e-6)


def test_an_edited_material_survives_export_and_import(library, edited, tmp_path):
    write_merl(tmp_path / "edited.binary", sample_terms(edited))
    again = store_material(library, tmp_path / "edited.binary", "Edited")
    try:
        wi, wo = grid_directions()
        was_measured = is_measured(read_merl(tmp_path / "edited.binary"))
        wi, wo = wi[was_measured][::7], wo[was_measured][::7]
        value = sum(eval_brdf(term, wi, wo) for term in again.terms())
        np.testing.assert_allclose(value, sum(eval_brdf(t, wi, wo) for t in edited), rtol=1e-6, atol=1e-8)
    finally:
        STORE.remove(library, again.id)


def test_an_interpolated_export_is_near_the_edited_material(edited):
    rng = np.random.default_rng(1)
    wi, wo = directions(rng, 5000, 0.3), directions(rng, 5000, 0.3)
    expected = sum(eval_brdf(term, wi, wo) for term in edited)
    actual = evaluate_measured(build_table(sample_terms(edited)), wi, wo)
    # linear between nodes up to 2° apart, of curves that step from band to band
    assert np.sqrt(np.mean((actual - expected) ** 2)) < 0.01 * np.sqrt(np.mean(expected**2))


def test_analytic_terms_are_exported():
    np.testing.assert_allclose(sample_terms(PLASTIC), make_planes(PLASTIC), rtol=1e-12)


def test_materials_that_merl_cannot_represent_are_rejected():
    with pytest.raises(MaterialError, match="anisotropic"):
        sample_terms([{"model": "ashikhmin_shirley", "params": {"nu": 10, "nv": 400, "f0": 0.5}}])
    with pytest.raises(MaterialError, match="exceeds"):
        sample_terms([{"model": "lambert", "color": [1e8, 0, 0]}])
