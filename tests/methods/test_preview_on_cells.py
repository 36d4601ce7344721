"""Light on cells while a hand moves: found from a small map, and never taken for what is exact."""

from pathlib import Path

import numpy as np
import pytest
from sessions import BUDGET

from relume.look import complete, validate
from relume.memory import Memory
from relume.methods import transfer as transfers
from relume.methods.registry import open_transfer
from relume.picture.light import light_of


@pytest.fixture(scope="module")
def store(gathered):
    return Path(gathered.key)


def turned(transfer):
    document = complete({}, transfer.default_look)
    document["environment"]["rotation"] = 77.0
    return light_of(validate(document, transfer.default_look), transfer.material_names, has_bounces=True)


def test_what_a_hand_saw_is_not_what_is_exact(store, monkeypatch):
    monkeypatch.setattr(transfers, "PREVIEW_WIDTH", 4)
    expected = open_transfer(store, Memory(BUDGET))
    exact = expected.reflected.under(turned(expected)).even
    again = open_transfer(store, Memory(BUDGET))
    rough = again.reflected.preview_under(turned(again))
    assert np.abs(rough - exact).max() > 1e-3 * exact.max()  # the small map is another one
    np.testing.assert_array_equal(again.reflected.under(turned(again)).even, exact)
