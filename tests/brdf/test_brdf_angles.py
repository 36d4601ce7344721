"""Angles: values known in closed form, and the kernel against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from term_properties import directions

from relume.brdf.angles import angle_at, compute_alpha_beta
from relume.brdf.evaluate import angles_numpy
from relume.brdf.term import Angle


def direction(theta, phi=0.0):
    theta, phi = np.radians(theta), np.radians(phi)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


@pytest.mark.parametrize(
    ("angle", "wi", "wo", "degrees"),
    [
        (Angle.THETA_I, direction(30), direction(70), 30),
        (Angle.THETA_O, direction(30), direction(70), 70),
        (Angle.THETA_H, direction(30), direction(70), 50),
        (Angle.THETA_D, direction(30), direction(70), 20),
        (Angle.THETA_H, direction(40), direction(40, 180), 0),
        (Angle.THETA_D, direction(40), direction(40, 180), 40),
        (Angle.THETA_R, direction(40), direction(40, 180), 0),
        (Angle.THETA_R, direction(25), direction(40, 180), 15),
        (Angle.ALPHA, direction(30), direction(70), 50),  # half vector along the tangent: all of θh is γα
        (Angle.BETA, direction(30), direction(70), 0),
        (Angle.ALPHA, direction(30, 90), direction(70, 90), 0),
        (Angle.BETA, direction(30, 90), direction(70, 90), 50),
        (Angle.TILT_X, direction(30), direction(70), 50),  # half vector along the tangent: all of θh is tilt along it
        (Angle.TILT_Y, direction(30), direction(70), 0),
        (Angle.TILT_Y, direction(30, 90), direction(70, 90), 50),
        (Angle.TILT_X, direction(50, 45), direction(50, 45), np.degrees(np.arctan(np.tan(np.radians(50)) * 0.5**0.5))),
        (Angle.LOBE, direction(30), direction(70), 40),
        (Angle.ALPHA, direction(50, 45), direction(50, 45), np.degrees(np.arccos(np.cos(np.radians(50)) ** 0.5))),
    ],
)
def test_angle_of_known_directions(angle, wi, wo, degrees):
    assert np.degrees(angles_numpy(angle, wi, wo)) == pytest.approx(degrees, abs=2e-6)


def test_lobe_with_the_axes_of_a_mirror_is_the_mirror_angle():
    rng = np.random.default_rng(9)
    wi, wo = directions(rng, 200), directions(rng, 200)
    mirror = angles_numpy(Angle.LOBE, wi, wo, (-1.0, -1.0, 1.0))
    np.testing.assert_allclose(mirror, angles_numpy(Angle.THETA_R, wi, wo), atol=1e-12)


def test_tilts_along_and_across_make_up_the_half_angle():
    rng = np.random.default_rng(10)
    wi, wo = directions(rng, 200), directions(rng, 200)
    along, across, half = (np.tan(angles_numpy(a, wi, wo)) for a in (Angle.TILT_X, Angle.TILT_Y, Angle.THETA_H))
    np.testing.assert_allclose(np.hypot(along, across), half, rtol=1e-9)


@pytest.mark.parametrize("angle", list(Angle))
def test_kernel_equals_numpy(angle):
    rng = np.random.default_rng(8)
    wi, wo = (directions(rng, 3000, 1e-3).astype(np.float32) for _ in range(2))
    kernel = np.array([angle_at(int(angle), *i, *o) for i, o in zip(wi, wo, strict=True)])
    twin = angles_numpy(angle, wi, wo)
    assert twin.min() >= 0
    assert twin.max() <= np.pi / 2
    # near one, the error of an arc cosine in float32 is the root of its rounding, 3e-4
    np.testing.assert_allclose(kernel, twin, atol=5e-4)
    np.testing.assert_allclose(np.cos(kernel), np.cos(twin), atol=1e-6)


def test_alpha_and_beta_equal_numpy():
    rng, wo = np.random.default_rng(11), direction(40, 70)
    wi = np.concatenate([directions(rng, 3000, 1e-3), [direction(40, 250), wo]])
    actual, scale = np.empty((2, len(wi)), np.float32), np.array([2, 3], np.float32)
    compute_alpha_beta(scale, *np.ascontiguousarray(wi.T, np.float32), *wo.astype(np.float32), *actual)
    twin = np.stack([angles_numpy(angle, wi, wo) for angle in (Angle.ALPHA, Angle.BETA)])
    np.testing.assert_allclose(actual / scale[:, None], twin, atol=5e-4)
    np.testing.assert_allclose(np.cos(actual / scale[:, None]), np.cos(twin), atol=1e-6)
