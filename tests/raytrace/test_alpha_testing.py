"""Alpha-tested and blended surfaces: hits of all kinds of rays, against plain NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy_reference import opacity_at, unit
from tiny_scenes import make_camera, make_surface_points, make_tiny_scene, quad

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.core.errors import ChunkDamagedError
from relume.lights.local_lights import make_light_strata, prepare_local_lights
from relume.look import LightGeometry
from relume.raytrace.alpha_filter import NUM_OFFSETS, STOP_AT_OPAQUE, STOP_AT_PARTIAL
from relume.raytrace.alpha_test import AlphaMasks, check_alpha_masks, collect_alpha_masks
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.local_light_visibility import trace_light_visibility
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.scene.model import Glass, Material, Opacity

WHITE = ({"model": "lambert", "color": [1, 1, 1]},)
MOVED = 0.2
DOWN = np.array([0, 0, -1], np.float32)


def card_before_wall(alpha, cutoff=None, wrap=("repeat", "repeat"), times=1.0):
    """A wall in the plane z = −1 and, in front of it at z = 0, a card from (0, 0) to (1, 1) with an opacity image."""
    card = quad("card", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], 1)
    card = replace(card, uvs=card.uvs * np.float32(times) - np.float32(MOVED if times != 1 else 0))
    wall = quad("wall", [[-2, -2, -1], [3, -2, -1], [3, 3, -1], [-2, 3, -1]], 0)
    materials = [Material("Wall", WHITE), Material("Card", WHITE, opacity=Opacity(alpha, wrap, cutoff))]
    return make_tiny_scene(
        wall, card, camera=make_camera("front", (0.5, 0.5, 2), (0.5, 0.5, 0), 0.6), materials=materials
    )


def random_alpha(seed=3, shape=(5, 7)):
    return np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)


def rays_at(x, y):
    """Origins in front of the card, with directions perpendicular to it."""
    return np.stack([x, y, np.ones_like(x)], axis=1).astype(np.float32)


def card_opacity(opacity, times, x, y):
    """Opacity of the card of `card_before_wall` at its UV coordinates."""
    return opacity_at(opacity.alpha, opacity.wrap, np.stack([x, 1 - y], axis=1) * times - (MOVED if times != 1 else 0))


@pytest.mark.parametrize("wrap", [("repeat", "mirror"), ("clamp", "repeat"), ("mirror", "clamp")])
def test_an_alpha_tested_surface_is_hit_above_its_cutoff(wrap):
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.001, 0.999, (2, 20_000))
    scene = card_before_wall(random_alpha(), 0.4, wrap, times=3.7)
    face = trace_rays(build_scene_buffers(scene).embree, rays_at(x, y), np.tile(DOWN, (len(x), 1))).face
    expected = card_opacity(scene.materials[1].opacity, 3.7, x, y)
    clear = np.abs(expected - 0.4) > 1e-3  # away from rounding at the cutoff
    assert clear.mean() > 0.98
    np.testing.assert_array_equal((face >= 2)[clear], (expected >= 0.4)[clear])
    assert 0.1 < (face >= 2).mean() < 0.9


def test_a_blended_surface_stops_a_uniform_fraction_of_directions():
    rng = np.random.default_rng(2)
    scene = card_before_wall(np.full((1, 1), 77, np.uint8))
    embree = build_scene_buffers(scene).embree
    directions = unit(np.concatenate([rng.uniform(-0.2, 0.2, (4000, 2)), -np.ones((4000, 1))], axis=1))
    fractions = []
    for x, y in ((0.3, 0.3), (0.7, 0.4)):
        start = np.array([[x, y, 1]]) - 0.5 * directions / directions[:, 2:]
        fractions.append(trace_rays(embree, start.astype(np.float32), directions.astype(np.float32)).face >= 2)
    assert fractions[0].mean() == pytest.approx(77 / 255, abs=0.03)
    np.testing.assert_array_equal(fractions[0], fractions[1])


def test_samples_of_a_pixel_are_distributed_by_opacity():
    scene = card_before_wall(np.full((1, 1), 77, np.uint8))
    embree, num = build_scene_buffers(scene).embree, 400
    origins, directions = np.tile([0.4, 0.3, 1], (8 * num, 1)).astype(np.float32), np.tile(DOWN, (8 * num, 1))
    offset = (np.random.default_rng(1).integers(0, NUM_OFFSETS, (num, 1)) + 0.5) / NUM_OFFSETS
    strata = (np.arange(8) + offset) / 8
    stopped = trace_rays(embree, origins, directions, strata.astype(np.float32).ravel()).face.reshape(num, 8) >= 2
    assert np.abs(stopped.mean(axis=1) - 77 / 255).max() < 1 / 8
    assert stopped.mean() == pytest.approx(77 / 255, abs=0.01)
    directions, origins = directions[:num], origins[:num]
    assert (trace_rays(embree, origins, directions, np.full(1, STOP_AT_PARTIAL)).face >= 2).all()
    assert (trace_rays(embree, origins, directions, np.full(1, STOP_AT_OPAQUE)).face < 2).all()


def test_two_blended_surfaces_are_independent_for_any_pair_of_triangles():
    front = quad("front", [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], 0)
    # the other diagonal, so that all four pairs of triangles lie behind one another
    back = quad("back", [[1, 0, -0.2], [1, 1, -0.2], [0, 1, -0.2], [0, 0, -0.2]], 0)
    material = Material("Card", WHITE, opacity=Opacity(np.full((1, 1), 153, np.uint8)))
    scene = make_tiny_scene(
        front, back, camera=make_camera("front", (0.5, 0.5, 2), (0.5, 0.5, 0), 0.4), materials=[material]
    )
    size = (96, 96)
    samples = sample_view(scene, build_scene_buffers(scene), "front", size)
    passed = np.bincount(samples.pixel, samples.weight * (samples.material == BACKGROUND), minlength=96 * 96)
    y, x = np.divmod(np.arange(96 * 96), 96)
    is_inside = (np.abs(x - 47.5) < 20) & (np.abs(y - 47.5) < 20)
    for quarter in ((x > y) & (x + y > 95), (x > y) & (x + y < 95), (x < y) & (x + y > 95), (x < y) & (x + y < 95)):
        assert passed[is_inside & quarter].mean() == pytest.approx(0.4**2, abs=0.03)


def test_light_passes_holes_to_points_and_from_local_lights():
    alpha = random_alpha(4, (6, 6))
    scene = card_before_wall(alpha, 0.5, ("clamp", "clamp"))
    geometry, (x, y) = build_scene_buffers(scene), np.random.default_rng(5).uniform(0.01, 0.99, (2, 3000))
    points = np.stack([x, y, np.full_like(x, -0.99)], axis=1).astype(np.float32)
    up = np.tile(-DOWN, (len(x), 1))
    expected = card_opacity(scene.materials[1].opacity, 1.0, x, y)
    clear = np.abs(expected - 0.5) > 1e-3
    visible = trace_visibility(geometry.embree, points, up, -DOWN[None]).visible[:, 0] & 1
    np.testing.assert_array_equal(visible[clear] == 1, (expected < 0.5)[clear])
    directional = prepare_local_lights(LightGeometry("directional", direction=(0.0, 0.0, -1.0)))
    light_visibility = trace_light_visibility(
        geometry.embree,
        directional,
        make_light_strata(directional, 1),
        make_surface_points(points, up),
    )
    np.testing.assert_array_equal((light_visibility[:, 0] & 1)[clear] == 1, (expected < 0.5)[clear])


@pytest.mark.parametrize("coverage", [0.1, 0.25, 0.6, 0.95])
def test_pixels_show_a_blended_surface_by_its_opacity(coverage):
    scene = card_before_wall(np.full((1, 1), round(255 * coverage), np.uint8))
    samples = sample_view(scene, build_scene_buffers(scene), "front", (64, 48))
    of_card = np.bincount(samples.pixel, samples.weight * (samples.material == 1), minlength=64 * 48).reshape(48, 64)
    inside = of_card[16:32, 24:40]
    y, x = np.mgrid[:16, :16]
    in_one_triangle = x + y != 15
    assert np.abs(inside - coverage)[in_one_triangle].max() <= 1 / 8
    assert inside.mean() == pytest.approx(coverage, abs=0.01)  # multiples of 1/8 are dithered
    np.testing.assert_allclose(np.bincount(samples.pixel, samples.weight), 1, atol=1e-6)


def test_edges_of_holes_are_antialiased():
    alpha = np.zeros((64, 64), np.uint8)
    y, x = np.mgrid[:64, :64]
    alpha[np.hypot(x - 31.5, y - 31.5) < 24] = 255
    scene = card_before_wall(alpha, 0.5, ("clamp", "clamp"))
    scene = replace(scene, meshes=scene.meshes[1:])
    samples = sample_view(scene, build_scene_buffers(scene), "front", (96, 72))
    hidden = np.bincount(samples.pixel, samples.weight * (samples.material != BACKGROUND), minlength=96 * 72)
    between = (hidden > 0.05) & (hidden < 0.95)
    radius = 24 / 64 / (2 * 2 * np.tan(0.3)) * 72  # pixels
    assert 0.8 * 2 * np.pi * radius < between.sum() < 2.5 * 2 * np.pi * radius
    assert hidden.sum() == pytest.approx(np.pi * radius**2, rel=0.02)


def test_opaque_scenes_have_no_overhead():
    scene = card_before_wall(np.zeros((1, 1), np.uint8))
    whole = [Material(material.name, material.terms) for material in scene.materials]
    assert collect_alpha_masks(whole) is None
    assert build_scene_buffers(replace(scene, materials=tuple(whole))).embree.alpha_test is None


@pytest.mark.parametrize(
    "damage",
    [
        {"images": np.array([[0, 6, 7, 0, 0]], np.int64)},
        {"images": np.array([[-1, 5, 7, 0, 0]], np.int64)},
        {"images": np.array([[0, 5, 7, 0, 3]], np.int64)},
        {"images": np.array([[0, 1 << 40, 1 << 40, 0, 0]], np.int64)},
        {"images": np.zeros((0, 5), np.int64)},
        {"rules": np.zeros((2, 6), np.float32)},
        {"rules": np.zeros((1, 6), np.float64)},
        {"material_rule": np.array([-1, 1], np.int32)},
        {"material_rule": np.array([-2, 0], np.int32)},
        {"material_rule": np.array([0], np.int32)},
        {"texels": np.zeros(34, np.uint8)},
    ],
)
def test_damaged_opacity_of_a_store_is_rejected(damage):
    cutouts = collect_alpha_masks([Material("Wall", WHITE), Material("Card", WHITE, opacity=Opacity(random_alpha()))])
    assert isinstance(cutouts, AlphaMasks)
    check_alpha_masks(cutouts._asdict(), 2)
    with pytest.raises(ChunkDamagedError):
        check_alpha_masks({**cutouts._asdict(), **damage}, 2)


@pytest.mark.parametrize(
    ("opacity", "is_glass", "blends"),
    [
        (Opacity(random_alpha()), False, True),
        (Opacity(random_alpha(), cutoff=0.5), False, False),
        (Opacity(random_alpha()), True, True),
        (None, True, False),
    ],
)
def test_only_blended_surfaces_need_more_rays_per_pixel(opacity, is_glass, blends):
    scene = card_before_wall(random_alpha())
    card = replace(scene.materials[1], opacity=opacity, glass=Glass() if is_glass else None)
    holes = build_scene_buffers(replace(scene, materials=(scene.materials[0], card))).embree.alpha_test
    assert holes is not None
    assert holes.blends == blends
