"""Operators along a parameter: images at its nodes, and between them."""

from __future__ import annotations

import numpy as np
import pytest
import twins
from tiny_scenes import studio

from relume.basis.pca import choose_nodes, joint, worst_relative_rms
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.sweep import bands_at, moved_curves, slider_values
from relume.errors import CancelledError
from relume.light.triangles import subdivide
from relume.transfer.contraction import contract
from relume.transfer.projector import Projector
from relume.transfer.slider import MAX_ERROR, MAX_NODES, linearise
from relume.transfer.stream import columns_of, stream

SLIDERS = [("blinn_phong", "exponent"), ("cook_torrance", "ior"), ("cook_torrance", "sigma"), ("ggx", "roughness")]


@pytest.fixture(scope="module")
def lights():
    return subdivide(studio(), 150)


@pytest.fixture(scope="module")
def receivers(lights):
    return twins.only_above(twins.make_receivers(70, lights.num_lights, seed=11), lights)


def bands_of(document):
    term = TERMS[document["model"]].settled(document)
    return {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}


def shaded(document, lights, receivers):
    """All curves contracted, straight from the projector. (n, 3)"""
    term, bands = TERMS[document["model"]].settled(document), bands_of(document)
    return Projector(term, contract(term, bands, None), lights, receivers).project(0, len(receivers.normal))[:, 0]


def image_of(along, document, count):
    """R(p) as a frame would make it. (n, 3)"""
    linearised, frozen = along
    tiles, _, _, samples = frozen.transport.shape
    image = np.zeros((tiles, 3, samples), np.float32)
    stream(frozen.transport, columns_of(linearised.coefficients(bands_of(document))), image)
    return image.transpose(0, 2, 1).reshape(-1, 3)[:count]


def frozen_along(document, parameter, lights, receivers):
    term = TERMS[document["model"]].settled(document)
    linearised = linearise(document, parameter)
    assert linearised is not None
    assert linearised.num_columns <= MAX_NODES
    frozen = linearised.freeze(term, bands_of(document), lights, receivers, lambda share: None, lambda: False)
    return linearised, frozen


def relative(found, expected):
    return np.sqrt(np.mean((found - expected) ** 2) / np.mean(np.float64(expected) ** 2))


@pytest.mark.parametrize(("model", "parameter"), SLIDERS)
def test_image_at_any_value_is_the_shaded_one(model, parameter, lights, receivers):
    along = frozen_along({"model": model, "params": {}}, parameter, lights, receivers)
    declared = TERMS[model].parameter(parameter)
    for value in slider_values(declared, 9, between=True):
        document = {"model": model, "params": {parameter: float(value)}}
        expected = shaded(document, lights, receivers)
        # curves are held to MAX_ERROR over all directions; these points see some of them more brightly than others
        assert relative(image_of(along, document, 70), expected) < 3 * MAX_ERROR


def test_columns_are_the_images_at_the_nodes(lights, receivers):
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


def test_several_settings_at_once_are_each_alone(lights, receivers):
    term = TERMS["ashikhmin_shirley"]
    rng = np.random.default_rng(2)
    bands = {curve.name: rng.uniform(0.1, 1, (3, curve.num_bands)) for curve in term.curves}
    bands["beta"][:] = bands["beta"][0]
    bands["alpha"] = rng.uniform(0.1, 1, (3, 5, term.curve("alpha").num_bands))
    together = Projector(term, contract(term, bands, None), lights, receivers).project(0, 70)
    assert together.shape == (70, 5, 3)
    for k in range(5):
        one = {**bands, "alpha": bands["alpha"][:, k]}
        alone = Projector(term, contract(term, one, None), lights, receivers).project(0, 70)[:, 0]
        np.testing.assert_allclose(together[:, k], alone, rtol=1e-5)


def test_what_cannot_be_linearised_is_left_to_the_bands():
    assert linearise({"model": "lambert", "params": {}}, "nothing") is None
    drawn = {"theta_h": {"points": [[0, 1], [90, 0]]}}
    assert linearise({"model": "ggx", "params": {}, "curves": drawn}, "roughness") is None
    # theta_h is not among those that f0 moves
    assert linearise({"model": "ggx", "params": {}, "curves": drawn}, "f0") is not None


def test_cancelling_stops(lights, receivers):
    document = {"model": "ggx", "params": {}}
    linearised = linearise(document, "f0")
    with pytest.raises(CancelledError):
        linearised.freeze(TERMS["ggx"], bands_of(document), lights, receivers, lambda share: None, lambda: True)


@pytest.mark.parametrize(
    ("model", "parameter"), [*SLIDERS, ("ashikhmin_shirley", "nu"), ("cook_torrance", "extinction")]
)
def test_nodes_span_the_range_to_the_error_they_say(model, parameter):
    term = TERMS[model]
    declared, curves = term.parameter(parameter), moved_curves(term, parameter)

    def products(values):
        return np.array([joint([bands_at(term, curve, {parameter: value}) for curve in curves]) for value in values])

    values, other = slider_values(declared, 97), products(slider_values(declared, 96, between=True))
    nodes = choose_nodes(values, products(values), other, MAX_NODES)
    assert (np.diff(nodes.errors) <= 1e-7).all()
    enough = int(np.argmax(nodes.errors <= MAX_ERROR)) + 1
    assert nodes.errors[enough - 1] <= MAX_ERROR
    for num in (3, enough):
        few = nodes.first(num)
        found = np.array([few.coefficients(curve) for curve in other]) @ few.curves
        assert worst_relative_rms(found, other) == pytest.approx(nodes.errors[num - 1], rel=1e-3, abs=1e-6)
