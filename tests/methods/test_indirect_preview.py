"""Indirect light during edits: computed from a small map, and never used as exact."""

from pathlib import Path

import numpy as np
import pytest
from session_edits import BUDGET, make_look, relative_rmse

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.opened import fixed_views as transfers
from relume.live.opened.openers import open_transfer
from relume.radiosity.solve_bounces import solve_bounces


@pytest.fixture(scope="module")
def store(gathered):
    return Path(gathered.key)


def light_in(transfer, look):
    return illumination_from_look(look, transfer.material_names, has_bounces=True)


def rotated(transfer):
    return light_in(transfer, make_look(transfer, lambda document: document["environment"].update(rotation=77.0)))


def mean_outgoing(transfer, light):
    """Exact mean outgoing radiance of patches after all bounces."""
    patches, on_patches, paths = transfer.patches, transfer.indirect._direct_light, light.paths
    reflecting = patches.reflectance_operator(light.reflectances)
    incident = on_patches.incident_light(light, reflecting, is_preview=False)
    return solve_bounces(patches, reflecting, incident, paths.first, paths.last).mean_to_others(patches)


def blue_wall(document):
    document["materials"]["Red"]["terms"][0]["color"] = [0.1, 0.1, 0.8]


def one_bounce(document):
    document["transport"].update(bounces=1)


def test_previewed_light_is_not_reused_as_exact(store, monkeypatch):
    monkeypatch.setattr(transfers, "PREVIEW_WIDTH", 4)
    expected = open_transfer(store, Cache(BUDGET))
    exact = expected.indirect.outgoing_light(rotated(expected)).isotropic[: expected.patches.num_patches]
    again = open_transfer(store, Cache(BUDGET))
    rough = again.indirect.solve_indirect(rotated(again), LightQuality.PREVIEW).mean_to_others()
    assert np.abs(rough - exact).max() > 1e-3 * exact.max()  # the small map differs
    reopened = again.indirect.outgoing_light(rotated(again)).isotropic[: len(exact)]
    np.testing.assert_array_equal(reopened, exact)


@pytest.mark.parametrize("edit", [blue_wall, one_bounce])
def test_a_change_follows_the_direction_of_highlights(gathered, edit):
    """Isotropic light of the polished floor would be wrong by 7 and 13 %."""
    before, after = (light_in(gathered, make_look(gathered, *edits)) for edits in ((), (edit,)))
    exact = mean_outgoing(gathered, after) - mean_outgoing(gathered, before)
    change = gathered.indirect.solve_indirect(after, LightQuality.PREVIEW, start_from=before)
    assert relative_rmse(change.mean_to_others(), exact) < 0.02
