"""Live pictures during slider edits: followed along the parameter, approximate while it moves, exact when it stops."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from session_edits import BUDGET, make_look, relative_rmse, run_until_exact, task_of

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.fixed_camera.picture import Picture
from relume.operators.edit_basis import CurveBasis
from relume.operators.parameter_operator import MAX_ERROR, ParameterOperator

TERM = "/materials/Ball/terms/1"
ROUGHNESS, THETA_H = f"{TERM}/params/roughness", f"{TERM}/curves/theta_h"


def shiny(roughness=0.4, curves=None, **more):
    """The ball's highlight in glTF's parameters."""

    def change(document):
        term = {"model": "ggx", "color": [0.8, 0.7, 0.6], "params": {"roughness": roughness, **more}}
        document["materials"]["Ball"]["terms"][1] = {**term, "curves": curves or {}}

    return change


@pytest.fixture
def picture(transfer):
    live = Picture(transfer, "front", Cache(BUDGET))
    live.set_look(make_look(transfer, shiny()))
    return run_until_exact(live)


def exact(transfer, change):
    return ref.full_evaluation(transfer, "front", make_look(transfer, change))


def make(picture, need):
    need.apply(need.run(lambda fraction: None, lambda: False))


def prepare(picture, pointer):
    picture.prepare(pointer)
    make(picture, picture.next_job())
    return picture


def test_a_slider_of_several_curves_is_followed_at_once(transfer, picture):
    prepare(picture, ROUGHNESS)
    assert picture.next_job() is None
    for roughness in (0.41, 0.25, 0.9, 0.33):
        picture.set_look(make_look(transfer, shiny(roughness)))
        need = picture.next_job()
        assert need is None
        advance = picture.advance(8)
        assert advance.changed
        assert not advance.exact
        error = relative_rmse(picture.image(), exact(transfer, shiny(roughness)))
        assert 1e-7 < error < MAX_ERROR


def test_when_the_slider_stops_the_picture_is_exact_and_still_prepared(transfer, picture):
    prepare(picture, ROUGHNESS)
    picture.set_look(make_look(transfer, shiny(0.2)))
    picture.advance(None)
    need = picture.next_job()
    assert need.is_refinement
    assert need.state == "shading"
    assert not picture.advance(None).exact
    make(picture, need)
    assert picture.advance(None).exact
    assert picture.next_job() is None
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.2))) < 1e-6
    picture.set_look(make_look(transfer, shiny(0.7)))
    assert picture.advance(None).changed
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.7))) < MAX_ERROR


def test_shading_of_an_outdated_look_is_not_shown(transfer, picture):
    prepare(picture, ROUGHNESS)
    picture.set_look(make_look(transfer, shiny(0.2)))
    picture.advance(None)
    old = picture.next_job()
    picture.set_look(make_look(transfer, shiny(0.7)))
    picture.advance(None)
    make(picture, old)
    assert not picture.advance(None).exact
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.7))) < MAX_ERROR


def test_a_narrow_lobe_is_exact_again_when_the_slider_stops(transfer, picture):
    """Its operator does not trace the lobe, so that the picture is nearly exact at most, and off by some percent."""
    prepare(picture, ROUGHNESS)
    for roughness in (0.1, 0.05):
        picture.set_look(make_look(transfer, shiny(roughness)))
        advance = picture.advance(8)
        assert advance.changed
        assert not advance.exact
        assert relative_rmse(picture.image(), exact(transfer, shiny(roughness))) < 0.05
    assert relative_rmse(run_until_exact(picture).image(), exact(transfer, shiny(0.05))) < 1e-6


def test_a_drawn_narrow_lobe_is_not_exact_until_it_is_traced(transfer, picture):
    picture.set_look(make_look(transfer, shiny(0.1)))
    run_until_exact(picture)
    picture.prepare(THETA_H)
    run_until_exact(picture)
    picture.set_look(make_look(transfer, shiny(0.08)))
    advance = picture.advance(None)
    assert advance.changed
    assert not advance.exact
    assert relative_rmse(run_until_exact(picture).image(), exact(transfer, shiny(0.08))) < 1e-6


@pytest.mark.parametrize("hand", [None, THETA_H, "/lights/Lamp"])
def test_the_active_control_is_never_inferred_from_looks(transfer, picture, hand):
    picture.set_look(make_look(transfer, shiny(0.3)), active_pointer=hand)
    assert isinstance(task_of(picture.next_job()).basis, CurveBasis)


def test_pointers_to_no_control_are_rejected_and_the_look_stays(transfer, picture):
    with pytest.raises(ParameterError):
        picture.set_look(make_look(transfer, shiny(0.3)), active_pointer="/display/exposure")
    assert picture.next_job() is None
    assert picture.advance(None).exact


def test_an_unprepared_control_is_inferred_from_its_edits(transfer, picture):
    picture.set_look(make_look(transfer, shiny(0.3)), active_pointer=ROUGHNESS)
    need = picture.next_job()
    assert isinstance(task_of(need).basis, ParameterOperator)
    assert task_of(need).basis.parameter == "roughness"
    make(picture, need)
    picture.set_look(make_look(transfer, shiny(0.6)))
    assert picture.advance(None).changed
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.6))) < MAX_ERROR


def test_a_prepared_curve_is_replaced_by_a_slider_of_several_curves(transfer, picture):
    prepare(picture, THETA_H)
    prepare(picture, ROUGHNESS)
    picture.set_look(make_look(transfer, shiny(0.6)))
    picture.advance(None)
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.6))) < MAX_ERROR


def test_a_prepared_curve_serves_a_slider_of_that_curve(transfer):
    """Its exact wavelets are there: nodes would be another freeze, and less accurate."""
    picture = run_until_exact(Picture(transfer, "front", Cache(BUDGET)))
    prepare(picture, THETA_H)
    picture.prepare(f"{TERM}/params/sigma")
    assert picture.next_job() is None

    def change(document):
        document["materials"]["Ball"]["terms"][1]["params"]["sigma"] = 0.13

    picture.set_look(make_look(transfer, change))
    assert picture.next_job() is None
    assert picture.advance(None).exact


def test_a_drawn_curve_is_not_represented_by_nodes(transfer, picture):
    prepare(picture, ROUGHNESS)
    picture.set_look(make_look(transfer, shiny(0.2)))
    picture.advance(None)
    drawn = shiny(0.2, {"theta_h": {"points": [[0, 3], [20, 0.2], [60, 2]]}})
    picture.set_look(make_look(transfer, drawn))
    need = picture.next_job()
    assert isinstance(task_of(need).basis, CurveBasis)
    assert task_of(need).basis.name == "theta_h"
    make(picture, need)
    assert picture.advance(None).exact
    assert relative_rmse(picture.image(), exact(transfer, drawn)) < 1e-6


def test_another_slider_of_the_term_replaces_the_operator(transfer, picture):
    prepare(picture, ROUGHNESS)
    picture.set_look(make_look(transfer, shiny(0.2)))
    picture.advance(None)
    prepare(picture, f"{TERM}/params/f0")
    picture.set_look(make_look(transfer, shiny(0.2, f0=0.7)))
    picture.advance(None)
    assert relative_rmse(picture.image(), exact(transfer, shiny(0.2, f0=0.7))) < MAX_ERROR
    assert relative_rmse(run_until_exact(picture).image(), exact(transfer, shiny(0.2, f0=0.7))) < 1e-6


def test_pictures_of_the_same_view_share_the_operator_of_a_slider(transfer):
    cache = Cache(BUDGET)
    first, second = (Picture(transfer, "front", cache) for _ in range(2))
    for picture, roughness in ((first, 0.2), (second, 0.8)):
        picture.set_look(make_look(transfer, shiny(roughness)))
        run_until_exact(picture)
    prepare(first, ROUGHNESS)
    used = cache.used_bytes
    prepare(second, ROUGHNESS)
    assert cache.used_bytes == used
    second.set_look(make_look(transfer, shiny(0.5)))
    second.advance(None)
    assert relative_rmse(second.image(), exact(transfer, shiny(0.5))) < MAX_ERROR
    np.testing.assert_allclose(first.image(), exact(transfer, shiny(0.2)), atol=1e-4)
