"""Shading of previews: light triangles are not divided, and few lights are listed for many points at once."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from tiny_scenes import studio

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.shading.shader import Shader, UndividedShader
from relume.transport.term_contraction import contract

NUM_POINTS = 200


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 500)


@pytest.fixture(scope="module")
def receivers(lights):
    return ref.only_above(ref.make_random_receivers(NUM_POINTS, lights.num_lights, seed=4), lights)


def contraction_of(model, params):
    document = complete_term(("test",), {"model": model, "params": params}, None)
    term = TERMS[model].normalized(document)
    return term, contract(term, {c.name: curve_bands(document, c) for c in TERMS[model].curves}, None)


def quick_error(model, params, num_lights):
    """Relative RMSE of shading without division."""
    lights = tessellate_environment(studio(), num_lights)
    points = ref.only_above(ref.make_random_receivers(NUM_POINTS, lights.num_lights, seed=4), lights)
    args = *contraction_of(model, params), lights, points
    exact, quick = (shader(*args).project(0, NUM_POINTS) for shader in (Shader, UndividedShader))
    return np.sqrt(np.square(quick - exact).mean() / np.square(exact).mean())


def test_wide_lobes_and_diffuse_light_need_no_division():
    assert quick_error("blinn_phong", {"exponent": 24.0}, 500) < 2e-3
    assert quick_error("lambert", {}, 500) < 1e-7


def test_many_points_are_shaded_as_each_alone(lights, receivers):
    few = lights.select(np.arange(16), lights.irradiance[:16])
    points = ref.only_above(receivers, few)
    shader = UndividedShader(*contraction_of("cook_torrance", {}), few, points)
    alone = np.concatenate([shader.project(p, p + 1) for p in range(NUM_POINTS)])
    assert alone.max() > 0
    np.testing.assert_allclose(shader.project(0, NUM_POINTS), alone, rtol=1e-6)


def test_tails_of_curves_are_omitted():
    """A Gaussian falls below a hundredth of its peak at 3.03 σ; a constant curve never does."""
    angle = (np.arange(900) + 0.5) * np.pi / 1800
    bands = {"theta_h": np.exp(-0.5 * (angle / 0.1) ** 2) * np.ones((3, 1)), "theta_d": np.ones((3, 64))}
    term = TERMS["cook_torrance"]
    bands |= {curve.name: np.ones((3, 64)) for curve in term.curves if curve.name not in bands}
    support = contract(term, bands, None).without_tails(0.01).support
    kinds = [curve.name for curve in term.curves if not curve.depends_on_view]
    expected = {"theta_h": 0.1 * np.sqrt(2 * np.log(100)) * 1800 / np.pi}
    np.testing.assert_allclose(support, [expected.get(name, 64) for name in kinds], atol=1)
