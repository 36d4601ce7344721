"""The projector of pictures against its twin, which divides triangles finely, and against the one for operators."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from analytic_terms import ANALYTIC
from tiny_scenes import studio

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.projector import Projector
from relume.transport.shading import shader
from relume.transport.shading.shader import Shader
from relume.transport.term_contraction import contract

NUM_POINTS = 24
SHARP = [("ggx", {"roughness": 0.2}), ("ggx", {"roughness": 0.4, "f0": [0.9, 0.5, 0.1]}), ("ward", {"alpha": 0.08})]
CASES = [(model, {}) for model in ANALYTIC] + SHARP
NARROW = [("cook_torrance", {"sigma": 0.02}), ("blinn_phong", {"exponent": 2000.0}), ("ggx", {"roughness": 0.1})]
# all are held to their operators; these, and with the long tests the others, to finely divided light
OFTEN = ("lambert", "cook_torrance", "ward_anisotropic", "ggx")
DIVIDED = [pytest.param(*case, marks=[pytest.mark.slow] * (case[0] not in OFTEN)) for case in CASES]


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 1000)


@pytest.fixture(scope="module")
def receivers(lights):
    return ref.only_above(ref.make_random_receivers(NUM_POINTS, lights.num_lights, seed=4), lights)


def curves_of(model, params):
    document = complete_term(("test",), {"model": model, "params": params}, None)
    return TERMS[model].normalized(document), {c.name: curve_bands(document, c) for c in TERMS[model].curves}


def shaded(term, bands, lights, receivers):
    return Shader(term, contract(term, bands, None), lights, receivers).project(0, len(receivers.normal))[:, 0]


def error(actual, expected):
    """Relative RMSE."""
    return np.sqrt(np.square(actual - expected).mean() / np.square(expected).mean())


def everything_seen(receivers, lights):
    return ref.only_above(replace(receivers, visible=np.full_like(receivers.visible, 255)), lights)


@pytest.mark.parametrize(("model", "params"), DIVIDED)
def test_pictures_are_those_of_finely_divided_light(model, params, lights, receivers):
    term, bands = curves_of(model, params)
    expected = ref.project(term, bands, None, lights, receivers, depth=4)[:, 0]
    actual = shaded(term, bands, lights, receivers)
    assert error(actual, expected) < 3e-3
    assert abs(actual.sum() / expected.sum() - 1) < 2.5e-3


@pytest.mark.parametrize(("model", "params"), CASES)
def test_pictures_are_those_of_operators(model, params, lights, receivers):
    """What is shown before a curve is touched and after differs by about a thousandth."""
    term, bands = curves_of(model, params)
    for active in (c.name for c in term.curves if not c.depends_on_view):
        transport = Projector(term, contract(term, bands, active), lights, receivers).project(0, NUM_POINTS)
        of_operator = np.einsum("njc,cj->nc", transport.astype(float), bands[active])
        assert error(shaded(term, bands, lights, receivers), of_operator) < 2e-3


def test_operators_are_those_of_finely_divided_light(lights, receivers):
    """An angle bends over a leaf nearly always the same way: uncorrected, highlights were 1 to 2 % too dark."""
    term, bands = curves_of("ggx", {"roughness": 0.2})
    expected = ref.project(term, bands, None, lights, receivers, depth=4)[:, 0]
    actual = Projector(term, contract(term, bands, None), lights, receivers).project(0, NUM_POINTS)[:, 0]
    assert error(actual, expected) < 3e-3
    assert abs(actual.sum() / expected.sum() - 1) < 1.5e-3


@pytest.mark.slow
def test_drawn_steps_are_integrated(lights, receivers):
    """A curve of eight bright rings, each a band or two wide, the triangles' angles spread over several."""
    term, bands = curves_of("blinn_phong", {})
    steps = np.full((3, 256), 0.01)
    steps[0, 10:200:24], steps[1, 14:200:24], steps[2, 11:200:24] = 1.0, 2.0, 0.5
    bands = {**bands, "theta_h": steps}
    expected = ref.project(term, bands, None, lights, receivers, depth=5)[:, 0]
    assert error(shaded(term, bands, lights, receivers), expected) < 1.2e-2


