"""Samples of local lights against plain NumPy, and their sums against irradiance in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_emissive_triangles, make_surface_points

from relume.lights.local_lights import light_sample, make_light_strata, prepare_local_lights, rectangle
from relume.look import LightGeometry
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.raytrace.local_light_visibility import compute_irradiance

RNG = np.random.default_rng(11)
PIECES = RNG.normal(size=(5, 3, 3))
PIECES[3] = PIECES[3, 0]  # zero area
GEOMETRIES = {
    "point": LightGeometry("point", (0.3, 1.2, -0.4)),
    "spot": LightGeometry("spot", (0.3, 1.2, -0.4), (0.1, -2.0, 0.3), (15.0, 50.0)),
    "sharp": LightGeometry("spot", (0.3, 1.2, -0.4), (0.0, -1.0, 0.0), (30.0, 30.0)),
    "directional": LightGeometry("directional", direction=(1.0, -2.0, 0.5)),
    "rectangle": LightGeometry("rectangle", (0.0, 1.5, 0.2), (0.2, -1.0, 0.4), rotation=35.0, size=(0.7, 0.3)),
    "one-sided": LightGeometry("mesh", material="Lamp"),
    "two-sided": LightGeometry("mesh", material="Lamp"),
}


def light_of(name):
    triangles = make_emissive_triangles(PIECES, name == "two-sided") if "sided" in name else None
    return prepare_local_lights(GEOMETRIES[name], triangles)


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def sample_numpy(name, light, strata, k, shift, p):
    """Direction and w, by the formulas in the module."""
    geometry = GEOMETRIES[name]
    axis = unit(geometry.direction)
    if geometry.kind == "directional":
        return -axis, 1.0
    if geometry.kind in ("point", "spot"):
        away = np.array(geometry.position) - p
        inner, outer = np.cos(np.radians(geometry.cone))
        falloff = 1.0
        if geometry.kind == "spot":
            falloff = np.clip((-unit(away) @ axis - outer) / max(inner - outer, 1e-3), 0, 1) ** 2
        return unit(away), falloff / (away @ away)
    u, v = strata.corner[k] + strata.size * ((np.asarray(strata.uv[k], float) + shift) % 1)
    if geometry.kind == "rectangle":
        corner, (e, f) = rectangle(geometry)
        position, normal, area = corner + u * e + v * f, np.cross(e, f), np.linalg.norm(np.cross(e, f))
    else:
        pieces = np.concatenate([light.corner[:, None], light.corner[:, None] + light.edges], axis=1).astype(float)
        areas = np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1) / 2
        area, upto = areas.sum(), np.cumsum(areas) / areas.sum()
        piece = int(np.searchsorted(upto, u, side="right"))
        a, b, c = pieces[piece]
        root = np.sqrt((u - upto[piece] + areas[piece] / area) / (areas[piece] / area))
        position, normal = a + root * (1 - v) * (b - a) + root * v * (c - a), np.cross(b - a, c - a)
    away = position - p
    cosine = -unit(away) @ unit(normal)
    cosine = abs(cosine) if name == "two-sided" else max(cosine, 0)
    patch = area / len(strata.uv)
    return unit(away), patch * cosine / max(away @ away, patch / np.pi)


@pytest.mark.parametrize("name", GEOMETRIES)
def test_samples_equal_numpy(name):
    light = light_of(name)
    strata = make_light_strata(light, 64)
    weights = []
    for number in range(12):
        p = RNG.normal(size=3).astype(np.float32)
        shift = cranley_patterson_offset(strata, number)
        for k in range(len(strata.uv)):
            x, y, z, _, weight, *_ = light_sample(light, strata, k, *shift, *p)
            direction, expected = sample_numpy(name, light, strata, k, shift, p.astype(float))
            np.testing.assert_allclose((x, y, z), direction, atol=2e-4)
            np.testing.assert_allclose(weight, expected, rtol=2e-2 if name == "sharp" else 2e-3, atol=2e-4)
            weights.append(expected)
    assert max(weights) > 0


def polygon_irradiance(corners, p, normal):
    """E under a polygon of unit radiance, all of it above the horizon (Lambert 1760)."""
    towards = (corners - p) / np.linalg.norm(corners - p, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(towards, np.roll(towards, -1, axis=0), strict=True):
        total += np.arccos(a @ b) * unit(np.cross(a, b)) @ normal
    return abs(total) / 2


@pytest.mark.parametrize("rotation", [0.0, 35.0])
@pytest.mark.parametrize("direction", [(0.0, -1.0, 0.0), (0.3, -1.0, -0.2)])
def test_a_rectangle_equals_lamberts_formula(direction, rotation):
    geometry = LightGeometry("rectangle", (0.1, 1.1, 0.0), direction, rotation=rotation, size=(0.8, 0.5))
    corner, (e, f) = rectangle(geometry)
    points = RNG.uniform([-0.5, 0, -0.5], [0.5, 0.3, 0.5], (200, 3)).astype(np.float32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (200, 1))
    light, visible = prepare_local_lights(geometry), np.full((200, 8), 255, np.uint8)
    actual = compute_irradiance(light, make_light_strata(light, 64), make_surface_points(points, normals), visible)
    expected = [
        polygon_irradiance(np.array([corner, corner + e, corner + e + f, corner + f]), p, np.array([0, 1, 0]))
        for p in points.astype(float)
    ]
    np.testing.assert_allclose(actual, expected, rtol=0.05)
    np.testing.assert_allclose(actual.mean(), np.mean(expected), rtol=1e-3)


def test_an_unrotated_rectangle_is_upright_and_rotates_about_its_direction():
    corner, edges = rectangle(LightGeometry("rectangle", (1, 2, 3), (0, 0, -2), size=(4, 1)))
    np.testing.assert_allclose(edges, [[-4, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(corner + edges.sum(axis=0) / 2, [1, 2, 3])
    _, rotated = rectangle(LightGeometry("rectangle", (1, 2, 3), (0, 0, -2), rotation=90.0, size=(4, 1)))
    np.testing.assert_allclose(np.cross(*rotated), np.cross(*edges), atol=1e-12)
    np.testing.assert_allclose(rotated[0], [0, 4, 0], atol=1e-12)
    _, lying = rectangle(LightGeometry("rectangle", (0, 2, 0), (0, -1, 0), size=(2, 1)))
    np.testing.assert_allclose(lying[1], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(np.cross(*lying), [0, -2, 0], atol=1e-12)


def test_two_triangles_emit_like_their_rectangle():
    geometry = GEOMETRIES["rectangle"]
    corner, (e, f) = rectangle(geometry)
    a, b, c, d = corner, corner + e, corner + e + f, corner + f
    triangles = np.array([[a, b, c], [a, c, d]], np.float32)
    points = RNG.uniform([-1, -0.5, -1], [1, 0.5, 1], (400, 3)).astype(np.float32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (400, 1))
    at, visible = make_surface_points(points, normals), np.full((400, 32), 255, np.uint8)
    of_triangles, of_rectangle = (
        prepare_local_lights(geometry),
        prepare_local_lights(GEOMETRIES["one-sided"], make_emissive_triangles(triangles, False)),
    )
    as_one, as_two = (
        compute_irradiance(light, make_light_strata(light, 64), at, visible) for light in (of_triangles, of_rectangle)
    )
    np.testing.assert_allclose(as_two, as_one, rtol=0.05)
    np.testing.assert_allclose(as_two.mean(), as_one.mean(), rtol=2e-3)


@pytest.mark.parametrize("corners", [np.zeros((0, 3, 3)), np.ones((2, 3, 3)), np.zeros((1, 3, 3))])
def test_emitter_without_area_gives_no_light(corners):
    light = prepare_local_lights(GEOMETRIES["one-sided"], make_emissive_triangles(corners, True))
    strata = make_light_strata(light, 64)
    up = np.array([[0, 1, 0]], np.float32)
    visible = np.full((1, 32), 255, np.uint8)
    assert compute_irradiance(light, strata, make_surface_points(0 * up, up), visible) == 0


def test_light_that_touches_a_surface_is_finite():
    up = np.array([[0, 1, 0]], np.float32)
    for geometry in (LightGeometry("point"), LightGeometry("rectangle", (0, 0, 0), (0, 1, 0), size=(1e-4, 1e4))):
        light, visible = prepare_local_lights(geometry), np.full((1, 32), 255, np.uint8)
        actual = compute_irradiance(light, make_light_strata(light, 64), make_surface_points(0 * up, up), visible)
        assert np.isfinite(actual).all()
