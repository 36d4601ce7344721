"""The shading projector against finely subdivided triangles in NumPy, and against operators."""

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
# all are compared with operators; these, and in long tests the others, with finely subdivided light
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


def everything_visible(receivers, lights):
    return ref.only_above(replace(receivers, visible=np.full_like(receivers.visible, 255)), lights)


@pytest.mark.parametrize(("model", "params"), DIVIDED)
def test_shading_equals_finely_subdivided_light(model, params, lights, receivers):
    term, bands = curves_of(model, params)
    expected = ref.project(term, bands, None, lights, receivers, depth=4)[:, 0]
    actual = shaded(term, bands, lights, receivers)
    assert error(actual, expected) < 3e-3
    assert abs(actual.sum() / expected.sum() - 1) < 2.5e-3


@pytest.mark.parametrize(("model", "params"), CASES)
def test_shading_equals_operators(model, params, lights, receivers):
    """Pictures before and after a curve is prepared differ by about 0.1 %."""
    term, bands = curves_of(model, params)
    for active in (c.name for c in term.curves if not c.depends_on_view):
        transport = Projector(term, contract(term, bands, active), lights, receivers).project(0, NUM_POINTS)
        of_operator = np.einsum("njc,cj->nc", transport.astype(float), bands[active])
        assert error(shaded(term, bands, lights, receivers), of_operator) < 2e-3


def test_operators_equal_finely_subdivided_light(lights, receivers):
    """Angles over a subdivided triangle mostly curve one way: uncorrected, highlights were 1 to 2 % too dark."""
    term, bands = curves_of("ggx", {"roughness": 0.2})
    expected = ref.project(term, bands, None, lights, receivers, depth=4)[:, 0]
    actual = Projector(term, contract(term, bands, None), lights, receivers).project(0, NUM_POINTS)[:, 0]
    assert error(actual, expected) < 3e-3
    assert abs(actual.sum() / expected.sum() - 1) < 1.5e-3


@pytest.mark.slow
def test_drawn_steps_are_integrated(lights, receivers):
    """A curve of eight bright rings, each one or two bands wide, with triangles that span several."""
    term, bands = curves_of("blinn_phong", {})
    steps = np.full((3, 256), 0.01)
    steps[0, 10:200:24], steps[1, 14:200:24], steps[2, 11:200:24] = 1.0, 2.0, 0.5
    bands = {**bands, "theta_h": steps}
    expected = ref.project(term, bands, None, lights, receivers, depth=5)[:, 0]
    assert error(shaded(term, bands, lights, receivers), expected) < 1.2e-2


def test_shading_is_linear_in_the_light(lights, receivers):
    term, bands = curves_of("ggx", {})
    unseen = replace(receivers, visible=np.zeros_like(receivers.visible))
    assert not shaded(term, bands, lights, unseen).any()
    assert not shaded(term, bands, lights.empty(), receivers).any()
    assert not shaded(term, {**bands, "theta_h": np.zeros((3, 256))}, lights, receivers).any()
    twice = shaded(term, bands, replace(lights, irradiance=2 * lights.irradiance), receivers)
    np.testing.assert_allclose(twice, 2 * shaded(term, bands, lights, receivers), rtol=1e-5)


def test_a_range_equals_part_of_the_whole(lights, receivers):
    term, bands = curves_of("cook_torrance", {})
    subset = Shader(term, contract(term, bands, None), lights, receivers).project(5, 9)[:, 0]
    np.testing.assert_array_equal(subset, shaded(term, bands, lights, receivers)[5:9])


def test_diffuse_shading_is_a_sum_over_lights(receivers, lights):
    """All lights at once in double precision: visible lights times their cosine."""
    term, bands = curves_of("lambert", {})
    bands = {"theta_i": np.repeat([[0.5], [1.0], [2.0]], 64, axis=1)}
    visible = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little")
    cosine = np.maximum(receivers.normal.astype(float) @ lights.direction.T.astype(float), 0)
    is_up = np.einsum("nc,nc->n", receivers.normal, receivers.wo) > 0
    expected = (is_up[:, None] * visible * cosine) @ lights.irradiance.astype(float) / np.pi * [0.5, 1, 2]
    np.testing.assert_allclose(shaded(term, bands, lights, receivers), expected, rtol=2e-5)


@pytest.mark.parametrize(("model", "params"), CASES)
def test_grouped_lights_equal_single_lights(model, params, lights, receivers):
    """Within 0.1 %, the tolerance between pictures and operators; `ggx_multiple` differs most."""
    term, bands = curves_of(model, params)
    alone = shaded(term, bands, replace(lights, codes=None), receivers)
    assert error(shaded(term, bands, lights, receivers), alone) < 6e-4


@pytest.mark.parametrize(("model", "params"), NARROW)
def test_lobes_narrower_than_the_light_spacing_preserve_energy(model, params):
    """In groups with varying cosines they lost a hundred times the incident light; they were skipped next to groups and
    lights whose means vanish in float32.
    """
    few, (term, bands) = tessellate_environment(studio(), 200), curves_of(model, params)
    receivers = everything_visible(ref.make_random_receivers(100, few.num_lights, seed=4), few)
    actual, alone = (shaded(term, bands, lights, receivers) for lights in (few, replace(few, codes=None)))
    assert actual.min() >= 0
    assert error(actual, alone) < 1e-3


@pytest.mark.slow
def test_a_narrow_lobe_within_wide_lights_is_shaded():
    few, (term, bands) = tessellate_environment(studio(), 200), curves_of("cook_torrance", {"sigma": 0.01})
    receivers = everything_visible(ref.make_random_receivers(4, few.num_lights, seed=4), few)
    expected = ref.project(term, bands, None, few, receivers, depth=8)[:, 0]  # 0.2 % off itself; 0.6 % with 6
    assert error(shaded(term, bands, replace(few, codes=None), receivers), expected) < 4e-3


def test_most_lights_are_shaded_in_groups(lights, receivers, monkeypatch):
    """A broad term in the whole environment: otherwise the test above would compare lights with themselves."""
    left = []
    monkeypatch.setattr(shader, "shade_points", lambda *args: left.append(args[1].first[args[6] - args[5]]))
    term, bands = curves_of("blinn_phong", {"exponent": 2.0})
    everything = everything_visible(receivers, lights)
    shaded(term, bands, lights, everything)
    assert 0 < sum(left) < 0.4 * np.unpackbits(everything.visible).sum()
