"""Operators of merged lights: available early, near exact, and replaced by the exact operator.

The bake has 149 large lights, and the merged-light operator divides them too coarsely: larger bakes are more accurate
(`bench/relume_bench/curve_switch.py`).
"""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from numpy.typing import NDArray
from picture_edits import open_exact_picture
from session_edits import make_look, relative_rmse, run_next_job, run_until_exact, task_of

from relume.core.cache import Cache
from relume.core.color import luminance
from relume.lights.light_clusters import F64, cluster_lights, visible_fraction
from relume.lights.spherical_triangles import MergedParts
from relume.live.fixed_camera import operator_budget
from relume.operators.linear_operator import LinearOperator

FLOOR = "/materials/Floor/terms/1/"


def visible_fraction_numpy(visible: NDArray[np.uint8], subset: MergedParts, num_clusters: int) -> F64:
    """Reference of `visible_fraction` for all points in plain NumPy.

    Args:
        visible: bits of all parts. (n, bytes) uint8
        subset: merged triangle and fraction of each light. num_clusters: number of merged triangles, C.
    Returns:
        (n, C)
    """
    bits = np.unpackbits(visible, axis=1, count=len(subset.group), bitorder="little")
    fractions = np.zeros((len(subset.group), num_clusters))
    fractions[np.arange(len(subset.group)), subset.group] = subset.fraction
    return np.asarray(bits @ fractions)


def roughened(roughness):
    def change(document):
        document["materials"]["Floor"]["terms"][1].setdefault("params", {})["roughness"] = roughness

    return change


def bent(value):
    def change(document):
        curve = {"points": [[0, value], [20, 0.5], [90, 0]]}
        document["materials"]["Floor"]["terms"][1]["curves"] = {"theta_h": curve}

    return change


@pytest.fixture
def wait_limit(monkeypatch):
    """None: no operator is built fast enough."""
    monkeypatch.setattr(operator_budget, "_SLOW_PAIRS_PER_THREAD", 0)
    monkeypatch.setattr(operator_budget, "_MIN_LIGHTS_TO_MERGE", 0)


def test_merged_lights_preserve_light_and_directions(transfer):
    lights = transfer.lights
    merged = cluster_lights(lights, transfer.tiles, 100)
    assert 90 < merged.num_lights <= 100
    shares = np.bincount(merged.parts.group, merged.parts.fraction, merged.num_lights)
    np.testing.assert_allclose(shares[luminance(merged.irradiance) > 0], 1, rtol=1e-5)
    light = luminance(lights.irradiance)[:, None]
    towards = np.zeros((merged.num_lights, 3))
    np.add.at(towards, merged.parts.group, light * lights.direction)
    lit = luminance(merged.irradiance) > 0
    brought = luminance(merged.irradiance)[:, None] * merged.direction  # times a normal: Σ L Ω cos θi
    np.testing.assert_allclose(brought[lit], towards[lit], rtol=1e-4, atol=1e-5 * light.max())


def test_lights_of_a_coarser_subdivision_are_merged(transfer):
    """The minimum is the octants; with as many clusters as lights none are merged."""
    assert cluster_lights(transfer.lights, transfer.tiles, 8).num_lights == 8
    every = cluster_lights(transfer.lights, transfer.tiles, 10**6)
    np.testing.assert_allclose(np.sort(every.irradiance[:, 0]), np.sort(transfer.lights.irradiance[:, 0]), rtol=1e-6)


def test_visible_fractions_equal_those_of_the_merged_lights(transfer):
    merged = cluster_lights(transfer.lights, transfer.tiles, 100)
    visible = transfer.views["front"].receivers(0).visible
    fractions = np.full((merged.num_lights, len(visible)), np.nan, np.float32)
    visible_fraction(visible, *merged.parts, 0, len(visible), fractions)
    np.testing.assert_allclose(fractions.T, visible_fraction_numpy(visible, merged.parts, merged.num_lights), atol=1e-6)


@pytest.mark.parametrize(
    ("pointer", "drags"),
    [("curves/theta_h", [bent(3), bent(5)]), ("params/roughness", [roughened(0.35), roughened(0.25)])],
)
def test_edits_use_the_merged_operator_until_the_exact_one_is_ready(transfer, wait_limit, pointer, drags):
    memory = Cache(1 << 30)
    picture = open_exact_picture(transfer, cache=memory)
    before = picture.image()
    picture.prepare(FLOOR + pointer)
    assert task_of(run_next_job(picture)).form == operator_budget.MERGED_LIGHT
    exact = picture.next_job()
    assert task_of(exact).form == operator_budget.EXACT
    assert not exact.is_refinement
    for change in drags:
        picture.set_look(make_look(transfer, change), active_pointer=FLOOR + pointer)
        assert picture.advance(None).fidelity == "incremental"
        assert picture.next_job().key == exact.key, "the hand does not stop it"
        expected = ref.full_evaluation(transfer, "front", make_look(transfer, change))
        assert relative_rmse(picture.image(), expected) < 0.5 * relative_rmse(before, expected)
    assert memory.get_cached((*task_of(exact).key, "roughly"), LinearOperator).has_merged_lights
    exact.apply(exact.run(lambda fraction: None, lambda: False))
    assert memory.get_cached((*task_of(exact).key, "roughly"), LinearOperator) is None
    assert memory.get_cached(task_of(exact).key, LinearOperator).is_exact
    assert picture.advance(None).exact == (pointer == "curves/theta_h")
    assert relative_rmse(run_until_exact(picture).image(), expected) < 1e-6
    picture.set_look(make_look(transfer), active_pointer=FLOOR + pointer)
    assert relative_rmse(run_until_exact(picture).image(), before) < 1e-6


def test_the_exact_operator_is_built_if_it_is_cached_or_nothing_is_shown(transfer, wait_limit):
    memory = Cache(1 << 30)
    open_exact_picture(transfer, FLOOR + "curves/theta_h", cache=memory)
    again = open_exact_picture(transfer, cache=memory)
    again.prepare(FLOOR + "curves/theta_h")
    assert task_of(again.next_job()).form == operator_budget.EXACT
