"""Colors and bounces edited with indirect light: near exact at once, exact when the edit stops."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pictures import exact_image
from session_edits import BUDGET, bake_corner_scene, kind_of, make_look, relative_rmse, run_next_job, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.operators.shade import PartialImage

RED = "/materials/Red/terms/0/color"


def colored(transfer, color, **transport):
    """The look with another color of the red wall."""

    def change(document):
        document["materials"]["Red"]["terms"][0]["color"] = list(color)
        document["transport"].update(transport)

    return make_look(transfer, change)


@pytest.fixture
def prepared(gathered):
    """An exact picture prepared for an edit of the red wall's color."""
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))
    picture.prepare(RED)
    needs = []
    while picture.next_job() is not None:
        needs.append(run_next_job(picture))
    assert len(needs) == 4  # one of each term
    assert all(kind_of(need) == "rows" for need in needs)
    assert picture.advance(None).exact
    return picture


def test_color_bleeding_follows_a_dragged_color(gathered, prepared):
    before = prepared.image()
    for blue in (0.2, 0.5, 0.8):
        look = colored(gathered, [0.1, 0.1, blue])
        prepared.set_look(look)
        assert not prepared.advance(32).exact
        exact = exact_image(gathered, look)
        assert relative_rmse(prepared.image(), exact) < 0.01
        assert relative_rmse(before, exact) > 0.1
        need = prepared.next_job()
        assert kind_of(need) == "image"
        assert need.is_refinement  # runs when the edit stops


def test_the_picture_is_exact_when_the_edit_stops(gathered, prepared):
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
def test_the_number_of_bounces_is_followed(gathered, prepared, bounces):
    look = colored(gathered, [0.8, 0.1, 0.1], bounces=bounces)
    prepared.set_look(look)
    assert not prepared.advance(32).exact
    exact = exact_image(gathered, look)
    assert relative_rmse(prepared.image(), exact) < (0.04 if bounces == 0 else 0.01)  # see below
    np.testing.assert_array_equal(run_until_exact(prepared).image(), exact)


def test_indirect_light_appears_from_zero_bounces(gathered):
    """Rows are frozen without indirect light by which to rank coefficients."""
    picture = Picture(gathered, "front", Cache(BUDGET))
    picture.set_look(colored(gathered, [0.8, 0.1, 0.1], bounces=0))
    still = run_until_exact(picture).image()
    look = make_look(gathered)
    picture.set_look(look, active_pointer="/transport/bounces")
    while kind_of(picture.next_job()) == "rows":
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
    while kind_of(picture.next_job()) == "rows":
        errors.append(relative_rmse(picture.image(), exact))
        run_next_job(picture)
        picture.advance(32)
    errors.append(relative_rmse(picture.image(), exact))
    assert len(errors) == 5
    assert errors[-1] < 0.01 < errors[0]


def test_black_surfaces_leave_direct_light(gathered, prepared):
    def black(document):
        for material in document["materials"].values():
            material["terms"][0]["color"] = [0.0, 0.0, 0.0]

    look = make_look(gathered, black)
    prepared.set_look(look)
    prepared.advance(32)
    # directions of highlights are updated when the edit stops: 3 % of the former light here
    assert relative_rmse(prepared.image(), exact_image(gathered, look)) < 0.04


def test_a_diffuse_curve_edit_does_not_use_other_rows(gathered, prepared):
    """The wall's own term is shaded again; the light that it reflects onto others follows."""

    def draw(document):
        document["materials"]["Blue"]["terms"][0]["params"]["sigma"] = 0.9

    look = make_look(gathered, draw)
    prepared.set_look(look)
    prepared.advance(32)
    np.testing.assert_array_equal(run_until_exact(prepared).image(), exact_image(gathered, look))


def light_at(transfer, x, **others):
    """The look with a point light above the floor."""

    def change(document):
        light = {"kind": "point", "position": [x, 0.8, 0.2], "emission": [3.0, 2.5, 2.0], **others}
        document["lights"] = {"Lamp": light}

    return make_look(transfer, change)


def follow_light(transfer, *looks):
    """A picture that is exact in the first look, whose light is then dragged through the others."""
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


