"""Figures against their targets: limits, known misses, and the exit status of `relume bench --check`."""

from __future__ import annotations

import json
import math
import sys
from types import ModuleType
from typing import Any

import pytest

from relume_bench import pages, registry, table
from relume_bench.check import bounds, judge, misses_target
from relume_bench.figure import Figure
from relume_bench.pages import stored_figures
from relume_bench.targets import TARGETS

ERROR = "relative RMSE"
MISS = {"reason": "hard", "noise": 0.1}


@pytest.mark.parametrize(
    ("target", "unit", "expected"),
    [
        ("≤ 0.5 %", ERROR, (-math.inf, 0.005)),
        ("≤ 2 %", "%", (-math.inf, 2)),
        ("≤ 1e-4", ERROR, (-math.inf, 1e-4)),
        ("≥ 1000", "ratio", (1000, math.inf)),
        ("± 2 %", "%", (-2, 2)),
        ("1 to 3", "of what is taken", (1, 3)),
        ("≤ 1390 MB", "MB", (-math.inf, 1390)),
        ("2.5", "terms", (-math.inf, math.inf)),
        ("", "s", (-math.inf, math.inf)),
    ],
)
def test_bounds_of_a_target_are_in_the_unit_of_the_figure(
    target: str, unit: str, expected: tuple[float, float]
) -> None:
    assert bounds(target, unit) == pytest.approx(expected)


def test_every_target_that_limits_a_figure_is_understood() -> None:
    """Only a paper's own number, to compare with, limits nothing."""
    unlimited = {name for name, target in TARGETS.items() if bounds(target, "") == (-math.inf, math.inf)}
    assert unlimited == {"factorization.phong_terms_per_exponent"}
    assert set(TARGETS) <= set(registry.names())


@pytest.fixture
def stored(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """One figure that meets its target, two that are known to miss it, in both directions."""
    monkeypatch.setattr(
        "relume_bench.check.TARGETS", {"x.met": "≤ 0.5 %", "x.large": "≤ 12", "x.small": "≥ 3", "x.noisy": "≤ 1 %"}
    )
    return {
        "x.met": {"value": 0.004, "standard_error": None},
        "x.large": {"value": 16, "standard_error": None, "known_miss": MISS},
        "x.small": {"value": 2.0, "standard_error": None, "known_miss": MISS},
        "x.noisy": {"value": 0.02, "standard_error": 0.003, "known_miss": {**MISS, "noise": 0}},
    }


@pytest.mark.parametrize(
    ("figure", "is_ok", "text"),
    [
        (Figure("x.met", 0.005, ERROR), True, "yes"),
        (Figure("x.met", 0.00501, ERROR), False, "no"),
        (Figure("x.met", math.nan, ERROR), False, "no"),
        (Figure("x.met", None, ERROR, {"skipped": "no Mitsuba"}), False, "no, not measured: no Mitsuba"),
        (Figure("x.met", None, ERROR, {"failed": "OSError: disk"}), False, "no, not measured: OSError: disk"),
        (Figure("x.other", 1e9, "s"), True, "-"),
        (Figure("x.large", 17.5, ""), True, "known miss: hard"),
        (Figure("x.large", 17.7, ""), False, "no, worse than 16, a known miss: hard"),
        (Figure("x.large", math.nan, ""), False, "no, worse than 16, a known miss: hard"),
        (Figure("x.large", 12, ""), True, "yes; remove its known_miss"),
        (Figure("x.small", 1.81, "ratio"), True, "known miss: hard"),
        (Figure("x.small", 1.79, "ratio"), False, "no, worse than 2, a known miss: hard"),
        (Figure("x.noisy", 0.029, ERROR, {}, 0.004), True, "known miss: hard"),  # 2 √(0.003² + 0.004²) = 0.01
        (Figure("x.noisy", 0.031, ERROR, {}, 0.004), False, "no, worse than 0.02, a known miss: hard"),
    ],
    ids=str,
)
def test_a_figure_is_judged_by_its_target_and_its_known_miss(
    stored: dict[str, Any], figure: Figure, is_ok: bool, text: str
) -> None:
    assert judge(figure, stored) == (is_ok, text)


def test_missed_targets_of_the_pages_are_listed_with_their_reason() -> None:
    """A target is not loosened to be met; a figure that meets it again has no reason to be listed."""
    for name, entry in stored_figures().items():
        is_missed = entry["value"] is not None and misses_target(name, entry["value"], entry["unit"])
        assert is_missed == ("known_miss" in entry), name
        if is_missed:
            assert entry["known_miss"]["reason"]
            assert 0 <= entry["known_miss"]["noise"] <= 0.2


def test_reasons_survive_a_new_measurement() -> None:
    (entry,) = table.merge([{"name": "x", "value": 1, "known_miss": MISS}], [{"name": "x", "value": 2}])
    assert entry == {"name": "x", "value": 2, "known_miss": MISS}


def test_quick_figures_are_accuracy_and_all_have_been_stored() -> None:
    quick = [name for group in registry.GROUPS if group.is_quick for name in group.names]
    assert {pages.find_document(name) for name in quick} == {"accuracy"}
    assert set(quick) <= set(stored_figures())
    assert all(any(name in TARGETS for name in group.names) for group in registry.GROUPS if group.is_quick)


def make_group(monkeypatch: pytest.MonkeyPatch, *figures: Figure, is_quick: bool = True) -> registry.Group:
    """A group with given figures."""
    name = f"measured_{figures[0].name.replace('.', '_')}"
    module = ModuleType(name)
    module.measure = lambda tiny: list(figures)  # type: ignore[attr-defined]
    monkeypatch.setattr(registry, "measured_code", lambda module: "0" * 16)
    monkeypatch.setitem(sys.modules, name, module)
    return registry.Group(name, tuple(figure.name for figure in figures), is_quick)


def test_a_figure_past_its_target_fails_the_check_and_is_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = make_group(monkeypatch, Figure("accuracy.lambert", 0.004, ERROR, {}, 0.0001))
    bad = make_group(monkeypatch, Figure("accuracy.cook_torrance_0.2", 0.0081, ERROR, {}, 0.0001), is_quick=False)
    monkeypatch.setattr(registry, "GROUPS", (good, bad))
    assert registry.run("", as_json=False, check=True) == 1
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split() == ["name", "value", "target", "ok"]
    assert [row.split() for row in rows] == [
        ["accuracy.lambert", "0.40", "±", "0.01", "%", "≤", "0.5", "%", "yes"],
        ["accuracy.cook_torrance_0.2", "0.81", "±", "0.01", "%", "≤", "0.8", "%", "no"],
    ]
    assert registry.run("", as_json=False, check=True, quick=True) == 0
    assert registry.run("accuracy.cook", as_json=False) == 0
    assert registry.run("accuracy.cook", as_json=False, check=True, quick=True) == 1  # nothing was measured
    capsys.readouterr()
    assert registry.run("accuracy.lambert", as_json=True, check=True) == 0
    assert json.loads(capsys.readouterr().out)[0]["name"] == "accuracy.lambert"
