"""Triangle lights against point lights, with which highlights break into dots (figure 4, Ben-Artzi 2006).

Both have the light of the same triangles: a point has it in one direction and one band, a triangle spreads it over the
bands it overlaps. Root mean square error relative to each pixel's radiance for a ball with a narrow highlight
(cook_torrance, σ = 0.05) under an environment with a sun (`python -m pytest -s` prints it):

    lights   triangles   points
       500     0.04       0.6
     1 000     0.02       0.25

Most triangles lie in the sun; elsewhere their distance is larger than the highlight, and points leave gaps. Points
suffice for wider highlights (the paper, section 5.1).
"""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest

from relume.assets.environments.equirect import texel_directions
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract

DOCUMENT = {"model": "cook_torrance", "params": {"sigma": 0.05}}
TERM = TERMS["cook_torrance"]
BANDS = {curve.name: curve_bands(DOCUMENT, curve) for curve in TERM.curves}


def environment_with_sun(height):
    d = texel_directions(height, 2 * height).astype(float)
    radiance = 0.6 + 0.4 * d[..., 1:2] * [0.5, 0.8, 1.0] + 0.1 * np.sin(3 * d[..., :1])
    towards = ref.unit(np.float64([-1, 1.5, 1.5]))
    return (radiance + 3000 * np.exp((d @ towards - 1) / 0.03**2)[..., None] * [1, 0.9, 0.7]).astype(np.float32)


def ball(size=16):
    """Points of a distant ball, one per pixel, up to 66° from the center."""
    y, x = (np.stack(np.meshgrid(np.arange(size), np.arange(size), indexing="ij")) + 0.5) / size * 2 - 1
    inside = x**2 + y**2 < 0.83
    normal = np.stack([x, -y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)[inside]
    tangent = ref.unit(np.cross([0.0, 1.0, 0.0], normal))
    wo = np.tile([0.0, 0.0, 1.0], (len(normal), 1))
    return ref.make_receivers_at_origin(wo, normal, tangent, np.zeros((len(wo), 0), np.uint8))


@pytest.fixture(scope="module")
def reference():
    return ref.integrate_texels(DOCUMENT, environment_with_sun(128), ball())


def errors(reference, num_lights):
    """Error of triangles and of points relative to each pixel."""
    lights = tessellate_environment(environment_with_sun(256), num_lights)
    receivers = ref.only_above(ball(), lights)
    projector = Projector(TERM, contract(TERM, BANDS, None), lights, receivers)
    triangles = projector.project(0, len(receivers.normal))[:, 0]
    points = ref.project_point_lights(TERM, BANDS, lights, receivers)
    return [float(np.sqrt(np.mean((image / reference - 1) ** 2))) for image in (triangles, points)]


def test_triangles_are_accurate_where_points_break_into_dots(reference):
    few, many = errors(reference, 500), errors(reference, 1000)
    for num_lights, (triangles, points) in ((500, few), (1000, many)):
        print(f"{num_lights} lights: triangles {triangles:.3f}, points {points:.3f}")  # noqa: T201
        assert points > 8 * triangles
    assert few[0] < 0.09
    assert many[0] < 0.04
    assert many[1] > 3 * few[0]  # twice as many points do not suffice
