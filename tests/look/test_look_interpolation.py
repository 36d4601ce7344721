"""Interpolation between looks."""

import copy
import math

import numpy as np
import pytest

from relume.look import complete, default_look
from relume.look.interpolate import enclosing_keyframes, interpolate_looks
from relume.look.library.navigation_map import navigation_map
from relume.scene.model import Material

LOBE = {"model": "blinn_phong", "color": [1.0, 1.0, 1.0], "params": {"exponent": 10.0}}
MATERIALS = [Material("Ball", ({"model": "lambert", "color": [0.2, 0.4, 0.6]}, LOBE))]
DEFAULT = default_look(MATERIALS)


def look(**sections):
    return complete(sections, DEFAULT)


def ball(document):
    return document["materials"]["Ball"]["terms"]


def test_keyframes_are_exact_and_numbers_between_are_linear():
    first, last = look(), look(environment={"rotation": 90.0, "intensity": 3.0})
    assert interpolate_looks([first, last], 0.0) == first
    assert interpolate_looks([first, last], 1.0) == last
    between = interpolate_looks([first, last], 0.25)
    assert between["environment"]["rotation"] == pytest.approx(22.5)
    assert between["environment"]["intensity"] == pytest.approx(1.5)
    assert complete(between, DEFAULT) == between


def test_logarithmic_parameters_are_interpolated_logarithmically():
    last = look()
    last = copy.deepcopy(last)
    ball(last)[1]["params"]["exponent"] = 1000.0
    assert ball(interpolate_looks([look(), last], 0.5))[1]["params"]["exponent"] == pytest.approx(100.0)
    ball(last)[1]["params"]["exponent"] = [1000.0, 10.0, 40.0]
    assert ball(interpolate_looks([look(), last], 0.5))[1]["params"]["exponent"] == pytest.approx([100.0, 10.0, 20.0])


@pytest.mark.parametrize("fraction", [0.1, 0.3, 0.5, 0.7])
def test_interpolated_parameters_stay_within_their_range(fraction):
    """Rounding of the logarithm must not exceed the end of a slider."""
    keys = [copy.deepcopy(look()), copy.deepcopy(look())]
    for key, blue in zip(keys, (20.0, 30.0), strict=True):
        ball(key)[1]["params"]["exponent"] = [2e5, 2e5, blue]
    between = interpolate_looks(keys, fraction)
    assert ball(between)[1]["params"]["exponent"][:2] == [2e5, 2e5]
    assert complete(between, DEFAULT) == between


def test_a_light_between_opposite_directions_has_a_direction():
    spot = {"kind": "spot", "direction": [0.0, -1.0, 0.0]}
    keys = [look(lights={"Lamp": spot}), look(lights={"Lamp": {**spot, "direction": [0.0, 1.0, 0.0]}})]
    between = interpolate_looks(keys, 0.5)
    assert between["lights"]["Lamp"]["direction"] == [0.0, 1.0, 0.0]
    assert complete(between, DEFAULT) == between


def test_discrete_values_switch_halfway_and_stay_valid():
    last = copy.deepcopy(look())
    ball(last)[1] = {"model": "phong", "color": [1.0, 1.0, 1.0], "params": {"exponent": 20.0}}
    ball(last)[0]["color"] = [0.4, 0.4, 0.4]
    last = complete(last, DEFAULT)
    last["lights"]["Lamp"] = {"kind": "point", "position": [0.0, 1.0, 0.0], "emission": [1.0, 1.0, 1.0]}
    last = complete(last, DEFAULT)
    before, after = interpolate_looks([look(), last], 0.49), interpolate_looks([look(), last], 0.51)
    assert (ball(before)[1]["model"], ball(after)[1]["model"]) == ("blinn_phong", "phong")
    assert ("Lamp" in before["lights"], "Lamp" in after["lights"]) == (False, True)
    assert ball(after)[0]["color"] == pytest.approx([0.302, 0.4, 0.498])
    for between in (before, after):
        assert complete(between, DEFAULT) == between


def test_keyframes_are_equally_spaced_and_integers_stay_integers():
    keys = [look(transport={"bounces": k}) for k in (0, 8, 2)]
    assert [interpolate_looks(keys, fraction)["transport"]["bounces"] for fraction in (0.0, 0.25, 0.5, 0.75, 1.0)] == [
        0,
        4,
        8,
        5,
        2,
    ]
    assert interpolate_looks(keys[:1], 0.7) == keys[0]


