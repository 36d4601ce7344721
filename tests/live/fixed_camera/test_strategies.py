"""The table of strategies, and its documentation."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.strategies.strategy import Urgency
from relume.live.fixed_camera.strategies.table import STRATEGIES

DOCUMENT = Path(__file__).parents[3] / "docs" / "frame-terms.md"


def test_strategies_that_update_frames_are_ordered_by_fidelity():
    *updating, last = STRATEGIES
    assert all(first.fidelity >= second.fidelity for first, second in pairwise(updating))
    assert last.name == "shade"  # what no other strategy reaches


def test_every_urgency_has_a_job():
    assert {urgency for strategy in STRATEGIES for urgency in strategy.jobs} == set(Urgency)


def test_the_terms_of_a_frame_name_the_strategies_in_order():
    (table,) = re.findall(r"\| strategy \|.*?\n\n", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    names = re.findall(r"(?m)^\| (\w[^|]*?) \|", table)[1:]
    assert names == [strategy.name for strategy in STRATEGIES]


def test_fidelities_are_ordered_words():
    words = ["preview", "approximate", "incremental", "near_exact", "exact"]
    assert [json.loads(json.dumps(fidelity)) for fidelity in sorted(set(Fidelity))] == words
    assert Fidelity.PREVIEW < Fidelity.APPROXIMATE <= Fidelity.APPROXIMATE < Fidelity.EXACT
    assert max(Fidelity.EXACT, Fidelity.NEAR_EXACT) is Fidelity.EXACT
