"""Tracing of new gather rays stops when they are no longer needed, and resumes later."""

import numpy as np
import pytest

from relume.core.errors import CancelledError
from relume.views import map_override_store
from relume.views.map_override_store import PartialHits

NUM, RAYS, STEP = 50, 3, 8


@pytest.fixture
def partial(monkeypatch):
    monkeypatch.setattr(map_override_store, "_SAMPLES_PER_STEP", STEP)
    return PartialHits.empty(NUM, RAYS)


class Linked:
    """Gather hits of a sample: its index and the following ones; records the traced samples."""

    def __init__(self):
        self.rows = []

    def __call__(self, rows):
        self.rows.extend(rows.tolist())
        return (rows[:, None] + np.arange(RAYS)).astype(np.uint16)


def test_all_samples_are_traced_once(partial):
    linked = Linked()
    for _ in range(2):
        partial.trace(linked, lambda: False)
    assert sorted(linked.rows) == list(range(NUM))
    np.testing.assert_array_equal(partial.patch, np.arange(NUM)[:, None] + np.arange(RAYS))


@pytest.mark.parametrize("num_threads", ["1", "2"])
def test_cancelled_tracing_resumes(partial, monkeypatch, num_threads):
    monkeypatch.setenv("RELUME_THREADS", num_threads)
    linked = Linked()
    with pytest.raises(CancelledError):
        partial.trace(linked, lambda: len(linked.rows) >= 2 * STEP)
    traced = list(linked.rows)
    assert 2 * STEP <= len(traced) <= 3 * STEP  # two threads may each be in a step at cancellation
    partial.trace(linked, lambda: False)
    assert sorted(linked.rows) == list(range(NUM))
    np.testing.assert_array_equal(partial.patch, np.arange(NUM)[:, None] + np.arange(RAYS))


def test_a_step_that_fails_is_traced_again(partial):
    def failing(rows):
        raise ValueError(f"no ray leaves {rows[0]}")

    with pytest.raises(ValueError, match="no ray leaves"):
        partial.trace(failing, lambda: False)
    assert not partial.steps.done.any()
    partial.trace(Linked(), lambda: False)
    assert partial.steps.done.all()