def test_no_light_is_black_and_twice_the_light_twice_as_bright(lights, receivers):
    term, bands = curves_of("ggx", {})
    unseen = replace(receivers, visible=np.zeros_like(receivers.visible))
    assert not shaded(term, bands, lights, unseen).any()
    assert not shaded(term, bands, lights.empty(), receivers).any()
    assert not shaded(term, {**bands, "theta_h": np.zeros((3, 256))}, lights, receivers).any()
    twice = shaded(term, bands, replace(lights, irradiance=2 * lights.irradiance), receivers)
    np.testing.assert_allclose(twice, 2 * shaded(term, bands, lights, receivers), rtol=1e-5)


def test_a_range_is_shaded_as_part_of_all(lights, receivers):
    term, bands = curves_of("cook_torrance", {})
    subset = Shader(term, contract(term, bands, None), lights, receivers).project(5, 9)[:, 0]
    np.testing.assert_array_equal(subset, shaded(term, bands, lights, receivers)[5:9])


def test_light_that_scatters_evenly_is_its_sum(receivers, lights):
    """All lights at once, in double precision: those that are seen, by their cosine."""
    term, bands = curves_of("lambert", {})
    bands = {"theta_i": np.repeat([[0.5], [1.0], [2.0]], 64, axis=1)}
    visible = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little")
    cosine = np.maximum(receivers.normal.astype(float) @ lights.direction.T.astype(float), 0)
    is_up = np.einsum("nc,nc->n", receivers.normal, receivers.wo) > 0
    expected = (is_up[:, None] * visible * cosine) @ lights.irradiance.astype(float) / np.pi * [0.5, 1, 2]
    np.testing.assert_allclose(shaded(term, bands, lights, receivers), expected, rtol=2e-5)


@pytest.mark.parametrize(("model", "params"), CASES)
def test_groups_of_lights_bring_what_their_lights_bring(model, params, lights, receivers):
    """To less than the thousandth by which pictures may differ from operators; `ggx_multiple` leans most."""
    term, bands = curves_of(model, params)
    alone = shaded(term, bands, replace(lights, codes=None), receivers)
    assert error(shaded(term, bands, lights, receivers), alone) < 6e-4


@pytest.mark.parametrize(("model", "params"), NARROW)
def test_lobes_narrower_than_lights_are_apart_lose_no_light(model, params):
    """In groups whose cosines lean they took light away, a hundred times what arrives; beside groups and lights whose
    means are nothing in float32, they were not looked for there."""
    few, (term, bands) = tessellate_environment(studio(), 200), curves_of(model, params)
    receivers = everything_seen(ref.make_random_receivers(100, few.num_lights, seed=4), few)
    actual, alone = (shaded(term, bands, lights, receivers) for lights in (few, replace(few, codes=None)))
    assert actual.min() >= 0
    assert error(actual, alone) < 1e-3


def test_a_narrow_lobe_is_found_within_wide_lights():
    few, (term, bands) = tessellate_environment(studio(), 200), curves_of("cook_torrance", {"sigma": 0.01})
    receivers = everything_seen(ref.make_random_receivers(4, few.num_lights, seed=4), few)
    expected = ref.project(term, bands, None, few, receivers, depth=6)[:, 0]
    assert error(shaded(term, bands, replace(few, codes=None), receivers), expected) < 4e-3


def test_most_lights_are_shaded_in_groups(lights, receivers, monkeypatch):
    """A broad term, and all the sky in sight: else the test above would compare lights with themselves."""
    left = []
    monkeypatch.setattr(shader, "shade_points", lambda *args: left.append(args[2][args[11] - args[10]]))
    term, bands = curves_of("blinn_phong", {"exponent": 2.0})
    everything = everything_seen(receivers, lights)
    shaded(term, bands, lights, everything)
    assert 0 < sum(left) < 0.4 * np.unpackbits(everything.visible).sum()
