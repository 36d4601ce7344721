"""Persistent and transient values share one budget, and their owners are reported."""

from __future__ import annotations

import re
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import relume
from relume.core.cache import TRANSIENT_BUDGET_DIVISOR, Cache, CacheOwner

BUDGET = 8_000
SHARE = BUDGET // TRANSIENT_BUDGET_DIVISOR


@dataclass(frozen=True)
class Block:
    num_bytes: int


def put(memory, key, num_bytes):
    return memory.get(key, Block, num_bytes, lambda: Block(num_bytes))


def is_there(memory, key):
    """Look up without making the value persistent."""
    return memory.transient.get_cached(key, Block) is not None


def test_transient_values_are_evicted_first():
    memory = Cache(BUDGET)
    put(memory, "oldest", 4_000)
    put(memory.transient, "passing", 3_000)
    put(memory, "new", 2_000)
    assert [is_there(memory, key) for key in ("oldest", "passing", "new")] == [True, False, True]
    assert memory.used_bytes == 6_000


def test_transient_values_take_a_bounded_part_of_the_budget():
    memory = Cache(BUDGET)
    for number in range(8):
        put(memory, number, 1_000)
    for number in range(50):
        put(memory.transient, ("passing", number), SHARE // 2)
    assert [is_there(memory, number) for number in range(8)] == [False] + [True] * 7
    assert [number for number in range(50) if is_there(memory, ("passing", number))] == [48, 49]
    assert memory.used_bytes == BUDGET
    made = put(memory.transient, "large", SHARE + 1)
    assert made.num_bytes == SHARE + 1
    assert not is_there(memory, "large")
    assert [is_there(memory, number) for number in range(8)] == [False] + [True] * 7


def test_free_budget_is_available_to_all():
    memory = Cache(BUDGET)
    put(memory.transient, "large", 7_000)
    assert is_there(memory, "large")
    assert memory.used_bytes == 7_000


def test_a_transient_value_becomes_persistent_on_reuse():
    memory = Cache(BUDGET)
    put(memory.transient, "found", 1_000)
    put(memory.transient, "not found", 1_000)
    assert put(memory, "found", 1_000) is memory.get_cached("found", Block)
    put(memory, "much", 6_500)
    assert [is_there(memory, key) for key in ("found", "not found", "much")] == [True, False, True]


def test_a_value_is_computed_once_and_counted_by_its_size():
    memory, made, start = Cache(BUDGET), [], threading.Barrier(6)
    key = ("/data/bakes/0123456789abcdef.zarr", "lights", 1)

    def make():
        made.append(1)
        return {"nodes": np.zeros(100), "direction": [np.zeros(50)]}

    def want():
        start.wait()
        memory.get_value(key, make)

    threads = [threading.Thread(target=want) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert memory.used_bytes == 8 * 150
    put(memory, ("/data/bakes/fedcba9876543210.zarr/3", "front", 0), 500)
    put(memory, "of nobody", 30)
    assert memory.bytes_by_owner() == {
        CacheOwner("lights", "0123456789abcdef"): 8 * 150,
        CacheOwner("block", "fedcba9876543210"): 500,
        CacheOwner("block", ""): 30,
    }


def test_a_value_larger_than_the_budget_is_returned_and_not_cached():
    memory = Cache(BUDGET)
    put(memory, "other", 5_000)
    assert memory.get_value(("bake", "lights"), lambda: np.ones(BUDGET)).sum() == BUDGET
    assert is_there(memory, "other")
    assert memory.used_bytes == 5_000


def test_a_failed_nested_computation_leaves_no_trace():
    memory = Cache(BUDGET)

    def fails():
        memory.get_value(("bake", "part"), lambda: np.zeros(10))
        raise ValueError("no")

    for _ in range(3):
        with pytest.raises(ValueError, match="no"):
            memory.transient.get("whole", Block, 1_000, fails)
    assert memory.used_bytes == 80


def test_unused_bakes_keep_their_minimum_and_transient_values_are_evicted_first():
    memory = Cache(BUDGET)
    put(memory.transient, ("left", "passing"), 500)
    put(memory, ("left", "old"), 500)
    put(memory, ("used", "old"), 500)
    put(memory, ("left", "new"), 500)
    for bake in ("left", "used"):
        memory.get_value((bake, "lights"), lambda: np.zeros(5))
    memory.trim(700, {"used"})
    assert memory.bytes_by_owner()[CacheOwner("lights", "")] == 40  # those of open bakes
    keys = [("left", "passing"), ("left", "old"), ("used", "old"), ("left", "new")]
    assert [is_there(memory, key) for key in keys] == [False, False, True, True]
    assert memory.used_bytes == 1_040


# Always small: numbers of terms and bands, values computed from code alone, memory-mapped files.
BOUNDED = {
    "assets/btf/direction_rings.py",
    "assets/environments/built_in.py",
    "brdf/albedo.py",
    "brdf/curves.py",
    "brdf/highlight_tables.py",
    "brdf/lobe_sampling.py",
    "brdf/quadrature.py",
    "brdf/symmetry.py",
    "brdf/terms/ggx_multiple.py",
    "core/numba_cache.py",
    "core/source_hash.py",
    "export/export_materials.py",
    "export/principled_material.py",
    "export/surface_values.py",
    "image_io/inverse_tone_mapping.py",
    "image_io/ocio/config.py",
    "images/image_store.py",
    "live/fixed_camera/illumination.py",
    "live/free_camera/basis/highlight_lobes.py",
    "live/free_camera/basis/lobe_shapes.py",
    "live/free_camera/basis/outgoing_coefficients.py",
    "live/free_camera/normal_mapping.py",
    "live/opened/lobe_light.py",
    "look/library/materials.py",
    "look/library/navigation_map.py",
    "math/angle_bands.py",
    "math/daubechies.py",
    "math/direction_grid.py",
    "math/zernike.py",
    "operators/parameter_operator.py",
    "output/material_previews/library_sheet.py",
    "output/material_previews/preview.py",
    "scene/examples/cornell.py",
    "scene/examples/interior.py",
    "scene/examples/still_life/__init__.py",
    "scene/examples/tableau.py",
    "scene_io/surfaces/sheen.py",
    "scene_io/usd/value_types.py",
    "store/run_bake.py",
    "transport/outgoing_patch_light.py",
    "views/sample_seeds.py",
}


def test_no_other_cache_can_grow():
    package = Path(relume.__file__).parent
    caches = re.compile(r"^from functools import .*\b(lru_cache|cache)\b", re.MULTILINE)
    paths = {path for path in package.rglob("*.py") if caches.search(path.read_text("utf-8"))}
    assert {path.relative_to(package).as_posix() for path in paths} == BOUNDED
