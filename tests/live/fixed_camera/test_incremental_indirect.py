"""Colours and bounces dragged in a picture with light between surfaces: near at once, exact at rest."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import exact_image
from session_edits import BUDGET, bake_corner_scene, make_look, relative_rmse, run_next_job, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.jobs import Shade
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.strategies.incremental_light import PrecomputeRows
from relume.live.fixed_camera.strategies.sparse_preview import SparsePreview
from relume.operators.shade import PartialImage

RED = "/materials/Red/terms/0/color"


def colored(transfer, color, **transport):
    """The look with another colour of the red wall."""

    def change(document):
        document["materials"]["Red"]["terms"][0]["color"] = list(color)
        document["transport"].update(transport)

    return make_look(transfer, change)


@pytest.fixture
def prepared(gathered):
    """An exact picture whose red wall somebody is about to colour."""
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))
    picture.prepare(RED)
    needs = []
    while picture.next_job() is not None:
        needs.append(run_next_job(picture))
    assert len(needs) == 4  # one of each term
    assert all(isinstance(need, PrecomputeRows) for need in needs)
    assert picture.advance(None).exact
    return picture


def test_colour_bleeding_follows_a_dragged_colour(gathered, prepared):
    before = prepared.image()
    for blue in (0.2, 0.5, 0.8):
        look = colored(gathered, [0.1, 0.1, blue])
        prepared.set_look(look)
        assert not prepared.advance(32).exact
        exact = exact_image(gathered, look)
        assert relative_rmse(prepared.image(), exact) < 0.01
        assert relative_rmse(before, exact) > 0.1
        need = prepared.next_job()
        assert isinstance(need, Shade)
        assert need.is_refinement  # it waits until the hand rests


def test_at_rest_a_followed_picture_is_a_fresh_one(gathered, prepared):
    prepared.set_look(colored(gathered, [0.3, 0.2, 0.5]))
    prepared.advance(32)
    last = colored(gathered, [0.1, 0.7, 0.2])
    prepared.set_look(last)
    prepared.advance(32)
    np.testing.assert_array_equal(run_until_exact(prepared).image(), exact_image(gathered, last))


def test_undo_is_exact_at_once(gathered, prepared):
    before = prepared.image()
    prepared.set_look(colored(gathered, [0.1, 0.7, 0.2]))
    prepared.advance(32)
    assert not np.array_equal(prepared.image(), before)
    prepared.set_look(make_look(gathered))
    assert prepared.advance(32).exact
    assert prepared.next_job() is None
    np.testing.assert_array_equal(prepared.image(), before)


@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_bounces_follow(gathered, prepared, bounces):
    look = colored(gathered, [0.8, 0.1, 0.1], bounces=bounces)
    prepared.set_look(look)
    assert not prepared.advance(32).exact
    exact = exact_image(gathered, look)
    assert relative_rmse(prepared.image(), exact) < (0.04 if bounces == 0 else 0.01)  # see below
    np.testing.assert_array_equal(run_until_exact(prepared).image(), exact)


def test_from_no_bounces_reflected_light_comes_in(gathered):
    """Rows are frozen while there is no reflected light to judge coefficients by."""
    picture = Picture(gathered, "front", Cache(BUDGET))
    picture.set_look(colored(gathered, [0.8, 0.1, 0.1], bounces=0))
    still = run_until_exact(picture).image()
    look = make_look(gathered)
    picture.set_look(look, active_pointer="/transport/bounces")
    while isinstance(picture.next_job(), PrecomputeRows):
        run_next_job(picture)
    picture.advance(32)
    exact = exact_image(gathered, look)
    assert relative_rmse(picture.image(), exact) < 0.2 * relative_rmse(still, exact)


def test_the_first_edit_freezes_rows_and_all_terms_follow_together(gathered):
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))
    look = colored(gathered, [0.1, 0.1, 0.8])
    picture.set_look(look, active_pointer=RED)
    picture.advance(32)
    exact, errors = exact_image(gathered, look), []
    while isinstance(picture.next_job(), PrecomputeRows):
        errors.append(relative_rmse(picture.image(), exact))
        run_next_job(picture)
        picture.advance(32)
    errors.append(relative_rmse(picture.image(), exact))
    assert len(errors) == 5
    assert errors[-1] < 0.01 < errors[0]


def test_all_black_surfaces_are_followed_to_direct_light(gathered, prepared):
    def black(document):
        for material in document["materials"].values():
            material["terms"][0]["color"] = [0.0, 0.0, 0.0]

    look = make_look(gathered, black)
    prepared.set_look(look)
    prepared.advance(32)
    # where a highlight sends its light stays as it was until the hand rests: of all that there was, 3 % here
    assert relative_rmse(prepared.image(), exact_image(gathered, look)) < 0.04


def test_a_diffuse_curve_is_not_followed_by_rows_of_another(gathered, prepared):
    """The wall's own term is shaded anew; what it throws onto the others follows."""

    def draw(document):
        document["materials"]["Blue"]["terms"][0]["params"]["sigma"] = 0.9

    look = make_look(gathered, draw)
    prepared.set_look(look)
    prepared.advance(32)
    np.testing.assert_array_equal(run_until_exact(prepared).image(), exact_image(gathered, look))


def lamp_at(transfer, x, **others):
    """The look with a lamp above the floor."""

    def change(document):
        light = {"kind": "point", "position": [x, 0.8, 0.2], "emission": [3.0, 2.5, 2.0], **others}
        document["lights"] = {"Lamp": light}

    return make_look(transfer, change)


