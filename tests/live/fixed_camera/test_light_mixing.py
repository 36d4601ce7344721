"""Lights dimmed, tinted, switched and soloed: mixed exactly from few images of single sources."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import exact_image
from session_edits import BUDGET, kind_of, make_look, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture

POINT_LIGHT = {"kind": "point", "position": [0.9, 1.4, 1.2], "emission": [2.0, 2.0, 2.0]}
PANEL = {
    "kind": "rectangle", "position": [-1.0, 1.5, 1.0], "direction": [1, -1, -1], "size": [0.6, 0.4],
    "emission": [5.0, 4.0, 3.0],
}  # fmt: skip
SUN = {"kind": "directional", "direction": [-1, -2, -1], "emission": [0.5, 0.5, 0.6]}
ALL = {"Lamp": POINT_LIGHT, "Panel": PANEL, "Sun": SUN}


def look_with(transfer, lights, environment=None):
    return make_look(transfer, lambda d: (d["lights"].update(lights), d["environment"].update(environment or {})))


def changed(name, **fields):
    return {**ALL, name: ALL[name] | fields}


@pytest.fixture
def lit(transfer):
    """An exact picture under three lights and the environment."""
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(look_with(transfer, ALL))
    return run_until_exact(picture)


def num_made(picture):
    """Number of jobs until the picture is exact, without previews."""
    made = 0
    while (need := picture.next_job()) is not None:
        made += kind_of(need) != "preview"
        picture.run_next_job(lambda fraction: None, lambda: False)
        picture.advance(None)
    return made


def num_terms(picture):
    return sum(len(m.terms) for m in picture._images.by_name.values() if m.num_samples)


OTHERS = {"color": [1.0, 0.2, 0.0]}, {"emission": [1, 7, 1]}
SLOW = (pytest.param(fields, marks=pytest.mark.slow) for fields in OTHERS)


@pytest.mark.parametrize(
    "fields", [{"intensity": 3.0}, pytest.param({"enabled": False}, marks=pytest.mark.slow), *SLOW]
)
def test_first_change_shades_one_source_and_later_ones_nothing(transfer, lit, fields):
    lit.set_look(look_with(transfer, changed("Panel", **fields)))
    assert num_made(lit) <= num_terms(lit)
    expected = exact_image(transfer, look_with(transfer, changed("Panel", **fields)))
    np.testing.assert_allclose(lit.image(), expected, rtol=1e-4, atol=1e-5)
    for scale in (0.3, 0.0, 5.0):
        look = look_with(transfer, changed("Panel", intensity=scale))
        lit.set_look(look)
        assert lit.advance(None).exact, "no preview, no wait"
        assert lit.next_job() is None
        np.testing.assert_allclose(lit.image(), exact_image(transfer, look), rtol=1e-4, atol=1e-5)


def test_the_intensity_of_the_environment_is_mixed(transfer, lit):
    for environment in ({"intensity": 0.0}, {"intensity": 2.0, "color": [0.5, 1.0, 1.0]}):
        look = look_with(transfer, ALL, environment)
        lit.set_look(look)
        num_made(lit)
        np.testing.assert_allclose(lit.image(), exact_image(transfer, look), rtol=1e-4, atol=1e-5)
    lit.set_look(look_with(transfer, ALL, {"intensity": 0.7}))
    assert lit.advance(None).exact


def test_solo_equals_the_other_lights_switched_off(transfer, lit):
    whole = look_with(transfer, ALL)
    lit.set_look(whole, solo=frozenset({"Sun"}))
    run_until_exact(lit)
    alone = {name: light | {"enabled": name == "Sun"} for name, light in ALL.items()}
    expected = exact_image(transfer, look_with(transfer, alone, {"intensity": 0.0}))
    np.testing.assert_allclose(lit.image(), expected, rtol=1e-4, atol=1e-5)
    lit.set_look(whole)
    np.testing.assert_allclose(run_until_exact(lit).image(), exact_image(transfer, whole), rtol=1e-4, atol=1e-5)


def test_a_soloed_light_is_shaded_alone_and_the_others_return_at_once(transfer, lit):
    solo = {name: light | {"enabled": name == "Sun"} for name, light in ALL.items()}
    look = look_with(transfer, solo, {"intensity": 0.0})
    lit.set_look(look)
    assert num_made(lit) == num_terms(lit)
    np.testing.assert_allclose(lit.image(), exact_image(transfer, look), rtol=1e-4, atol=1e-5)
    louder = look_with(transfer, solo | {"Sun": SUN | {"intensity": 2.0}}, {"intensity": 0.0})
    lit.set_look(louder)
    assert lit.advance(None).exact
    lit.set_look(look_with(transfer, ALL))
    num_made(lit)
    np.testing.assert_allclose(lit.image(), exact_image(transfer, look_with(transfer, ALL)), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("environment", [{}, {"rotation": 40.0}])
def test_after_a_solo_the_others_are_not_shaded_again(transfer, lit, environment):
    def look_at(sun_scale):
        lights = changed("Panel", intensity=3.0) | {"Sun": SUN | {"intensity": sun_scale}}
        return look_with(transfer, lights, environment)

    lit.set_look(look_at(1.0))
    run_until_exact(lit).set_look(look_at(1.0), solo=frozenset({"Sun"}))
    run_until_exact(lit).set_look(look_at(2.0), solo=frozenset({"Sun"}))
    run_until_exact(lit).set_look(look_at(2.0))
    assert lit.advance(None).exact
    np.testing.assert_allclose(lit.image(), exact_image(transfer, look_at(2.0)), rtol=1e-4, atol=1e-5)


def test_curves_that_were_changed_under_one_light_are_shaded_under_all(transfer, lit):
    def dull(document):
        document["lights"].update(ALL)
        document["materials"]["Wall"]["terms"][1]["params"].update(exponent=20.0)

    lit.set_look(look_with(transfer, ALL), solo=frozenset({"Sun"}))
    run_until_exact(lit).set_look(make_look(transfer, dull), solo=frozenset({"Sun"}))
    run_until_exact(lit).set_look(make_look(transfer, dull))
    expected = exact_image(transfer, make_look(transfer, dull))
    np.testing.assert_allclose(run_until_exact(lit).image(), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_alternating_gains_and_curves_stay_exact(transfer, lit):
    """A curve's operator belongs to one light; another gain needs a new one."""

    def edited(scale, exponent):
        lights = changed("Lamp", intensity=scale)
        return make_look(
            transfer,
            lambda d: (
                d["lights"].update(lights),
                d["materials"]["Wall"]["terms"][1]["params"].update(exponent=exponent),
            ),
        )

    for scale, exponent in ((1.0, 60.0), (2.0, 60.0), (2.0, 20.0), (0.5, 20.0), (0.5, 45.0)):
        lit.set_look(edited(scale, exponent))
        run_until_exact(lit)
        expected = exact_image(transfer, edited(scale, exponent))
        np.testing.assert_allclose(lit.image(), expected, rtol=3e-3, atol=1e-4)


