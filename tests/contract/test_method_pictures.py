"""What every transfer method's pictures promise, however it stores transport: clauses for freeze and frame.

Whatever way a picture has come to rest, it shows what shading from nothing shows; light adds up, and none is black;
what is refused or undone leaves no trace.
"""

import numpy as np
import pytest
from exact_pictures import exact_image
from look_edits import (
    EDITS,
    EXPONENT,
    LIGHTS,
    LOBE,
    MARKED_EDITS,
    add_lights,
    draw_curve,
    edit_environment,
    edit_light,
    edit_transport,
    remove_glossy_term,
    set_exponent,
    set_floor_color,
)
from session_edits import BUDGET, has_bounces, has_pending_job, make_look, relative_rmse, run_until_exact

from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.core.errors import MemoryBudgetError, NotFoundError, ParameterError
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import EditAxis
from relume.operators.linear_operator import operator_bytes
from relume.operators.shade import shaded_bytes
from relume.reference import reference_image

UNIT = 2.0**-24  # the relative error of one operation in float32
ADDED = 1000  # lights, rays and columns that a sample's radiance is summed of, at most
ROUNDED = np.sqrt(ADDED) * UNIT  # error of a sum whose roundings are independent, relative, root mean square


def live(transfer, *changes, cache=None, **options):
    """A picture at rest."""
    picture = Picture(transfer, "front", cache or Cache(BUDGET), **options)
    picture.set_look(make_look(transfer, add_lights(*changes)))
    return run_until_exact(picture)


def edited(picture, transfer, pointer, *changes):
    """What a hand touches is made ready; then it edits, and rests."""
    if pointer is not None:
        picture.prepare(pointer)
        run_until_exact(picture)
    picture.set_look(make_look(transfer, add_lights(*changes)))
    picture.advance(8)
    return run_until_exact(picture)


@pytest.mark.parametrize("edit", MARKED_EDITS)
def test_any_way_to_rest_is_shading_from_nothing(transfer, edit):
    pointer, change = EDITS[edit]
    picture = edited(live(transfer), transfer, pointer, change)
    assert relative_rmse(picture.image(), exact_image(transfer, make_look(transfer, add_lights(change)))) < ROUNDED


@pytest.mark.parametrize("edit", MARKED_EDITS)
def test_an_edit_undone_leaves_no_trace(transfer, edit):
    pointer, change = EDITS[edit]
    picture = live(transfer)
    before = picture.image()
    during = edited(picture, transfer, pointer, change).image()
    after = edited(picture, transfer, None).image()
    np.testing.assert_allclose(after, before, rtol=0, atol=ROUNDED * max(before.max(), during.max()))


def test_a_watched_picture_comes_to_rest_like_any_other(transfer):
    look = make_look(transfer, add_lights(edit_environment(rotation=77.0)))
    picture = live(transfer, edit_environment(rotation=77.0), is_watched=True)
    np.testing.assert_array_equal(picture.image(), exact_image(transfer, look))


def test_no_light_is_black(transfer):
    picture = live(transfer)
    before = picture.image()
    dark = add_lights(
        edit_environment(intensity=0.0), edit_light("Lamp", enabled=False), edit_light("Panel", intensity=0.0)
    )
    picture.set_look(make_look(transfer, dark))
    assert not run_until_exact(picture).image().any()
    picture.set_look(make_look(transfer, add_lights()))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_twice_the_light_is_twice_the_picture(transfer):
    picture = live(transfer)
    before = picture.image()
    twice = (edit_environment(intensity=2.0), edit_light("Lamp", intensity=2.0), edit_light("Panel", intensity=2.0))
    np.testing.assert_array_equal(edited(picture, transfer, None, *twice).image(), 2 * before)
    np.testing.assert_array_equal(exact_image(transfer, make_look(transfer, add_lights(*twice))), 2 * before)


def test_solos_of_all_sources_sum_to_the_whole(transfer):
    picture = live(transfer)
    whole, total = picture.image(), np.zeros_like(picture.image())
    for source in (*LIGHTS, None) if EditAxis.LIGHT in transfer.axes else (None,):
        off = [edit_light(name, enabled=False) for name in LIGHTS if name != source]
        alone = edited(picture, transfer, None, *off, edit_environment(intensity=float(source is None))).image()
        assert alone.any()
        total += alone
    np.testing.assert_allclose(total, whole, rtol=ADDED * UNIT)


NUM_STEPS, A_STEP = 200, 32  # of the drag, and coefficients of each