def follow_lamp(transfer, *looks):
    """A picture that has settled in the first look, whose lamp is then dragged through the others."""
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(looks[0])
    run_until_exact(picture).prepare("/lights/Lamp")
    while picture.next_job() is not None:
        run_next_job(picture)
    for look in looks[1:]:
        picture.set_look(look)
        assert not picture.advance(32).exact
        assert picture.next_job().is_refinement
    return picture


def test_a_moved_lamp_is_followed_with_its_shadows_and_what_it_reflects(gathered):
    looks = [lamp_at(gathered, x) for x in (-0.5, -0.2, 0.1, 0.4)]
    picture = follow_lamp(gathered, *looks)
    exact, start = (exact_image(gathered, look) for look in (looks[-1], looks[0]))
    assert relative_rmse(picture.image(), exact) < 0.1 * relative_rmse(start, exact)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_a_lamp_with_an_extent_is_followed_by_few_samples(gathered):
    kind = {"kind": "rectangle", "direction": [0, -1, 0], "size": [0.3, 0.3], "emission": [30.0, 30.0, 30.0]}
    looks = [lamp_at(gathered, x, **kind) for x in (-0.5, 0.4)]
    picture = follow_lamp(gathered, *looks)
    start, exact = (exact_image(gathered, look) for look in looks)
    assert relative_rmse(picture.image(), exact) < 0.25 * relative_rmse(start, exact)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_a_lamp_moved_where_only_direct_light_was_baked_needs_no_rows(corner, tmp_path):
    direct = bake_corner_scene(corner, "direct", tmp_path)
    looks = [lamp_at(direct, x) for x in (-0.5, 0.4)]
    picture, exact = follow_lamp(direct, *looks), exact_image(direct, looks[-1])
    np.testing.assert_allclose(picture.image(), exact, rtol=1e-3, atol=1e-4)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_a_lamp_put_back_is_exact_at_once(gathered):
    looks = [lamp_at(gathered, x) for x in (-0.5, 0.4)]
    picture = follow_lamp(gathered, *looks)
    picture.set_look(looks[0])
    assert picture.advance(32).exact
    np.testing.assert_array_equal(picture.image(), exact_image(gathered, looks[0]))


def test_where_the_cache_has_no_room_light_is_glimpsed(gathered):
    picture = run_until_exact(Picture(gathered, "front", Cache(300_000)))
    picture.set_look(colored(gathered, [0.1, 0.1, 0.8]))
    picture.advance(32)
    assert isinstance(picture.next_job(), SparsePreview)


def test_a_direct_bake_has_nothing_to_follow(corner, tmp_path):
    direct = bake_corner_scene(corner, "direct", tmp_path)
    picture = run_until_exact(Picture(direct, "front", Cache(BUDGET)))
    picture.prepare(RED)
    assert picture.next_job() is None
    picture.set_look(colored(direct, [0.1, 0.1, 0.8], bounces=2))
    assert picture.advance(32).exact
    assert picture.next_job() is None


def test_rows_of_a_term_whose_own_curve_moves_are_not_made_at_every_edit(gathered, prepared):
    def draw(document):
        document["materials"]["Blue"]["terms"][0]["params"]["sigma"] = 0.9

    prepared.set_look(make_look(gathered, draw))
    prepared.advance(32)
    assert not isinstance(prepared.next_job(), PrecomputeRows)


def test_a_lamp_just_added_is_exact_before_anything_is_made_for_moving_it(gathered):
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))
    picture.set_look(lamp_at(gathered, 0.4))
    picture.advance(32)
    picture.prepare("/lights/Lamp")
    made = []
    while not picture.advance(None).exact:
        made.append(run_next_job(picture))
    assert made
    assert not any(isinstance(need, PrecomputeRows) for need in made)
    assert isinstance(picture.next_job(), PrecomputeRows)


def test_only_the_part_of_light_that_an_edit_changes_is_shaded(gathered, monkeypatch):
    def shown(x=0.43, **transport):  # no other test has shown it: images of looks stay beside a bake
        light = {"kind": "point", "position": [x, 0.8, 0.2], "emission": [3.0, 2.5, 2.0]}
        return make_look(gathered, lambda d: (d["lights"].update(Lamp=light), d["transport"].update(transport)))

    def shaded(look):
        """What has been shaded when the picture rests in a look: whether of the environment, and kinds of rays."""
        calls.clear()
        picture.set_look(look)
        run_until_exact(picture)
        return {(lights.num_lights > 0, *(type(r).__name__ for r in receivers.rays)) for lights, receivers in calls}

    class Recorded(PartialImage):
        def shade(self, term, bands, lights, receivers, *watched):
            calls.append((lights, receivers))
            super().shade(term, bands, lights, receivers, *watched)

    calls = []
    monkeypatch.setattr("relume.live.fixed_camera.jobs.PartialImage", Recorded)
    picture = Picture(gathered, "front", Cache(BUDGET))
    environment, local, reflected = (True,), (False, "LocalRays"), (False, "GatherRays")
    assert shaded(shown()) == {environment, local, reflected}
    assert shaded(shown(show="direct")) == set()
    assert shaded(shown(show="first_bounce")) == {reflected}
    assert shaded(shown(bounces=1)) == set()
    assert shaded(shown(bounces=3)) == {reflected}
    assert shaded(shown(0.13, bounces=3)) == {local, reflected}
