"""Check figures against their targets: `relume bench --check`.

A target is missed knowingly if the figure's entry in docs/accuracy.json or docs/performance.json says why:

    "known_miss": {"reason": "…", "noise": 0.02}

Then the figure fails only if it is worse than the stored value by more than its noise.
"""

from __future__ import annotations

import math
import re
from dataclasses import asdict
from typing import Any, NamedTuple

from relume_bench.figure import Figure
from relume_bench.pages import value_text
from relume_bench.targets import TARGETS

_FRACTIONS = ("relative RMSE", "relative RMS", "share")  # their targets are in percent
HEAD = f"{'name':<38} {'value':<24} {'target':<10} ok"


class Verdict(NamedTuple):
    """A figure against its target. text: for people."""

    is_ok: bool
    text: str


def bounds(target: str, unit: str) -> tuple[float, float]:
    """Smallest and largest allowed value of a figure; infinite without a limit.

    Args:
        target: "≤ 0.5 %", "≥ 3", "± 2 %" or "1 to 3"; any other text limits nothing. unit: of the figure.
    """
    numbers = [float(number) for number in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", target)]
    if target.endswith("%") and unit in _FRACTIONS:
        numbers = [number / 100 for number in numbers]
    if target.startswith("≤"):
        return -math.inf, numbers[0]
    if target.startswith("≥"):
        return numbers[0], math.inf
    if target.startswith("±"):
        return -numbers[0], numbers[0]
    return (numbers[0], numbers[1]) if " to " in target else (-math.inf, math.inf)


def misses_target(name: str, value: float, unit: str) -> bool:
    """True if a value is past its target.

    Args:
        name, value, unit: of the figure.
    """
    low, high = bounds(TARGETS.get(name, ""), unit)
    return not low <= value <= high  # NaN is past every target


def judge(figure: Figure, stored: dict[str, dict[str, Any]]) -> Verdict:
    """Compare a figure with its target, and a known miss with its stored value.

    Args:
        figure: just measured. stored: entries of the pages by name.
    """
    if figure.value is None:  # a check that measured nothing proves nothing
        return Verdict(False, f"no, not measured: {figure.context.get('skipped') or figure.context.get('failed')}")
    if figure.name not in TARGETS:
        return Verdict(True, "-")
    entry = stored.get(figure.name, {})
    miss = entry.get("known_miss")
    if not misses_target(figure.name, figure.value, figure.unit):
        return Verdict(True, "yes" if miss is None else "yes; remove its known_miss")
    if miss is None:
        return Verdict(False, "no")
    errors = (figure.standard_error or 0.0, entry["standard_error"] or 0.0)
    noise = abs(entry["value"]) * miss["noise"] + 2 * math.hypot(*errors)
    low, high = bounds(TARGETS[figure.name], figure.unit)
    is_known = min(low, entry["value"] - noise) <= figure.value <= max(high, entry["value"] + noise)
    text = f"known miss: {miss['reason']}"
    return Verdict(is_known, text if is_known else f"no, worse than {entry['value']:.4g}, a {text}")


def line(figure: Figure, verdict: Verdict) -> str:
    """One row of the table of name, value, target and verdict."""
    target = TARGETS.get(figure.name, "-")
    return f"{figure.name:<38} {value_text(asdict(figure)):<24} {target:<10} {verdict.text}"
