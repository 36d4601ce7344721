"""Planned disk space: near the real size of a bake, and less than the upper bound of scenes with glass."""

from __future__ import annotations

import shutil
from collections import namedtuple
from dataclasses import replace

import numpy as np
import pytest
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.core import cache as memories
from relume.core.cache import Cache
from relume.core.errors import DiskBudgetError, DiskFullError
from relume.core.folder_size import folder_bytes
from relume.methods import disk
from relume.methods.disk import SMALL_BYTES, estimate_disk
from relume.methods.registry import METHODS
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Glass, Material
from relume.store.bake_protocol import Recipe
from relume.store.disk_space import scratch_file
from relume.store.run_bake import bake_in_process
from relume.store.writer import create_store
from relume_worker.budget import check_budget

__all__ = ["unmeasured"]  # a fixture

Usage = namedtuple("Usage", "total used free")


def glasses():
    """A ball and a sheet of tinted glass over a floor."""
    floor = quad("floor", [[-3, -1, 3], [3, -1, 3], [3, -1, -3], [-3, -1, -3]], 0)
    pane = quad("pane", [[0.1, -0.5, 0], [1.3, -0.5, 0], [1.3, 0.7, 0], [0.1, 0.7, 0]], 2)
    clear = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.1, "f0": [0.04] * 3}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},)),
        Material("Ball", (clear,), glass=Glass(thickness=0.8, absorbed=(2.0, 0.2, 0.2))),
        Material("Pane", (clear,), glass=Glass(tint=(0.4, 0.9, 0.6))),
    ]
    camera = make_camera("front", (0, 0.4, 4), (0, 0, 0), 0.6)
    ball = sphere("ball", [-0.7, -0.3, 0], 0.6, 1, num_rings=24)
    return make_tiny_scene(floor, ball, pane, camera=camera, environment=studio(), materials=materials)


@pytest.fixture(autouse=True)
def no_cached_trials(monkeypatch):
    monkeypatch.setattr(memories._AssetCache, "cache", Cache(1 << 20))


def planned(scene, recipe):
    plan = METHODS[recipe.method].plan(scene, recipe)
    estimate = estimate_disk(METHODS[recipe.method], scene, recipe, plan)
    return replace(plan, disk_bytes=estimate.store, scratch_bytes=estimate.scratch)


@pytest.mark.parametrize("make", [glasses, lambda: cornell_box("sky")], ids=["glass", "box"])
@pytest.mark.parametrize(
    "recipe",
    [
        Recipe("direct", ("front",), (240, 180), 300),
        Recipe("direct", ("front",), (200, 320), 1500),
        pytest.param(Recipe("gather", ("front",), (128, 96), 100), marks=pytest.mark.slow),
    ],
    ids=["direct", "many lights", "gather"],
)
def test_fixed_views_take_between_a_third_and_all_of_their_plan(make, recipe, tmp_path):
    scene = make()
    plan, taken = (
        planned(scene, recipe),
        folder_bytes(bake_in_process(METHODS[recipe.method], scene, recipe, tmp_path / "s")),
    )
    assert plan.store_bytes > SMALL_BYTES
    assert taken <= plan.planned_bytes <= 3 * taken


@pytest.mark.slow
@pytest.mark.parametrize("make", [glasses, lambda: cornell_box("sky")], ids=["glass", "box"])
def test_free_camera_probes_take_between_a_third_and_all_of_their_plan(make, tmp_path, unmeasured):
    scene, recipe = make(), Recipe("probes", ("front",), (64, 48), 300, num_probes=30_000)
    plan, taken = (
        planned(scene, recipe),
        folder_bytes(bake_in_process(METHODS["probes"], scene, recipe, tmp_path / "s")),
    )
    assert taken <= plan.planned_bytes <= 3 * taken


def test_a_glass_scene_is_baked_although_its_bound_does_not_fit(tmp_path, monkeypatch):
    recipe = Recipe("gather", ("front",), (160, 120), 60)
    plan = planned(glasses(), recipe)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(1 << 40, 0, 371_000_000))
    assert plan.store_bytes > 371_000_000
    check_budget(plan, tmp_path, 0)
    with pytest.raises(DiskBudgetError):
        check_budget(replace(plan, disk_bytes=0), tmp_path, 0)


def test_a_repeated_plan_runs_no_trials(monkeypatch):
    scene, recipe = glasses(), Recipe("direct", ("front",), (240, 180), 300)
    first = planned(scene, recipe)
    monkeypatch.setattr(disk, "bake_in_process", lambda *_: pytest.fail("baked again"))
    assert planned(scene, recipe) == first
    larger = planned(scene, replace(recipe, size=(480, 360), num_lights=2000))
    assert larger.planned_bytes > 3 * first.planned_bytes


def test_bounds_are_plans_if_they_are_small_or_trials_fail(monkeypatch):
    scene, small = glasses(), Recipe("direct", ("front",), (64, 48), 100)
    monkeypatch.setattr(disk, "bake_in_process", lambda *_: pytest.fail("tried"))
    assert planned(scene, small).planned_bytes == METHODS["direct"].plan(scene, small).store_bytes

    def disk_full(*_):
        raise OSError("no room")

    monkeypatch.setattr(disk, "bake_in_process", disk_full)
    large = replace(small, size=(240, 180))
    assert planned(scene, large).planned_bytes == METHODS["direct"].plan(scene, large).store_bytes


def test_a_store_stops_growing_before_the_disk_is_full(tmp_path, monkeypatch):
    """For arrays and for files of tasks, whatever was planned."""
    store, file = create_store(tmp_path / "s.zarr", {}), scratch_file(tmp_path)
    rows = np.zeros((1 << 18, 8), np.uint8)
    store.write_whole("some", rows)
    file.write(rows)
    before = folder_bytes(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(1 << 40, 1 << 40, 1 << 20))
    with pytest.raises(DiskFullError):
        store.write_whole("more", rows)
    with pytest.raises(DiskFullError):
        file.write(rows)
    monkeypatch.undo()
    assert folder_bytes(tmp_path) < before + (1 << 16)
    file.close()
