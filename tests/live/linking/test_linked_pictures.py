"""Linked lights of fixed cameras: linked surfaces are lit as by an unlinked light, others not at all."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import render_uncached
from pure_pixels import shown
from session_edits import make_look

DARK = {"intensity": 0.0}
LIGHTS = {
    "point": {"kind": "point", "position": [0.3, 1.2, 0.2], "emission": [2.0, 2.0, 2.0]},
    "panel": {
        "kind": "rectangle", "position": [0.4, 1.4, 0.4], "direction": [-1, -1, -1], "size": [0.6, 0.4],
        "emission": [5.0, 5.0, 5.0],
    },
    "spot": {"kind": "spot", "position": [0.4, 1.2, 0.2], "direction": [-1, -0.3, -0.2], "emission": [9.0, 5.0, 5.0]},
    "sun": {"kind": "directional", "direction": [-1, -2, -1]},
}  # fmt: skip
RED = {"materials": ["Red"]}
OBJECT = {"objects": ["red"]}


def rendered(transfer, light=None, environment=None, show="all"):
    def edit(document):
        document["lights"] = {} if light is None else {"A": light}
        document["environment"].update(environment or {})
        document["transport"]["show"] = show

    return render_uncached(transfer, make_look(transfer, edit))


@pytest.mark.parametrize("names", [RED, OBJECT], ids=["material", "object"])
@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_linked_light_lights_exactly_the_included_receiver(gathered, light, names):
    unlinked = rendered(gathered, light, DARK, "direct")
    linked = rendered(gathered, light | {"link": {"include": names}}, DARK, "direct")
    red = shown(gathered, "Red")
    assert unlinked[red].mean() > 0.01
    np.testing.assert_allclose(linked[red], unlinked[red], rtol=1e-6)
    assert not linked[shown(gathered, "Floor") | shown(gathered, "Blue")].any()


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_included_and_excluded_light_add_to_the_unlinked_picture(gathered, light):
    unlinked = rendered(gathered, light, DARK)
    parts = [rendered(gathered, light | {"link": {mode: RED}}, DARK) for mode in ("include", "exclude")]
    assert parts[0][shown(gathered, "Floor")].mean() > 1e-4  # indirect light of the red wall
    np.testing.assert_allclose(sum(parts), unlinked, rtol=2e-4, atol=1e-6 * unlinked.max())


def test_linked_environment_lights_exactly_the_included_receiver(gathered):
    unlinked = rendered(gathered, show="direct")
    linked = rendered(gathered, environment={"link": {"include": OBJECT}}, show="direct")
    red = shown(gathered, "Red")
    np.testing.assert_allclose(linked[red], unlinked[red], rtol=1e-6)
    assert unlinked[red].mean() > 0.01
    assert not linked[shown(gathered, "Floor") | shown(gathered, "Blue")].any()


def test_included_and_excluded_environment_add_to_the_unlinked_picture(gathered):
    surfaces = shown(gathered, "Red") | shown(gathered, "Floor") | shown(gathered, "Blue")
    unlinked = rendered(gathered)[surfaces]
    parts = [rendered(gathered, environment={"link": {mode: RED}})[surfaces] for mode in ("include", "exclude")]
    np.testing.assert_allclose(sum(parts), unlinked, rtol=2e-4, atol=1e-6 * unlinked.max())


def test_light_that_is_linked_to_nothing_is_dark(gathered):
    assert not rendered(gathered, LIGHTS["point"] | {"link": {"include": {}}}, DARK).any()


def test_light_that_excludes_nothing_lights_all(gathered):
    linked = rendered(gathered, LIGHTS["panel"] | {"link": {"exclude": {"objects": []}}}, DARK)
    np.testing.assert_allclose(linked, rendered(gathered, LIGHTS["panel"], DARK), rtol=1e-6)
