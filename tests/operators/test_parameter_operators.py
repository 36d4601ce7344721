"""Operators along a parameter: images at its nodes and between them."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from tiny_scenes import studio

from relume.brdf.curves import curve_bands
from relume.brdf.parameter_sweep import curves_of_parameter, slider_values, solid_angles
from relume.brdf.registry import TERMS
from relume.core.errors import CancelledError
from relume.lights.spherical_triangles import tessellate_environment
from relume.math.curve_nodes import choose_nodes
from relume.math.pca import joint
from relume.operators.edit_basis import precompute
from relume.operators.parameter_operator import MAX_ERROR, MAX_NODES, linearize
from relume.operators.update_kernel import changed_columns, stream
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract

SLIDERS = [("blinn_phong", "exponent"), ("cook_torrance", "ior"), ("cook_torrance", "sigma"), ("ggx", "roughness")]
ALL = [(model, p.name) for model, term in TERMS.items() for p in term.parameters if curves_of_parameter(term, p.name)]


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 150)


@pytest.fixture(scope="module")
def receivers(lights):
    return ref.only_above(ref.make_random_receivers(70, lights.num_lights, seed=11), lights)


def bands_of(document):
    term = TERMS[document["model"]].normalized(document)
    return {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}


def shaded(document, lights, receivers):
    """All curves contracted, from the projector. (n, 3)"""
    term, bands = TERMS[document["model"]].normalized(document), bands_of(document)
    return Projector(term, contract(term, bands, None), lights, receivers).project(0, len(receivers.normal))[:, 0]


def image_of(along, document, count):
    """R(p) as in a frame. (n, 3)"""
    linearised, frozen = along
    tiles, _, _, samples = frozen.transport.shape
    image = np.zeros((tiles, 3, samples), np.float32)
    stream(frozen.transport, changed_columns(linearised.coefficients(bands_of(document))), image)
    return image.transpose(0, 2, 1).reshape(-1, 3)[:count]


def frozen_along(document, parameter, lights, receivers):
    term = TERMS[document["model"]].normalized(document)
    linearised = linearize(document, parameter)
    assert linearised is not None
    assert linearised.num_columns <= MAX_NODES
    frozen = precompute(linearised, term, bands_of(document), lights, receivers, lambda fraction: None, lambda: False)
    return linearised, frozen


def relative(actual, expected):
    return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(np.float64(expected) ** 2))


def uniform_response(document, parameter, lights, receivers):
    """Radiance of the samples if the lobe moved by the parameter were uniform over all directions. (n, 3)"""
    term, bands = TERMS[document["model"]].normalized(document), bands_of(document)
    uniform = {c.name: solid_angles(c) / solid_angles(c).sum() for c in curves_of_parameter(term, parameter)}
    bands |= {
        name: np.repeat((bands[name] @ fraction)[:, None], len(fraction), axis=1) for name, fraction in uniform.items()
    }
    return Projector(term, contract(term, bands, None), lights, receivers).project(0, len(receivers.normal))[:, 0]


def relative_excess(actual, expected, uniform):
    """Largest error of a sample, relative to itself plus a hundredth of its uniform response."""
    return float((np.abs(actual - expected) / (np.float64(expected) + 0.01 * uniform + 1e-12)).max())


@pytest.mark.parametrize(("model", "parameter"), ALL)
def test_the_error_of_each_sample_is_bounded_at_any_value(model, parameter, lights, receivers):
    along = frozen_along({"model": model, "params": {}}, parameter, lights, receivers)
    declared = TERMS[model].parameter(parameter)
    # the sharpest tenth, and the whole range
    for value in (*slider_values(declared, 60, at_midpoints=True)[[0, 2, 5, -6, -3, -1]], *slider_values(declared, 7)):
        document = {"model": model, "params": {parameter: float(value)}}
        expected = shaded(document, lights, receivers)
        uniform = uniform_response(document, parameter, lights, receivers)
        assert relative_excess(image_of(along, document, 70), expected, uniform) < MAX_ERROR


def test_columns_equal_the_images_at_the_nodes(lights, receivers):
    document = {"model": "cook_torrance", "params": {"sigma": [0.1, 0.3, 0.6], "extinction": [0.0, 2.0, 6.0]}}
    linearised, frozen = frozen_along(document, "ior", lights, receivers)
    columns = frozen.transport.transpose(2, 0, 3, 1).reshape(linearised.num_columns, -1, 3)[:, :70]
    for k, column in enumerate(columns):
        values = [float(nodes.values[k]) for nodes in linearised.nodes]
        expected = shaded(
            {"model": "cook_torrance", "params": {**document["params"], "ior": values}}, lights, receivers
        )
        np.testing.assert_allclose(column, expected, atol=2e-6 * expected.max())


def test_each_channel_has_its_own_value_and_its_own_nodes(lights, receivers):
    document = {"model": "cook_torrance", "params": {"extinction": [0.0, 2.0, 6.0]}}
    along = frozen_along(document, "ior", lights, receivers)
    assert not np.array_equal(along[0].nodes[0].values, along[0].nodes[2].values)
    at = {"model": "cook_torrance", "params": {"extinction": [0.0, 2.0, 6.0], "ior": [1.3, 2.2, 4.0]}}
    assert relative(image_of(along, at, 70), shaded(at, lights, receivers)) < 3 * MAX_ERROR


def test_several_settings_equal_each_alone(lights, receivers):
    term = TERMS["ashikhmin_shirley"]
    rng = np.random.default_rng(2)
    bands = {curve.name: rng.uniform(0.1, 1, (3, curve.num_bands)) for curve in term.curves}
    bands["beta"][:] = bands["beta"][0]
    bands["alpha"] = rng.uniform(0.1, 1, (3, 5, term.curve("alpha").num_bands))
    together = Projector(term, contract(term, bands, None), lights, receivers).project(0, 70)
    assert together.shape == (70, 5, 3)
    for k in range(5):
        setting_bands = {**bands, "alpha": bands["alpha"][:, k]}
        alone = Projector(term, contract(term, setting_bands, None), lights, receivers).project(0, 70)[:, 0]
        np.testing.assert_allclose(together[:, k], alone, rtol=1e-5)


def test_parameters_that_cannot_be_linearized_use_bands():
    assert linearize({"model": "lambert", "params": {}}, "nothing") is None
    drawn = {"theta_h": {"points": [[0, 1], [90, 0]]}}
    assert linearize({"model": "ggx", "params": {}, "curves": drawn}, "roughness") is None
    # f0 does not change theta_h
    assert linearize({"model": "ggx", "params": {}, "curves": drawn}, "f0") is not None


def test_cancelling_stops_the_freeze(lights, receivers):
    document = {"model": "ggx", "params": {}}
    linearised = linearize(document, "f0")
    with pytest.raises(CancelledError):
        precompute(linearised, TERMS["ggx"], bands_of(document), lights, receivers, lambda fraction: None, lambda: True)


def products(model, parameter, values):
    """Bands of all moved curves at values of a parameter, multiplied in all combinations. (n, J_1 · J_2 · …)"""
    rows = []
    for value in values:
        bands = bands_of({"model": model, "params": {parameter: float(value)}})
        of_curves = [bands[curve.name][0] for curve in curves_of_parameter(TERMS[model], parameter)]
        rows.append(joint(of_curves))
    return np.array(rows)


@pytest.mark.parametrize(("model", "parameter"), ALL)
def test_the_error_of_each_band_is_bounded_at_any_value(model, parameter):
    linearised, term = linearize({"model": model, "params": {}}, parameter), TERMS[model]
    assert linearised.num_columns <= MAX_NODES
    weights = joint([solid_angles(curve) for curve in curves_of_parameter(term, parameter)])
    nodes = products(model, parameter, linearised.nodes[0].values)
    brightest = float((nodes @ weights).max())
    for value in slider_values(term.parameter(parameter), 61, at_midpoints=True):
        document = {"model": model, "params": {parameter: float(value)}}
        exact = products(model, parameter, [value])[0]
        floor = 0.01 * max(float(exact @ weights), 1e-3 * brightest) / weights.sum()
        actual = linearised.coefficients(bands_of(document))[0] @ nodes
        assert (np.abs(actual - exact) / (exact + floor)).max() < MAX_ERROR


@pytest.mark.parametrize(("model", "parameter"), SLIDERS)
def test_node_coefficients_do_not_cancel(model, parameter):
    """Coefficients of both signs are small enough to keep rounding, a millionth of an image, below the error."""
    linearised = linearize({"model": model, "params": {}}, parameter)
    nodes = products(model, parameter, linearised.nodes[0].values)
    for value in slider_values(TERMS[model].parameter(parameter), 61, at_midpoints=True):
        coefficients = linearised.coefficients(bands_of({"model": model, "params": {parameter: float(value)}}))[0]
        exact = products(model, parameter, [value])[0]
        assert (1e-6 * np.abs(coefficients) @ nodes <= MAX_ERROR / 2 * (exact + 0.01 * exact.mean())).all()


def test_nodes_are_added_at_the_largest_error():
    rng = np.random.default_rng(4)
    values, curves = np.arange(9.0), rng.uniform(0, 1, (9, 32))
    between = 0.5 * (curves[:-1] + curves[1:])
    few = choose_nodes(values, curves, between, np.ones(32), 4, 0.0)
    many = choose_nodes(values, curves, between, np.ones(32), 9, 0.0)
    assert few.values.tolist() == many.values[:4].tolist()
    assert many.error < 1e-3 < few.error


def test_a_parameter_without_effect_has_zero_nodes():
    nothing = np.zeros((5, 8))
    nodes = choose_nodes(np.arange(5.0), nothing, nothing[1:], np.ones(8), 4, 0.1)
    assert nodes.error == 0
    np.testing.assert_array_equal(nodes.coefficients(np.zeros(8)), np.zeros(2))