def test_drawn_curves_of_equal_length_are_interpolated_by_points():
    first, last = copy.deepcopy(look()), copy.deepcopy(look())
    ball(first)[1]["curves"] = {"theta_h": {"points": [[0.0, 1.0], [30.0, 0.0]]}}
    ball(last)[1]["curves"] = {"theta_h": {"points": [[0.0, 3.0], [50.0, 0.0]]}}
    curve = ball(interpolate_looks([complete(first, DEFAULT), complete(last, DEFAULT)], 0.5))[1]["curves"]["theta_h"][
        "points"
    ]
    assert curve == [[0.0, 2.0], [40.0, 0.0]]


def test_durations_are_the_times_between_keyframes():
    assert enclosing_keyframes(3, 0.5) == (1, 1, 0.0)
    for fraction, expected in ((0.0, (0, 0, 0.0)), (0.1, (0, 1, 0.4)), (0.25, (1, 1, 0.0)), (0.625, (1, 2, 0.5))):
        assert enclosing_keyframes(3, fraction, [2.0, 6.0]) == pytest.approx(expected)
    assert enclosing_keyframes(3, 1.0, [2.0, 6.0])[0] == 2


def of_map(color, f0, sigma):
    """Terms of a material of the map."""
    root = math.sqrt(f0)
    params = {"sigma": sigma, "ior": (1 + root) / (1 - root)}
    return [
        {"model": "lambert", "color": [color] * 3},
        {"model": "cook_torrance", "color": [1.0 - color] * 3, "params": params},
    ]


def test_a_path_across_the_map_passes_through_its_materials():
    """Linear in reflectance and in the logarithm of roughness, also from and to materials off the map."""
    ends = [look(materials={"Ball": {"terms": of_map(*end)}}) for end in ((0.9, 0.02, 0.05), (0.1, 0.5, 0.45))]
    for fraction, end in ((0.0, ends[0]), (1.0, ends[1])):
        assert ball(interpolate_looks(ends, fraction, "map"))[1]["params"] == ball(end)[1]["params"]
    nearly = [ball(interpolate_looks(ends, fraction, "map")) for fraction in (1e-9, 1 - 1e-9)]
    for actual, end in zip(nearly, ends, strict=True):
        np.testing.assert_allclose([t["color"] for t in actual], [t["color"] for t in ball(end)], atol=1e-6)
    between = interpolate_looks(ends, 0.5, "map")
    assert complete(between, DEFAULT) == between
    params = ball(between)[1]["params"]
    assert params["sigma"] == pytest.approx(0.15)
    assert ((params["ior"] - 1) / (params["ior"] + 1)) ** 2 == pytest.approx(0.26)
    passed = navigation_map("ngan").at(0.26, 0.15)
    beside = [
        np.array([t["color"] for t in ball(end)]) - np.array([t["color"] for t in navigation_map("ngan").at(*point)])
        for end, point in zip(ends, ((0.02, 0.05), (0.5, 0.45)), strict=True)
    ]
    expected = np.array([t["color"] for t in passed]) + np.mean(beside, axis=0)
    np.testing.assert_allclose([t["color"] for t in ball(between)], np.maximum(expected, 0), atol=1e-6)


@pytest.mark.parametrize(("mode", "table"), [("map", "ngan"), ("map_low", "low")])
def test_a_path_between_two_fits_is_the_line_of_their_map(mode, table):
    """Metals have extinction on Ngan's map and none on Löw's; both lines are linear in reflectance."""
    plane = navigation_map(table)
    first, second = (next(p for p in plane.presets if p.id.endswith(name)) for name in ("/chrome", "/blue-acrylic"))
    ends = [look(materials={"Ball": {"terms": copy.deepcopy(preset.terms)}}) for preset in (first, second)]
    f0, sigma = (
        [values[plane.presets.index(preset)] for preset in (first, second)] for values in (plane.f0, plane.sigma)
    )
    for weight in (0.25, 0.6):
        position = (1 - weight) * f0[0] + weight * f0[1], sigma[0] ** (1 - weight) * sigma[1] ** weight
        between, expected = ball(interpolate_looks(ends, weight, mode)), plane.at(*position)
        for actual, term in zip(between, expected, strict=True):
            np.testing.assert_allclose(actual["color"], term["color"], atol=1e-9)
            assert actual["params"] == pytest.approx(term["params"], rel=1e-9, abs=1e-9)
        assert (between[1]["params"]["extinction"] > 0) == (table == "ngan")


def test_other_materials_are_interpolated_by_parameters():
    last = copy.deepcopy(look())
    ball(last)[1]["params"]["exponent"] = 1000.0
    assert interpolate_looks([look(), last], 0.3, "map") == interpolate_looks([look(), last], 0.3)
