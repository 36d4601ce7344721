"""Looks between looks."""

import copy

import pytest

from relume.look import complete, default_look
from relume.look.morph import morph
from relume.scene.model import Material

LOBE = {"model": "blinn_phong", "color": [1.0, 1.0, 1.0], "params": {"exponent": 10.0}}
MATERIALS = [Material("Ball", ({"model": "lambert", "color": [0.2, 0.4, 0.6]}, LOBE))]
DEFAULT = default_look(MATERIALS)


def look(**sections):
    return complete(sections, DEFAULT)


def ball(document):
    return document["materials"]["Ball"]["terms"]


def test_keyframes_are_themselves_and_numbers_between_go_evenly():
    first, last = look(), look(environment={"rotation": 90.0, "scale": 3.0})
    assert morph([first, last], 0.0) == first
    assert morph([first, last], 1.0) == last
    between = morph([first, last], 0.25)
    assert between["environment"]["rotation"] == pytest.approx(22.5)
    assert between["environment"]["scale"] == pytest.approx(1.5)
    assert complete(between, DEFAULT) == between


def test_what_sliders_move_by_its_logarithm_goes_so():
    last = look()
    last = copy.deepcopy(last)
    ball(last)[1]["params"]["exponent"] = 1000.0
    assert ball(morph([look(), last], 0.5))[1]["params"]["exponent"] == pytest.approx(100.0)
    ball(last)[1]["params"]["exponent"] = [1000.0, 10.0, 40.0]
    assert ball(morph([look(), last], 0.5))[1]["params"]["exponent"] == pytest.approx([100.0, 10.0, 20.0])


def test_what_has_nothing_between_changes_half_way_and_stays_valid():
    last = copy.deepcopy(look())
    ball(last)[1] = {"model": "phong", "color": [1.0, 1.0, 1.0], "params": {"exponent": 20.0}}
    ball(last)[0]["color"] = [0.4, 0.4, 0.4]
    last = complete(last, DEFAULT)
    last["lights"]["Lamp"] = {"kind": "point", "position": [0.0, 1.0, 0.0], "emission": [1.0, 1.0, 1.0]}
    last = complete(last, DEFAULT)
    before, after = morph([look(), last], 0.49), morph([look(), last], 0.51)
    assert (ball(before)[1]["model"], ball(after)[1]["model"]) == ("blinn_phong", "phong")
    assert ("Lamp" in before["lights"], "Lamp" in after["lights"]) == (False, True)
    assert ball(after)[0]["color"] == pytest.approx([0.302, 0.4, 0.498])
    for found in (before, after):
        assert complete(found, DEFAULT) == found


def test_many_keyframes_share_the_way_and_whole_numbers_stay_whole():
    keys = [look(transport={"bounces": k}) for k in (0, 8, 2)]
    assert [morph(keys, share)["transport"]["bounces"] for share in (0.0, 0.25, 0.5, 0.75, 1.0)] == [0, 4, 8, 5, 2]
    assert morph(keys[:1], 0.7) == keys[0]


def test_drawn_curves_of_as_many_points_go_point_by_point():
    first, last = copy.deepcopy(look()), copy.deepcopy(look())
    ball(first)[1]["curves"] = {"theta_h": {"points": [[0.0, 1.0], [30.0, 0.0]]}}
    ball(last)[1]["curves"] = {"theta_h": {"points": [[0.0, 3.0], [50.0, 0.0]]}}
    found = ball(morph([complete(first, DEFAULT), complete(last, DEFAULT)], 0.5))[1]["curves"]["theta_h"]["points"]
    assert found == [[0.0, 2.0], [40.0, 0.0]]
