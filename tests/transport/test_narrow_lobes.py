"""Lobes narrower than a light triangle and a band: chrome in uniform light is uniform with the light's radiance."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.lights.spherical_triangles import tessellate_environment
from relume.raytrace.tangents import any_tangent
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(np.ones((256, 512, 3), np.float32), 500)


def shown(document, lights, normal, wo):
    """All curves, including those of the outgoing angle. (n, 3)"""
    term = TERMS[document["model"]]
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.depends_on_view}
    visible = np.full((len(normal), -(-lights.num_lights // 8)), 255, np.uint8)
    receivers = ref.make_receivers_at_origin(wo, normal, any_tangent(normal), visible)
    image = Projector(term, contract(term, bands, None), lights, receivers).project(0, len(normal))[:, 0]
    theta_o = np.arccos(np.sum(normal * wo, axis=1).astype(np.float64))
    outgoing = [curve_values(document, curve, theta_o).T for curve in term.curves if curve.depends_on_view]
    return image * np.prod(outgoing, axis=0) if outgoing else image


@pytest.mark.parametrize("roughness", [0.03, 0.05, 0.08, 0.12])
def test_chrome_in_uniform_light_is_uniform(roughness, lights):
    rng = np.random.default_rng(12)
    normal = rng.normal(size=(600, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tilt = any_tangent(normal) * np.tan(np.radians(rng.uniform(0, 60, (600, 1)))).astype(np.float32)
    wo = (normal + tilt) / np.linalg.norm(normal + tilt, axis=1, keepdims=True)
    chrome = {"model": "ggx", "params": {"roughness": roughness, "f0": 1.0}}
    radiance = shown(chrome, lights, normal, np.ascontiguousarray(wo, np.float32))
    assert 0.94 < radiance.mean() < 1.01
    assert radiance.std() < 0.04
    assert radiance.min() > 0.75
    assert radiance.max() < 1.25
