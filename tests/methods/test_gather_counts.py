"""Requested numbers of patches and gather rays: stored, counted in the plan, and bounded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from session_edits import relative_rmse
from shared_bakes import unmeasured
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.cache import Cache
from relume.core.errors import PlanError
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.store.bake_protocol import Recipe
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_worker.status import recipe_from_json, recipe_json

__all__ = ["unmeasured"]  # a fixture

SIZE = (24, 18)
GATHERING = ["gather", "probes"]


@pytest.fixture(scope="module")
def corner():
    parts = [
        quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0),
        quad("wall", [[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], 1),
    ]
    return make_tiny_scene(*parts, camera=make_camera("front", [0, 0.7, 2.4], [0, 0.5, -0.5], 0.5))


def recipe_of(method: str, **requested: int) -> Recipe:
    return Recipe(method, ("front",), SIZE, 60, num_probes=300, **requested)


@pytest.mark.parametrize("method", GATHERING)
def test_a_store_has_the_requested_counts(corner, tmp_path: Path, method: str) -> None:
    recipe = recipe_of(method, num_patches=200, gather_rays=100)
    path = bake_in_process(METHODS[method], corner, recipe, tmp_path / "s.zarr")
    store = open_store(path)
    hits = "views/0/gather_hits" if method == "gather" else "probes/gather_hits"
    assert store.shape(hits)[1] == 100
    assert 150 <= store.shape("patches/material")[0] <= 200
    if method == "gather":
        usual = bake_in_process(METHODS[method], corner, recipe_of(method), tmp_path / "t.zarr")
        few, plenty = (open_transfer(store_path, Cache(1 << 30)) for store_path in (path, usual))
        look = validate({"transport": {"show": "indirect"}}, few.default_look)
        assert relative_rmse(*(render_image(transfer, "front", look) for transfer in (few, plenty))) < 0.08


@pytest.mark.parametrize("method", GATHERING)
def test_the_plan_uses_the_requested_counts(corner, method: str) -> None:
    plan, recipe = METHODS[method].plan, recipe_of(method, num_patches=1000, gather_rays=100)
    usual = plan(corner, recipe)
    more_rays = plan(corner, replace(recipe, gather_rays=1100))
    assert more_rays.num_rays == usual.num_rays + 1000 * usual.num_view_samples
    assert more_rays.store_bytes == usual.store_bytes + 2 * 1000 * usual.num_view_samples
    assert more_rays.peak_bytes > usual.peak_bytes
    more_samples = plan(corner, replace(recipe, num_patches=3000))
    assert more_samples.num_rays == usual.num_rays + 2000 * 4 * (55 + recipe.num_lights)
    assert more_samples.store_bytes > usual.store_bytes + 2000 * 4 * 2 * 55
    assert more_samples.peak_bytes > usual.peak_bytes


@pytest.mark.parametrize(
    ("method", "requested", "message"),
    [
        *((method, {"num_patches": 63}, "give 64 to") for method in GATHERING),
        *((method, {"gather_rays": bad}, "give 16 to 4,096") for method in GATHERING for bad in (0, 15, 4097, -1)),
        ("gather", {"num_patches": 65_536}, "65,535"),
        ("probes", {"num_patches": 32_769}, "32,768"),
        ("direct", {"num_patches": 1000}, "leave them out"),
        ("direct", {"gather_rays": 100}, "leave them out"),
    ],
)
def test_invalid_counts_of_a_recipe_are_rejected(corner, method: str, requested: dict[str, int], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        METHODS[method].plan(corner, recipe_of(method, **requested))


def test_recipes_survive_serialization_and_older_ones_are_read() -> None:
    recipe = recipe_of("gather", num_patches=200, gather_rays=100)
    assert recipe_from_json(recipe_json(recipe)) == recipe
    text = recipe_json(recipe_of("gather")).replace('"gather_rays":null,', "").replace('"num_patches":null,', "")
    assert "gather_rays" not in text
    assert recipe_from_json(text) == recipe_of("gather")