def test_preparing_a_light_computes_its_image(transfer, lit):
    lit.prepare("/lights/Panel")
    while (need := lit.next_job()) is not None:
        need.apply(need.run(lambda fraction: None, lambda: False))
        assert lit.advance(None).exact
    look = look_with(transfer, changed("Panel", intensity=0.3))
    lit.set_look(look)
    assert lit.advance(None).exact
    np.testing.assert_allclose(lit.image(), exact_image(transfer, look), rtol=3e-3, atol=1e-4)


def test_a_moved_light_is_prepared_again_at_its_position(transfer, lit):
    lit.prepare("/lights/Panel")
    run_until_exact(lit).set_look(look_with(transfer, changed("Panel", position=[-0.9, 1.4, 1.0])))
    run_until_exact(lit)
    look = look_with(transfer, changed("Panel", position=[-0.9, 1.4, 1.0], intensity=0.3))
    lit.set_look(look)
    assert lit.advance(None).exact
    np.testing.assert_allclose(lit.image(), exact_image(transfer, look), rtol=3e-3, atol=1e-4)


def test_prewarming_never_evicts(transfer):
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(look_with(transfer, ALL))
    run_until_exact(picture).prepare("/lights/Panel")
    assert picture.next_job() is not None
    full = Picture(transfer, "front", cache := Cache(BUDGET))
    full.set_look(look_with(transfer, ALL))
    run_until_exact(full)
    cache._state.budget_bytes = cache.used_bytes
    full.prepare("/lights/Panel")
    assert full.next_job() is None
