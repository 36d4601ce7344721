"""Light on cells while a hand moves: found from a small map, and never taken for what is exact."""

from pathlib import Path

import numpy as np
import pytest
from sessions import BUDGET, look_of, relative_rmse

from relume.memory import Memory
from relume.methods.cells.between import sent_between
from relume.methods.opened import baked_views as transfers
from relume.methods.registry import open_transfer
from relume.picture.light import light_of


@pytest.fixture(scope="module")
def store(gathered):
    return Path(gathered.key)


def light_in(transfer, look):
    return light_of(look, transfer.material_names, has_bounces=True)


def turned(transfer):
    return light_in(transfer, look_of(transfer, lambda document: document["environment"].update(rotation=77.0)))


def seen_of(transfer, light):
    """What cells send in the end, exactly, as others see it in the mean."""
    cells, on_cells, paths = transfer.cells, transfer.reflected._on_cells, light.paths
    reflecting = cells.reflecting(light.reflectances)
    arrived = on_cells.arrived(light, reflecting, is_preview=False)
    return sent_between(cells, reflecting, arrived, paths.first, paths.last).seen(cells)


def blue_wall(document):
    document["materials"]["Red"]["terms"][0]["color"] = [0.1, 0.1, 0.8]


def one_bounce(document):
    document["transport"].update(bounces=1)


def test_what_a_hand_saw_is_not_what_is_exact(store, monkeypatch):
    monkeypatch.setattr(transfers, "PREVIEW_WIDTH", 4)
    expected = open_transfer(store, Memory(BUDGET))
    exact = expected.reflected.under(turned(expected)).even
    again = open_transfer(store, Memory(BUDGET))
    rough = again.reflected.preview_under(turned(again))
    assert np.abs(rough - exact).max() > 1e-3 * exact.max()  # the small map is another one
    np.testing.assert_array_equal(again.reflected.under(turned(again)).even, exact)


@pytest.mark.parametrize("edit", [blue_wall, one_bounce])
def test_a_change_goes_where_highlights_send_it(gathered, edit):
    """Even light of the polished floor would err by 7 and 13 %."""
    before, after = (light_in(gathered, look_of(gathered, *edits)) for edits in ((), (edit,)))
    exact = seen_of(gathered, after) - seen_of(gathered, before)
    assert relative_rmse(gathered.reflected.preview_change(before, after), exact) < 0.02
