"""The measured terms: exact without edits, edited by their curves, against the reference."""

import numpy as np
import pytest
from exact_pictures import exact_image
from merl_files import PLASTIC, make_planes
from session_edits import relative_rmse, run_until_exact
from test_measured_interpolation import directions
from tiny_scenes import still_life

from relume.assets.measured.interpolate import evaluate_measured
from relume.assets.measured.measured_store import STORE, store_material
from relume.assets.measured.merl import write_merl
from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import default_look, validate
from relume.methods.direct import DirectMethod
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_server.client_state.pointers import find_curve

LOBES, HOMOMORPHIC = ("measured_lv", "measured_hd"), ("measured_hf",)


def material_of(models, data, **changes):
    """Terms of a look; `changes` by model name."""
    return [{"model": model, "data": data, "color": [1, 1, 1], **changes.get(model, {})} for model in models]


def total(documents, wi, wo):
    return sum(eval_brdf(document, wi, wo) for document in documents)


def measured_curve(document, name):
    return TERMS[document["model"]].normalized(document).curve(name)


@pytest.mark.parametrize("models", [LOBES, HOMOMORPHIC])
def test_unedited_terms_add_up_to_the_measurement(data, table, models):
    rng = np.random.default_rng(1)
    wi, wo = directions(rng, 20_000), directions(rng, 20_000)
    wi[:5] = wo[:5] = np.array([0.0, 0.0, 1.0])
    actual = total(material_of(models, data), wi, wo)
    expected = evaluate_measured(table, wi, wo)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-12 * expected.max())


def test_drawn_bands_equal_to_the_measured_curve_hardly_change_the_term(data, table):
    document = material_of(LOBES, data)[1]
    bands = curve_bands(document, measured_curve(document, "theta_h"))
    drawn = {**document, "curves": {"theta_h": {"bands": bands.tolist()}}}
    rng = np.random.default_rng(2)
    wi, wo = directions(rng, 5000, 0.1), directions(rng, 5000, 0.1)
    assert relative_rmse(eval_brdf(drawn, wi, wo), eval_brdf(document, wi, wo)) < 0.02  # steps of a third of a degree


@pytest.mark.parametrize("name", ["theta_h", "theta_d"])
def test_a_doubled_curve_doubles_its_lobe_and_leaves_the_other(data, name):
    diffuse, specular = material_of(LOBES, data)
    bands = curve_bands(specular, measured_curve(specular, name))
    once = {**specular, "curves": {name: {"bands": bands.tolist()}}}
    twice = {**specular, "curves": {name: {"bands": (2 * bands).tolist()}}}
    rng = np.random.default_rng(3)
    wi, wo = directions(rng, 2000), directions(rng, 2000)
    np.testing.assert_allclose(eval_brdf(twice, wi, wo), 2 * eval_brdf(once, wi, wo), rtol=1e-12)
    lobe = total([diffuse, twice], wi, wo) - total([diffuse, once], wi, wo)
    np.testing.assert_allclose(lobe, eval_brdf(once, wi, wo), rtol=1e-6, atol=1e-9)


def test_incident_and_outgoing_curves_start_equal(data):
    (document,) = material_of(HOMOMORPHIC, data)
    gamma = np.linspace(0, np.pi / 2, 50)
    values = [curve_values(document, measured_curve(document, name), gamma) for name in ("theta_i", "theta_o")]
    np.testing.assert_array_equal(*values)
    assert values[0].shape == (3, 50)


def test_an_edit_of_one_channel_leaves_the_others(data):
    document = material_of(LOBES, data)[0]
    curve = measured_curve(document, "theta_i")
    untouched = curve_bands(document, curve)
    assert not np.allclose(untouched[0], untouched[2], rtol=0.1)
    drawn = {**document, "curves": {"theta_i": {"points": [[0, 1], [90, 1]], "channels": "g"}}}
    edited = curve_bands(drawn, curve)
    np.testing.assert_allclose(edited[1], 1)
    np.testing.assert_array_equal(edited[[0, 2]], untouched[[0, 2]])


