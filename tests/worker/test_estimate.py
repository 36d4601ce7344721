"""How long a bake is said to take before it starts."""

import pytest

from relume.bake import Plan
from worker.estimate import Finished, crowding, seconds_for
from worker.executor import TINY_BAKE_BYTES, TINY_BAKE_RAYS, is_tiny

LARGE = Plan(1000, 20 * TINY_BAKE_RAYS, 1, 1)
SMALL = Plan(1000, TINY_BAKE_RAYS // 2, 1, 1)


def test_few_rays_of_millions_of_triangles_are_no_tiny_bake():
    assert is_tiny(SMALL)
    assert not is_tiny(LARGE)
    assert not is_tiny(Plan(1000, 1000, TINY_BAKE_BYTES + 1, 1))


def test_nothing_is_said_before_anything_was_measured():
    assert seconds_for(LARGE, [], 4) is None
    assert seconds_for(LARGE, [Finished(LARGE, 0.0)], 4) is None


def test_the_same_bake_again_takes_as_long_whatever_share_of_its_plan_was_traced():
    assert seconds_for(LARGE, [Finished(LARGE, 120.0)], 1) == pytest.approx(120.0)
    assert seconds_for(LARGE, [Finished(LARGE, 120.0)], 4) == pytest.approx(30.0)
    assert seconds_for(SMALL, [Finished(SMALL, 2.0)], 4) == pytest.approx(2.0)


def test_a_bake_is_judged_by_its_like_and_by_others_where_there_is_none():
    both = [Finished(LARGE, 40.0), Finished(SMALL, 3.0)]
    assert seconds_for(LARGE, both, 2) == pytest.approx(20.0)
    assert seconds_for(SMALL, both, 2) == pytest.approx(3.0)
    assert seconds_for(SMALL, both[:1], 2) == pytest.approx(20.0 / 40)


def test_larger_bakes_count_for_more():
    double = Plan(1000, 2 * LARGE.num_rays, 1, 1)
    assert seconds_for(LARGE, [Finished(LARGE, 30.0), Finished(double, 30.0)], 1) == pytest.approx(20.0)


def test_a_busy_machine_takes_longer_and_does_not_make_later_bakes_look_slow():
    assert seconds_for(LARGE, [Finished(LARGE, 120.0)], 2, crowded=4.0) == pytest.approx(240.0)
    assert seconds_for(LARGE, [Finished(LARGE, 480.0, crowding=4.0)], 2) == pytest.approx(60.0)


def test_crowding_is_at_least_one_thread_a_core(monkeypatch):
    monkeypatch.setattr("worker.estimate.num_cores", lambda: 2)
    assert [crowding(load) for load in (0.0, 1.9, 5.0)] == [1.0, 1.0, 2.5]