def test_a_moved_light_is_followed_with_shadows_and_indirect_light(gathered):
    looks = [light_at(gathered, x) for x in (-0.5, -0.2, 0.1, 0.4)]
    picture = follow_light(gathered, *looks)
    exact, start = (exact_image(gathered, look) for look in (looks[-1], looks[0]))
    assert relative_rmse(picture.image(), exact) < 0.1 * relative_rmse(start, exact)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_an_area_light_is_followed_with_few_samples(gathered):
    kind = {"kind": "rectangle", "direction": [0, -1, 0], "size": [0.3, 0.3], "emission": [30.0, 30.0, 30.0]}
    looks = [light_at(gathered, x, **kind) for x in (-0.5, 0.4)]
    picture = follow_light(gathered, *looks)
    start, exact = (exact_image(gathered, look) for look in looks)
    assert relative_rmse(picture.image(), exact) < 0.25 * relative_rmse(start, exact)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_a_moved_light_in_a_direct_bake_needs_no_rows(corner, tmp_path):
    direct = bake_corner_scene(corner, "direct", tmp_path)
    looks = [light_at(direct, x) for x in (-0.5, 0.4)]
    picture, exact = follow_light(direct, *looks), exact_image(direct, looks[-1])
    np.testing.assert_allclose(picture.image(), exact, rtol=1e-3, atol=1e-4)
    np.testing.assert_array_equal(run_until_exact(picture).image(), exact)


def test_a_light_moved_back_is_exact_at_once(gathered):
    looks = [light_at(gathered, x) for x in (-0.5, 0.4)]
    picture = follow_light(gathered, *looks)
    picture.set_look(looks[0])
    assert picture.advance(32).exact
    np.testing.assert_array_equal(picture.image(), exact_image(gathered, looks[0]))


def test_without_cache_memory_light_is_previewed(gathered):
    picture = run_until_exact(Picture(gathered, "front", Cache(300_000)))
    picture.set_look(colored(gathered, [0.1, 0.1, 0.8]))
    picture.advance(32)
    assert kind_of(picture.next_job()) == "preview"


def test_a_direct_bake_has_no_rows(corner, tmp_path):
    direct = bake_corner_scene(corner, "direct", tmp_path)
    picture = run_until_exact(Picture(direct, "front", Cache(BUDGET)))
    picture.prepare(RED)
    assert picture.next_job() is None
    picture.set_look(colored(direct, [0.1, 0.1, 0.8], bounces=2))
    assert picture.advance(32).exact
    assert picture.next_job() is None


def test_rows_of_an_edited_term_are_not_rebuilt_at_every_edit(gathered, prepared):
    def draw(document):
        document["materials"]["Blue"]["terms"][0]["params"]["sigma"] = 0.9

    prepared.set_look(make_look(gathered, draw))
    prepared.advance(32)
    assert kind_of(prepared.next_job()) != "rows"


def test_an_added_light_is_exact_before_it_is_prepared_for_dragging(gathered):
    picture = run_until_exact(Picture(gathered, "front", Cache(BUDGET)))
    picture.set_look(light_at(gathered, 0.4))
    picture.advance(32)
    picture.prepare("/lights/Lamp")
    made = []
    while not picture.advance(None).exact:
        made.append(run_next_job(picture))
    assert made
    assert not any(kind_of(need) == "rows" for need in made)
    assert kind_of(picture.next_job()) == "rows"


def test_only_changed_light_is_shaded(gathered, monkeypatch):
    def shown(x=0.43, **transport):  # unused by other tests: images of looks are stored with a bake
        light = {"kind": "point", "position": [x, 0.8, 0.2], "emission": [3.0, 2.5, 2.0]}
        return make_look(gathered, lambda d: (d["lights"].update(Lamp=light), d["transport"].update(transport)))

    def shaded(look):
        """Shading calls until the picture is exact: whether for the environment, and kinds of rays."""
        calls.clear()
        picture.set_look(look)
        run_until_exact(picture)
        return {(lights.num_lights > 0, *(type(r).__name__ for r in receivers.rays)) for lights, receivers in calls}

    class Recorded(PartialImage):
        def shade(self, term, bands, lights, receivers, *watched):
            calls.append((lights, receivers))
            super().shade(term, bands, lights, receivers, *watched)

    calls = []
    monkeypatch.setattr("relume.live.fixed_camera.strategies.shading.PartialImage", Recorded)
    picture = Picture(gathered, "front", Cache(BUDGET))
    environment, local, reflected = (True,), (False, "LocalRays"), (False, "GatherRays")
    assert shaded(shown()) == {environment, local, reflected}
    assert shaded(shown(show="direct")) == set()
    assert shaded(shown(show="first_bounce")) == {reflected}
    assert shaded(shown(bounces=1)) == set()
    assert shaded(shown(bounces=3)) == {reflected}
    assert shaded(shown(0.13, bounces=3)) == {local, reflected}
