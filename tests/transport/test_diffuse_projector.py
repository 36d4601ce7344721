"""Sums of visible lights at Lambertian points against NumPy in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest

from relume.brdf.registry import TERMS
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.diffuse_projector import DiffuseProjector

NUM_POINTS = 40
CONSTANT = np.array([0.5, 1.0, 2.0], np.float32)


def random_lights(num_lights):
    rng = np.random.default_rng(num_lights)
    direction = ref.unit(rng.normal(size=(num_lights, 3))).astype(np.float32)
    return TriangleLights(
        np.zeros((3, 6, num_lights), np.float32), direction, rng.random((num_lights, 3)).astype(np.float32)
    )


def random_visibility(num_lights):
    """Bits that include lights below the horizon, bits after the last light, and many bytes without any."""
    rng = np.random.default_rng(7)
    shape = NUM_POINTS, -(-num_lights // 8)
    return (rng.integers(0, 256, shape) * rng.integers(0, 2, shape)).astype(np.uint8)


def expected_sum(receivers, lights):
    visible = np.unpackbits(receivers.visible, axis=1, count=lights.num_lights, bitorder="little")
    cosine = np.maximum(receivers.normal.astype(float) @ lights.direction.T.astype(float), 0)
    is_up = np.einsum("nc,nc->n", receivers.normal, receivers.wo) > 0
    return (is_up[:, None] * visible * cosine) @ lights.irradiance.astype(float) * CONSTANT / np.pi


@pytest.mark.parametrize("num_lights", [1, 8, 9, 1003])
def test_the_sum_equals_that_in_double_precision(num_lights):
    lights = random_lights(num_lights)
    receivers = replace(ref.make_random_receivers(NUM_POINTS, num_lights), visible=random_visibility(num_lights))
    actual = DiffuseProjector(TERMS["lambert"], CONSTANT, lights).shade(receivers, 3, NUM_POINTS)
    expected = expected_sum(receivers, lights)[3:]
    assert expected.max() > 0
    np.testing.assert_allclose(actual, expected, rtol=1e-6, atol=1e-7)


def test_visibility_may_be_a_view_of_another_array():
    lights, visible = random_lights(100), random_visibility(100)
    receivers = replace(ref.make_random_receivers(NUM_POINTS, 100), visible=np.asfortranarray(visible))
    actual = DiffuseProjector(TERMS["lambert"], CONSTANT, lights).shade(receivers, 0, NUM_POINTS)
    np.testing.assert_allclose(actual, expected_sum(receivers, lights), rtol=1e-6, atol=1e-7)


def test_without_lights_there_is_no_light():
    receivers = ref.make_random_receivers(NUM_POINTS, 0)
    actual = DiffuseProjector(TERMS["lambert"], CONSTANT, random_lights(0)).shade(receivers, 0, NUM_POINTS)
    np.testing.assert_array_equal(actual, np.zeros((NUM_POINTS, 3), np.float32))
