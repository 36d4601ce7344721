"""Faders of light groups: the lights of a group have one factor, so their sum is shaded once and then mixed."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import render_uncached
from session_edits import BUDGET, kind_of, make_look, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import (
    gain_changes,
    group_lights,
    grouped_gains,
    illumination_from_look,
)
from relume.live.fixed_camera.picture import Picture
from relume.look import default_look, validate
from relume.scene.model import Light

FRONT = "/light_groups/Front"
GROUPS = {"Front": {"lights": ["Left", "Right", "Top"]}, "Back": {"lights": ["Sun", "Rim"]}}
LIGHTS = {
    "Left": {"kind": "point", "position": [-0.9, 1.4, 1.2], "emission": [2.0, 1.0, 0.5]},
    "Right": {"kind": "point", "position": [0.9, 1.4, 1.2], "emission": [0.5, 1.0, 2.0]},
    "Top": {"kind": "spot", "position": [0.2, 1.9, 0.3], "direction": [0, -1, 0], "emission": [0.0, 3.0, 1.0]},
    "Sun": {"kind": "directional", "direction": [-1, -2, -1], "emission": [0.5, 0.5, 0.6]},
    "Rim": {"kind": "point", "position": [0.4, 1.5, -1.0], "emission": [1.0, 1.0, 1.0]},
}


def faders(transfer, lights=None, **changes):
    """The look with changed fields of groups, and of lights."""
    groups = {name: group | changes.get(name, {}) for name, group in GROUPS.items()}
    each = {name: light | (lights or {}).get(name, {}) for name, light in LIGHTS.items()}
    return make_look(transfer, lambda d: (d["lights"].update(each), d.update(light_groups=groups)))


@pytest.fixture(params=["transfer", "gathered"])
def lit(request):
    """A bake of each method, and an exact picture for which the fader has been prepared."""
    transfer = request.getfixturevalue(request.param)
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(faders(transfer))
    run_until_exact(picture).prepare(FRONT)
    return transfer, run_until_exact(picture)


def assert_follows(transfer, picture, look, pointer=FRONT):
    """The next frame is exact, and nothing is left to shade: at most the images are summed once more."""
    picture.set_look(look, active_pointer=pointer)
    assert picture.advance(None).exact
    assert kind_of(picture.next_job()) in (None, "resum")
    np.testing.assert_allclose(picture.image(), render_uncached(transfer, look), rtol=1e-4, atol=1e-6)


def test_frames_of_a_fader_are_exact_and_need_no_job(lit):
    transfer, picture = lit
    for change in ({"intensity": 0.4}, {"intensity": 3.0, "color": [0.2, 1.0, 0.7]}, {"enabled": False}, {}):
        assert_follows(transfer, picture, faders(transfer, Front=change))


def test_a_fader_goes_to_zero_and_back_and_undo_returns_the_image(lit):
    transfer, picture = lit
    before = picture.image()
    for intensity in (0.0, 0.7):
        assert_follows(transfer, picture, faders(transfer, Front={"intensity": intensity}))
    assert_follows(transfer, picture, faders(transfer), pointer=None)
    np.testing.assert_array_equal(picture.image(), before)


def test_a_second_group_and_a_light_of_the_first_follow(lit):
    transfer, picture = lit
    dim = {"intensity": 0.3}
    assert_follows(transfer, picture, faders(transfer, Front=dim))
    both = faders(transfer, Front=dim, Back={"intensity": 2.0})
    picture.set_look(both, active_pointer="/light_groups/Back")
    run_until_exact(picture)
    assert_follows(transfer, picture, faders(transfer, Front=dim, Back={"intensity": 1.5}), "/light_groups/Back")
    edited = faders(transfer, {"Left": {"intensity": 4.0}}, Front=dim, Back={"intensity": 1.5})
    picture.set_look(edited, active_pointer="/lights/Left")
    run_until_exact(picture)
    np.testing.assert_allclose(picture.image(), render_uncached(transfer, edited), rtol=1e-4, atol=1e-6)
    changed = faders(transfer, {"Left": {"intensity": 4.0}}, Front={"intensity": 0.8}, Back={"intensity": 1.5})
    picture.set_look(changed, active_pointer=FRONT)  # the sum of the group is another one now
    run_until_exact(picture)
    np.testing.assert_allclose(picture.image(), render_uncached(transfer, changed), rtol=1e-4, atol=1e-6)


def test_a_soloed_group_needs_no_image_of_other_lights(lit):
    transfer, picture = lit
    look, solo = faders(transfer, Front={"intensity": 0.4}), frozenset(GROUPS["Front"]["lights"])
    picture.set_look(look, solo=solo)
    assert picture.advance(None).exact
    alone = validate(
        {"lights": look.model_dump()["lights"], "environment": {"intensity": 0.0},
         "light_groups": {"Front": GROUPS["Front"] | {"intensity": 0.4}, "Back": GROUPS["Back"] | {"enabled": False}}},
        transfer.default_look,
    )  # fmt: skip
    np.testing.assert_allclose(picture.image(), render_uncached(transfer, alone), rtol=1e-4, atol=1e-6)
    picture.set_look(faders(transfer))
    np.testing.assert_allclose(
        run_until_exact(picture).image(), render_uncached(transfer, faders(transfer)), rtol=1e-4, atol=1e-6
    )


DEFAULT = default_look([], [Light(name, fields) for name, fields in LIGHTS.items()])


def light_of(groups, lights=None, solo=None):
    """The illumination of a look, and the light of its groups."""
    look = validate({"light_groups": groups, "lights": lights or {}}, DEFAULT)
    light = illumination_from_look(look, [], has_bounces=False, solo=solo)
    return light, group_lights(look, light, solo)


def test_a_group_is_one_element_whose_gain_is_its_fader():
    before, groups = light_of(GROUPS)
    after, same_groups = light_of(GROUPS | {"Front": GROUPS["Front"] | {"intensity": 0.3, "color": [1, 0.5, 0]}})
    assert groups == same_groups
    front, back = groups.values()
    gains = grouped_gains(after, (front, back))
    assert len(gains) == 3  # two groups and the environment
    np.testing.assert_allclose([gain for e, gain in gains.items() if len(e.local) == 3], [(0.3, 0.15, 0)])
    ((element, change),) = gain_changes(before, after, (front, back)).items()
    assert [source.gain for source in element.local] == [
        tuple(LIGHTS[n]["emission"]) for n in GROUPS["Front"]["lights"]
    ]
    np.testing.assert_allclose(change, (-0.7, -0.85, -1.0))


def test_lights_without_a_common_factor_are_elements_of_their_own():
    _, groups = light_of(GROUPS)
    dimmed, _ = light_of(GROUPS, {"Left": {"intensity": 0.5}})
    assert sorted(len(e.local) for e in grouped_gains(dimmed, tuple(groups.values()))) == [0, 1, 1, 1, 2]


def test_the_light_of_a_group_has_its_enabled_lights_or_those_shown_alone():
    off = {"Left": {"enabled": False}}
    assert [len(each.local) for each in light_of(GROUPS, off)[1].values()] == [2, 2]
    assert [len(each.local) for each in light_of(GROUPS, off, frozenset({"Left", "Top"}))[1].values()] == [2]
    assert [len(each.local) for each in light_of(GROUPS, off, frozenset({"Removed"}))[1].values()] == [2, 2]
    assert "Back" not in light_of(GROUPS, {"Rim": {"intensity": 0.0}})[1]  # a single light needs no sum
