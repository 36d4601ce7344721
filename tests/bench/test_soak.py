"""The soak test's verdict distinguishes growth from fluctuation."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from relume_bench.soak.server import Sample
from relume_bench.soak.verdict import trends


def samples(memory: Callable[[float], float], handles: Callable[[float], float], number: int = 60) -> list[Sample]:
    return [Sample(5.0 * k, int(memory(5.0 * k)), 0, int(handles(5.0 * k)), 30, 10**7) for k in range(number)]


def test_warm_up_and_fluctuation_are_flat() -> None:
    measured = samples(lambda s: 2e8 * min(1.0, 0.2 + s / 60) + 1e7 * (s % 20 > 10), lambda s: 40 + s % 3)
    assert [trend.name for trend in trends(measured) if not trend.is_flat] == []


def test_leaks_are_reported() -> None:
    trends_by_name = {trend.name: trend for trend in trends(samples(lambda s: 2e8 + 5e5 * s, lambda s: 40 + s / 4))}
    assert [name for name, trend in trends_by_name.items() if not trend.is_flat] == ["memory MB", "handles"]
    assert trends_by_name["memory MB"].slope_per_hour == pytest.approx(0.5 * 3600)
    assert "GROWS" in trends_by_name["handles"].line()


def test_short_runs_give_no_verdict() -> None:
    with pytest.raises(ValueError, match="run longer"):
        trends(samples(lambda s: 1e8, lambda s: 40, number=10))
