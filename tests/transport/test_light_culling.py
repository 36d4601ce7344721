"""Light culling: only lights on which a fixed curve is zero are omitted."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from tiny_scenes import studio

from relume.brdf.evaluate import angles_numpy
from relume.brdf.term import Angle
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.light_culling import CurveSupport, allocate_list, angle_lower_bounds, list_lights
from relume.transport.light_lists import with_half_angle

RNG = np.random.default_rng(9)


def around(directions, radius, count):
    """Directions within `radius` (n,) of each of n directions. (n, count, 3)"""
    aside = ref.unit(np.cross(directions[:, None], RNG.normal(size=(len(directions), count, 3))))
    angle = radius[:, None, None] * np.sqrt(RNG.uniform(size=(len(directions), count, 1)))
    angle[:, ::2] = radius[:, None, None]
    return np.cos(angle) * directions[:, None] + np.sin(angle) * aside


@pytest.mark.parametrize("angle", list(Angle))
@pytest.mark.parametrize("wo_z", [0.02, 0.3, 0.9, 1.0])
def test_no_direction_within_the_radius_has_a_smaller_angle(angle, wo_z):
    wi = ref.unit(RNG.normal(size=(2000, 3)) * [1, 1, 0.6])
    wo = np.array([np.sqrt(1 - wo_z**2), 0, wo_z])
    radius = RNG.choice([0.003, 0.03, 0.2, 0.9], size=2000)
    nearest = np.empty(2000, np.float32)
    x, y, z = np.ascontiguousarray(wi.T, np.float32)
    angle_lower_bounds(int(angle), radius.astype(np.float32), x, y, z, *np.float32(wo), nearest)
    exact = angles_numpy(angle, around(wi, radius, 60), wo)
    assert (nearest[:, None] <= exact + 1e-3).all()


@pytest.mark.parametrize("angle", [Angle.THETA_I, Angle.THETA_H, Angle.THETA_D, Angle.THETA_R])
def test_bound_is_close_for_small_lights(angle):
    wi = ref.unit(RNG.normal((0, 0, 2), 1, size=(500, 3)))
    wi[:, 2] = np.abs(wi[:, 2])
    wo, radius = np.array([0.6, 0, 0.8]), np.full(500, 0.01)
    nearest = np.empty(500, np.float32)
    x, y, z = np.ascontiguousarray(wi.T, np.float32)
    angle_lower_bounds(int(angle), radius.astype(np.float32), x, y, z, *np.float32(wo), nearest)
    assert (angles_numpy(angle, wi, wo) - nearest < 0.06).all()


def test_every_corner_of_a_light_lies_within_its_radius():
    lights = tessellate_environment(studio(), 300)
    cosine = np.einsum("ckm,mc->mk", lights.nodes.astype(float), lights.direction.astype(float))
    assert (np.arccos(np.clip(cosine, -1, 1)) <= lights.radius[:, None] + 1e-3).all()


@pytest.mark.parametrize("support", [np.inf, 0.5, 0.1])
def test_the_list_has_the_visible_lights_in_order(support):
    lights = tessellate_environment(studio(), 150)
    receivers = ref.only_above(ref.make_random_receivers(9, lights.num_lights, seed=7), lights)
    listed = allocate_list(9, 9 * lights.num_lights)
    limits = CurveSupport(np.array([int(Angle.THETA_H)]), np.array([support], np.float32))
    scratch = np.empty((2, lights.num_lights), np.float32)
    light_args = lights.direction, lights.radius, limits, 0, scratch
    num = list_lights(receivers.points, receivers.wo, receivers.visible, *light_args, listed)
    first, light, wi, wo = listed
    assert num == first[-1]
    visible = ref.visible_lights(receivers, lights.num_lights)
    corners = lights.nodes[:, :3].transpose(2, 1, 0).astype(float)
    for row, frame in enumerate(ref.frames(receivers)):
        listed = light[first[row] : first[row + 1]]
        local_wo = frame @ receivers.wo[row].astype(float)
        assert set(listed) <= set(np.nonzero(visible[row])[0])
        assert list(listed) == sorted(listed)
        np.testing.assert_allclose(wi[:, first[row] : first[row + 1]].T, lights.direction[listed] @ frame.T, atol=1e-6)
        np.testing.assert_allclose(wo[:, first[row] : first[row + 1]].T - local_wo, 0, atol=1e-6)
        nearest = angles_numpy(Angle.THETA_H, corners @ frame.T, local_wo).min(axis=1)
        assert set(np.nonzero(visible[row] & (nearest <= support))[0]) <= set(listed)
    assert (num == visible.sum()) == np.isinf(support)


@pytest.mark.parametrize("pair", [(Angle.ALPHA, Angle.BETA), (Angle.TILT_X, Angle.TILT_Y)])
def test_two_angles_of_the_half_vector_bound_the_third(pair):
    wi, wo = (
        ref.unit(RNG.normal((0, 0, 1), 1, size=(20_000, 3))),
        ref.unit(np.array([0.3, -0.4, 0.8])),
    )
    first, second, half = (angles_numpy(angle, wi, wo) for angle in (*pair, Angle.THETA_H))
    given = np.array([Angle.THETA_D, *pair], np.int64)
    kinds, support = with_half_angle(CurveSupport(given, np.array([1.6, 0.5, 0.2], np.float32)))
    assert list(kinds) == [*given, Angle.THETA_H]
    reached = half[(first <= 0.5) & (second <= 0.2)]
    assert reached.max() <= support[-1] + 1e-3
    assert reached.max() > 0.9 * support[-1]  # no tighter bound is needed
    kinds, _ = with_half_angle(CurveSupport(given, np.array([1.6, np.inf, 0.2], np.float32)))
    assert list(kinds) == list(given)  # the free curve can take any value
