"""Gather rays that are traced anew are given up where nobody wants them any more, and go on from there."""

import numpy as np
import pytest

from relume.core.errors import CancelledError
from relume.views import map_override_store
from relume.views.map_override_store import PartialHits

NUM, RAYS, STEP = 50, 3, 8


@pytest.fixture
def begun(monkeypatch):
    monkeypatch.setattr(map_override_store, "_SAMPLES_PER_STEP", STEP)
    return PartialHits.empty(NUM, RAYS)


class Linked:
    """The cells of a sample are its number, and those after it; says which samples were traced."""

    def __init__(self):
        self.rows = []

    def __call__(self, rows):
        self.rows.extend(rows.tolist())
        return (rows[:, None] + np.arange(RAYS)).astype(np.uint16)


def test_all_are_traced_once(begun):
    linked = Linked()
    for _ in range(2):
        begun.trace(linked, lambda: False)
    assert sorted(linked.rows) == list(range(NUM))
    np.testing.assert_array_equal(begun.patch, np.arange(NUM)[:, None] + np.arange(RAYS))


@pytest.mark.parametrize("num_threads", ["1", "2"])
def test_given_up_they_go_on_from_there(begun, monkeypatch, num_threads):
    monkeypatch.setenv("RELUME_THREADS", num_threads)
    linked = Linked()
    with pytest.raises(CancelledError):
        begun.trace(linked, lambda: len(linked.rows) >= 2 * STEP)
    traced = list(linked.rows)
    assert 2 * STEP <= len(traced) <= 3 * STEP  # two threads may each be at one when it is said
    begun.trace(linked, lambda: False)
    assert sorted(linked.rows) == list(range(NUM))
    np.testing.assert_array_equal(begun.patch, np.arange(NUM)[:, None] + np.arange(RAYS))


def test_a_step_that_fails_is_traced_again(begun):
    def failing(rows):
        raise ValueError(f"no ray leaves {rows[0]}")

    with pytest.raises(ValueError, match="no ray leaves"):
        begun.trace(failing, lambda: False)
    assert not begun.steps.done.any()
    begun.trace(Linked(), lambda: False)
    assert begun.steps.done.all()
