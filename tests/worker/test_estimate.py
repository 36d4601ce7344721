"""Estimates of the duration of a bake before it starts."""

from dataclasses import replace

import pytest

from relume.methods.registry import METHODS
from relume.scene.examples.cornell import sunny_environment
from relume.scene.examples.still_life import demo_scene
from relume.scene.examples.still_life.grids import sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Plan, Recipe
from relume_worker.estimate import CompletedBake, crowding, estimate_seconds
from relume_worker.executor import TINY_BAKE_BYTES, TINY_BAKE_RAYS, is_tiny
from relume_worker.presets import PRESETS

LARGE = Plan(1000, 20 * TINY_BAKE_RAYS, 1, 1)
SMALL = Plan(1000, TINY_BAKE_RAYS // 2, 1, 1)


def test_few_rays_in_millions_of_triangles_are_not_a_tiny_bake():
    assert is_tiny(SMALL)
    assert not is_tiny(LARGE)
    assert not is_tiny(Plan(1000, 1000, TINY_BAKE_BYTES + 1, 1))


def test_a_preview_with_indirect_light_waits_behind_no_larger_bake():
    scene, preset = demo_scene(), PRESETS["preview"]
    views = tuple(camera.name for camera in scene.cameras)
    plan = METHODS["gather"].plan(scene, Recipe("gather", views, preset.size, preset.num_lights))
    assert is_tiny(plan)
    assert not is_tiny(replace(plan, work_s=20 * plan.work_s))


def test_no_estimate_without_measurements():
    assert estimate_seconds(LARGE, [], 4) is None
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 0.0)], 4) is None


def test_repeated_bake_has_the_same_estimate_for_any_traced_fraction():
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 120.0)], 1) == pytest.approx(120.0)
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 120.0)], 4) == pytest.approx(30.0)
    assert estimate_seconds(SMALL, [CompletedBake(SMALL, 2.0)], 4) == pytest.approx(2.0)


def test_estimate_uses_similar_bakes_and_others_if_there_are_none():
    completed = [CompletedBake(LARGE, 40.0), CompletedBake(SMALL, 3.0)]
    assert estimate_seconds(LARGE, completed, 2) == pytest.approx(20.0)
    assert estimate_seconds(SMALL, completed, 2) == pytest.approx(3.0)
    assert estimate_seconds(SMALL, completed[:1], 2) == pytest.approx(20.0 / 40)


def test_larger_bakes_have_more_weight():
    double = Plan(1000, 2 * LARGE.num_rays, 1, 1)
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 30.0), CompletedBake(double, 30.0)], 1) == pytest.approx(20.0)


def test_busy_machine_takes_longer_without_slowing_later_estimates():
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 120.0)], 2, load_factor=4.0) == pytest.approx(240.0)
    assert estimate_seconds(LARGE, [CompletedBake(LARGE, 480.0, crowding=4.0)], 2) == pytest.approx(60.0)


def test_load_is_at_least_one_thread_per_core(monkeypatch):
    monkeypatch.setattr("relume_worker.estimate.num_cores", lambda: 2)
    assert [crowding(load) for load in (0.0, 1.9, 5.0)] == [1.0, 1.0, 2.5]


def test_triangles_take_time():
    few, many = (METHODS["probes"].plan(ball(n), Recipe("probes", ("front",), (64, 48), 60)) for n in (4, 64))
    assert few.num_rays == many.num_rays
    assert estimate_seconds(many, [CompletedBake(few, 60.0)], 1) > 60.0


def ball(fineness):
    mesh = sphere(1.0, fineness).mesh("ball", 0)
    material = Material("Clay", ({"model": "lambert", "color": [0.5, 0.5, 0.5]},))
    camera = look_at("front", (0.0, 0.5, 4.0), (0.0, 0.0, 0.0), 0.7)
    return make_scene("ball", [mesh], [material], [camera], sunny_environment())


def test_other_methods_are_scaled_by_their_time_per_ray():
    recipe = Recipe("direct", ("front",), (640, 480), 500)
    direct, surface = (METHODS[name].plan(ball(4), replace(recipe, method=name)) for name in ("direct", "probes"))
    estimate = estimate_seconds(surface, [CompletedBake(direct, 5.0)], 1)
    assert estimate == pytest.approx(5.0 * surface.work_s / direct.work_s)
    assert estimate > 5 * 5.0 * surface.num_rays / direct.num_rays


def test_overhead_of_small_bakes_is_not_a_rate_for_large_ones():
    small, large = replace(LARGE, work_s=25.0), replace(LARGE, work_s=10_000.0)
    assert estimate_seconds(large, [CompletedBake(small, 2500.0)], 1) == pytest.approx(2500.0 + 9975.0)
    assert estimate_seconds(large, [CompletedBake(small, 2500.0)], 2) == pytest.approx(1250.0 + 9975.0 / 2)
    assert estimate_seconds(large, [CompletedBake(small, 12.5)], 1) == pytest.approx(5000.0)
    assert estimate_seconds(replace(LARGE, work_s=200.0), [CompletedBake(small, 2500.0)], 1) == pytest.approx(20_000.0)


def test_plans_with_only_rays_are_used_if_there_are_no_others():
    timed_plan = replace(LARGE, work_s=10.0)
    assert (
        estimate_seconds(
            replace(timed_plan, work_s=50.0), [CompletedBake(timed_plan, 20.0), CompletedBake(LARGE, 900.0)], 1
        )
        == 100.0
    )
    assert estimate_seconds(timed_plan, [CompletedBake(LARGE, 30.0)], 1) == pytest.approx(30.0)
