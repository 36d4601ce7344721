"""Discs, spheres, tubes and sun disks against closed forms and integrals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tiny_scenes import make_surface_points

from relume.lights.local_lights import SURFACE, make_light_strata, num_samples, prepare_local_lights
from relume.lights.shape_triangles import shape_triangles, sun_triangles
from relume.lights.surface_hits import surface_distance, surface_radiance
from relume.look import LightGeometry
from relume.raytrace.local_light_visibility import compute_irradiance

AXIS = np.array([0.3, -1.0, 0.2]) / np.linalg.norm([0.3, -1.0, 0.2])
POSITION = np.array([0.4, 1.2, -0.3])
DISC = LightGeometry("disc", tuple(POSITION), tuple(AXIS), radius=0.3)
SPHERE = LightGeometry("sphere", tuple(POSITION), radius=0.2)
TUBE = LightGeometry("tube", tuple(POSITION), tuple(AXIS), radius=0.05, length=1.2)
SQUAT = TUBE._replace(length=0.02)


def irradiance(geometry, points, normals, triangles=None):
    light = prepare_local_lights(geometry, triangles)
    strata = make_light_strata(light, 64)
    assert len(strata.uv) == num_samples(geometry, 64)
    receivers = make_surface_points(points.astype(np.float32), normals.astype(np.float32))
    visible = np.full((len(points), len(strata.uv) // 8), 255, np.uint8)
    return compute_irradiance(light, strata, receivers, visible)


def directions(count, seed=1):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(("distance", "bias", "noise"), [(0.3, 0.01, 0.02), (1.0, 2e-3, 3e-3), (50.0, 1e-5, 1e-4)])
def test_a_disc_lights_points_on_its_axis_as_in_closed_form(distance, bias, noise):
    """E = π r² / (d² + r²)"""
    points = np.tile(POSITION + distance * AXIS, (200, 1))
    ratio = irradiance(DISC, points, np.tile(-AXIS, (200, 1))) * (distance**2 + 0.3**2) / (math.pi * 0.3**2)
    assert ratio.mean() == pytest.approx(1, abs=bias)
    assert ratio.std() < noise
    assert not irradiance(DISC, np.tile(POSITION - AXIS, (2, 1)), np.tile(AXIS, (2, 1))).any()


@pytest.mark.parametrize(("distance", "noise"), [(0.5, 0.03), (2.0, 8e-3), (50.0, 8e-3)])
def test_a_sphere_lights_as_in_closed_form_from_all_sides(distance, noise):
    """E = π (r / d)²"""
    away = directions(400)
    ratio = irradiance(SPHERE, POSITION + distance * away, -away) / (math.pi * (0.2 / distance) ** 2)
    assert ratio.mean() == pytest.approx(1, abs=2e-3)
    assert ratio.std() < noise


@pytest.mark.parametrize(("geometry", "noise"), [(TUBE, 0.02), (SQUAT, 0.01)])
def test_a_tube_lights_as_the_integral_over_its_side(geometry, noise):
    away = directions(300)
    away = away[np.abs(away @ AXIS) < 0.7]  # beyond the ends the light is grazing, and noisier
    points = POSITION + 0.8 * away
    azimuth, along = np.meshgrid(2 * np.pi * (np.arange(200) + 0.5) / 200, (np.arange(200) + 0.5) / 200 - 0.5)
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    normal = np.cos(azimuth)[..., None] * across + np.sin(azimuth)[..., None] * np.cross(AXIS, across)
    surface = POSITION + geometry.radius * normal + geometry.length * along[..., None] * AXIS
    expected = []
    for point, normal_here in zip(points, -away, strict=True):
        offset = point - surface
        cosines = np.maximum((offset * normal).sum(-1), 0) * np.maximum(-(offset @ normal_here), 0)
        expected.append((cosines / (offset**2).sum(-1) ** 2).mean())
    total = 2 * np.pi * geometry.radius * geometry.length * np.array(expected)
    actual = irradiance(geometry, points, -away)
    assert actual.sum() == pytest.approx(total.sum(), rel=3e-3)
    assert np.sqrt(((actual - total) ** 2).mean()) < noise * total.mean()


@pytest.mark.parametrize("angle", [0.1, 0.53, 5.0, 30.0])
def test_a_sun_disk_has_the_irradiance_of_its_light_everywhere(angle):
    geometry = LightGeometry("directional", direction=tuple(3 * AXIS), angle=angle)
    triangles = sun_triangles(geometry, POSITION, 2.0)
    points = POSITION + 2 * directions(300)
    for normal, expected in ((-AXIS, 1.0), (np.array([0.0, 1.0, 0.0]), -AXIS[1])):
        actual = irradiance(geometry, points, np.tile(normal, (300, 1)), triangles)
        np.testing.assert_allclose(actual, expected, rtol=5e-3)
    corners = triangles.corners.astype(float) - POSITION
    cosine = -(corners @ AXIS) / np.linalg.norm(corners, axis=2)
    assert 2 * np.degrees(np.arccos(cosine.min())) == pytest.approx(angle, rel=0.02)


def test_a_sun_without_an_angle_has_no_disk():
    geometry = LightGeometry("directional", direction=(0.0, -1.0, 0.0))
    assert sun_triangles(geometry, POSITION, 2.0) is None
    assert num_samples(geometry, 64) == 1
    assert prepare_local_lights(geometry).kind != SURFACE


@pytest.mark.parametrize(
    ("geometry", "area"),
    [
        (DISC, math.pi * 0.3**2),
        (SPHERE, 4 * math.pi * 0.2**2),
        (TUBE, 2 * math.pi * 0.05 * 1.2),
        (SQUAT, 2 * math.pi * 0.05 * 0.02),
    ],
)
def test_triangles_have_equal_power_and_face_outward(geometry, area):
    corners, radiance, is_two_sided = shape_triangles(geometry)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normal, axis=1)
    assert areas.sum() == pytest.approx(area, rel=1e-5)
    np.testing.assert_allclose(areas * radiance, area / len(areas), rtol=1e-4)
    assert 0.8 < radiance.min() <= radiance.max() < 1.15
    assert not is_two_sided
    outward = corners.mean(axis=1) - POSITION
    if geometry.kind == "tube":
        outward -= np.outer(outward @ AXIS, AXIS)
    assert ((normal @ AXIS if geometry.kind == "disc" else (normal * outward).sum(axis=1)) > 0).all()


RECTANGLE = LightGeometry("rectangle", tuple(POSITION), tuple(AXIS), rotation=20.0, size=(0.6, 0.3))


@pytest.mark.parametrize("geometry", [DISC, SPHERE, TUBE, RECTANGLE], ids=lambda geometry: geometry.kind)
def test_rays_hit_a_shape_as_often_as_its_area_says(geometry):
    """The fraction of parallel rays through a disc of radius 1 that hit is the projected area over π."""
    rng = np.random.default_rng(2)
    towards = -AXIS * 0.8 + np.cross(AXIS, [0, 0, 1.0]) / np.linalg.norm(np.cross(AXIS, [0, 0, 1.0])) * 0.6
    sine = 0.6
    across = np.cross(towards, [1.0, 0, 0])
    across /= np.linalg.norm(across)
    radius, azimuth = np.sqrt(rng.random(100_000)), 2 * np.pi * rng.random(100_000)
    start = np.outer(radius * np.cos(azimuth), across) + np.outer(radius * np.sin(azimuth), np.cross(towards, across))
    origin = (POSITION - 3 * towards + start).astype(np.float32)
    distance = surface_distance(geometry, origin, np.tile(towards, (100_000, 1)).astype(np.float32))
    area = {
        "disc": 0.8 * math.pi * 0.3**2,
        "sphere": math.pi * 0.2**2,
        "tube": 2 * 0.05 * 1.2 * sine,
        "rectangle": 0.8 * 0.6 * 0.3,
    }[geometry.kind]
    assert np.isfinite(distance).mean() == pytest.approx(area / math.pi, rel=0.05)
    assert (np.abs(distance[np.isfinite(distance)] - 3) < 1).all()
    away = surface_distance(geometry, origin, np.tile(-towards, (100_000, 1)).astype(np.float32))
    assert not np.isfinite(away).any()


def test_a_sun_disk_is_hit_within_half_its_angle():
    geometry = LightGeometry("directional", direction=(0.0, -1.0, 0.0), angle=10.0)
    angles = np.radians([0.0, 4.9, 5.1, 180.0])
    direction = np.stack([np.sin(angles), np.cos(angles), 0 * angles], axis=1).astype(np.float32)
    distance = surface_distance(geometry, np.zeros((4, 3), np.float32), direction)
    np.testing.assert_array_equal(np.isfinite(distance), [True, True, False, False])
    assert surface_radiance(geometry) == pytest.approx(1 / (math.pi * math.sin(math.radians(5)) ** 2))