def test_an_edit_pointer_resolves_to_the_measured_curve(data):
    document = {"materials": {"Ball": {"terms": material_of(LOBES, data)}}}
    term, curve = find_curve("/materials/Ball/terms/1/curves/theta_h", document)
    bands = curve_bands(term, curve)
    np.testing.assert_array_equal(bands, curve_bands(term, measured_curve(term, "theta_h")))
    assert np.ptp(bands) > 1


@pytest.fixture(scope="module")
def scene():
    return still_life()


@pytest.fixture(scope="module")
def transfer(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    return open_transfer(
        bake_in_process(DirectMethod(), scene, Recipe("direct", ("front",), (48, 36), 4000), folder / "s"),
        Cache(1 << 30),
    )


def look_with(transfer, documents):
    return validate({"materials": {"Ball": {"terms": documents}}}, transfer.default_look)


EDITED = {
    "measured_lv": {"curves": {"theta_o": {"points": [[0, 0.3], [90, 0.8]]}}},
    "measured_hd": {"curves": {"theta_h": {"points": [[0, 20], [15, 4], [40, 0.5], [90, 0]], "channels": "rg"}}},
}


@pytest.mark.parametrize(
    ("models", "changes"),
    [(LOBES, {}), (LOBES, EDITED), (HOMOMORPHIC, {})],
    ids=["lobes", "edited lobes", "homomorphic"],
)
def test_a_frame_equals_the_reference(scene, transfer, data, models, changes):
    look = look_with(transfer, material_of(models, data, **changes))
    frame = render_image(transfer, "front", look)
    reference = reference_image(scene, "front", look, (48, 36), 0)
    assert relative_rmse(frame, reference) < 0.01  # as in test_reflection_integral.py


def test_the_reference_of_the_unedited_material_equals_its_source(scene, data):
    """The sum over texels of the terms that the file was sampled from, except for the interpolation of the grid."""
    default = default_look(scene.materials)
    looks = [
        validate({"materials": {"Ball": {"terms": list(terms)}}}, default)
        for terms in (material_of(LOBES, data), [{**t, "texture": None} for t in PLASTIC])
    ]
    measured, sampled = (reference_image(scene, "front", look, (48, 36), 0) for look in looks)
    assert relative_rmse(measured, sampled) < 0.005


def test_a_live_edit_of_a_measured_curve_ends_at_the_fresh_picture(transfer, data):
    pointer = "/materials/Ball/terms/1/curves/theta_h"
    picture = Picture(transfer, "front", Cache(1 << 30))
    picture.set_look(look_with(transfer, material_of(LOBES, data)))
    before = run_until_exact(picture).image().copy()
    picture.prepare(pointer)
    run_until_exact(picture)
    np.testing.assert_allclose(picture.image(), before, rtol=1e-4, atol=1e-5 * before.max())
    bands, generated = picture.curve(pointer)
    np.testing.assert_array_equal(bands, generated)
    doubled = {"measured_hd": {"curves": {"theta_h": {"bands": (2 * bands).tolist()}}}}
    edited = look_with(transfer, material_of(LOBES, data, **doubled))
    picture.set_look(edited)
    after = run_until_exact(picture).image().copy()
    np.testing.assert_allclose(after, exact_image(transfer, edited), rtol=1e-4, atol=1e-5 * after.max())
    without = look_with(transfer, material_of(LOBES[:1], data))
    diffuse = exact_image(transfer, without)
    np.testing.assert_allclose(after - before, before - diffuse, rtol=2e-3, atol=1e-4 * after.max())


def test_another_material_has_another_operator(transfer, library, data, tmp_path):
    write_merl(tmp_path / "red.binary", make_planes(({"model": "lambert", "color": [0.9, 0.0, 0.0]},)))
    red = store_material(library, tmp_path / "red.binary", "Red")
    try:
        picture = Picture(transfer, "front", Cache(1 << 30))
        picture.set_look(look_with(transfer, material_of(LOBES, data)))
        run_until_exact(picture)
        look = look_with(transfer, material_of(LOBES, red.data))
        picture.set_look(look)
        np.testing.assert_array_equal(run_until_exact(picture).image(), exact_image(transfer, look))
        view = transfer.views["front"]
        inside = (view.material_ids() == 2) & (np.bincount(view.pixel).reshape(36, 48) == 1)
        assert picture.image()[inside, 0].all()
        assert not picture.image()[inside, 1:].any()
    finally:
        STORE.remove(library, red.id)