def test_a_highlight_dragged_to_both_ends_and_back_leaves_no_trace(transfer):
    picture = live(transfer)
    picture.prepare(LOBE)
    run_until_exact(picture)
    (declared,) = TERMS["blinn_phong"].parameters
    down = np.geomspace(declared.maximum, declared.minimum, NUM_STEPS // 2)
    for value in (*down, *down[::-1]):
        picture.set_look(make_look(transfer, add_lights(set_exponent(value))))
        picture.advance(A_STEP)
    picture.set_look(make_look(transfer, add_lights()))
    rounded = np.sqrt(NUM_STEPS * A_STEP) * UNIT
    assert (
        relative_rmse(run_until_exact(picture).image(), exact_image(transfer, make_look(transfer, add_lights())))
        < rounded
    )


@pytest.mark.parametrize(
    "pointer",
    [
        "/materials/Nowhere/terms/0/curves/theta_h",
        "/materials/Wall/terms/7/curves/theta_h",
        "/materials/Wall/terms/1/curves/nonsense",
        "/materials/Wall/terms/1/params/nonsense",
        "nonsense",
    ],
)
def test_what_points_to_nothing_is_refused_and_changes_nothing(transfer, pointer):
    picture = live(transfer)
    before = picture.image()
    with pytest.raises(ParameterError):
        picture.prepare(pointer)
    assert not has_pending_job(picture)
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


def many_terms(document):
    for material in document["materials"].values():
        material["terms"] = [{"model": "lambert", "color": [0.1, 0.1, 0.1], "texture": None}] * 16


def test_what_fits_no_budget_is_refused_and_changes_nothing(transfer):
    rows = [transfer.views["front"].rows(k) for k in range(len(transfer.material_names))]
    picture = live(transfer, cache=(cache := Cache(12 * sum(shaded_bytes(r.stop - r.start) for r in rows))))
    before, used = picture.image(), cache.used_bytes
    with pytest.raises(MemoryBudgetError):
        picture.check(make_look(transfer, add_lights(many_terms)))
    assert (has_pending_job(picture), cache.used_bytes) == (False, used)
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


@pytest.mark.parametrize("pointer", [LOBE, EXPONENT])
def test_where_no_operator_fits_a_picture_is_shaded(transfer, pointer):
    views, index = transfer.views["front"], transfer.material_names.index("Wall")
    rows = views.rows(index)
    picture = live(transfer, cache=Cache(operator_bytes(rows.stop - rows.start, 64)))
    actual = edited(picture, transfer, pointer, draw_curve).image()
    assert relative_rmse(actual, exact_image(transfer, make_look(transfer, add_lights(draw_curve)))) < ROUNDED


def test_an_environment_that_is_not_here_is_refused_and_changes_nothing(transfer):
    picture = live(transfer)
    before = picture.image()
    look = make_look(transfer, add_lights(set_floor_color))
    gone = look.environment.model_copy(update={"map": "env:0123456789abcdef"})
    with pytest.raises(NotFoundError):
        picture.set_look(look.model_copy(update={"environment": gone}))
    assert not has_pending_job(picture)
    np.testing.assert_array_equal(picture.image(), before)


def brute_force_knows(transfer):
    """Skip where a method's light is its own, as that of the tests' furnace is."""
    if EditAxis.LIGHT not in transfer.axes:
        pytest.skip(f"brute force follows light from its sources; {transfer.method} has none")


def test_straight_light_is_that_of_brute_force(scene, transfer, recipe):
    """Every texel at exact angles; a hundred triangles for the environment, and curves in bands, are two per cent."""
    brute_force_knows(transfer)
    look = make_look(transfer, add_lights(edit_light("Panel", enabled=False), edit_transport(show="direct")))
    reference = reference_image(scene, "front", look, recipe.size, 0)
    assert relative_rmse(exact_image(transfer, look), reference) < 0.03


OFF = pytest.mark.parametrize(
    "off", [edit_environment(intensity=0.0), edit_light("Lamp", enabled=False)], ids=["of a lamp", "of the map"]
)


def followed(scene, look, recipe, reflects, num_passes=8):
    """The mean of a picture by brute force, and its standard error. (3,) each"""
    passes = [
        reference_image(scene, "front", look, recipe.size, 64, pass_index=k, reflects=reflects)
        for k in range(num_passes)
    ]
    means = np.mean(passes, axis=(1, 2))
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))


@OFF
def test_light_between_matt_surfaces_is_that_of_brute_force(scene, transfer, recipe, off):
    """The mean of the picture by a percent and the noise of paths; none where the method has none."""
    brute_force_knows(transfer)
    look = make_look(
        transfer,
        add_lights(edit_light("Panel", enabled=False), off, remove_glossy_term, edit_transport(show="first_bounce")),
    )
    actual = exact_image(transfer, look).mean(axis=(0, 1))
    assert np.all((actual > 0) == has_bounces(transfer))
    expected, deviation = followed(scene, look, recipe, has_bounces(transfer))
    assert np.all(deviation <= 0.05 * expected)
    assert np.all(np.abs(actual - expected) <= 4 * deviation + 0.01 * expected)


@OFF
def test_light_that_highlights_send_is_about_as_much_as_by_brute_force(scene, transfer, recipe, off):
    """It is spread evenly, so that a seventh may go elsewhere; a third would be missing if they sent none."""
    brute_force_knows(transfer)
    if not has_bounces(transfer):
        pytest.skip(f"{transfer.method} has no light between surfaces")
    lights = edit_light("Panel", enabled=False), off, edit_transport(show="first_bounce")
    look = make_look(transfer, add_lights(*lights))
    (expected, deviation), (sent_by_matt, _) = (
        followed(scene, each, recipe, True, 4)
        for each in (look, make_look(transfer, add_lights(*lights, remove_glossy_term)))
    )
    actual = exact_image(transfer, look).mean(axis=(0, 1))
    assert np.all(sent_by_matt < 0.67 * expected)
    assert np.all(np.abs(actual - expected) <= 4 * deviation + 0.15 * expected)
