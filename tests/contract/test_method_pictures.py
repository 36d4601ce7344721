"""Requirements on pictures of every fixed-camera method: precomputation and frames.

Any sequence of edits converges to the picture that is shaded anew; light is additive, and no light is black;
rejected and undone edits leave no trace.
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
ADDED = 1000  # upper bound of the lights, rays and columns summed per sample
ROUNDED = np.sqrt(ADDED) * UNIT  # error of a sum whose roundings are independent, relative, root mean square


def converged(transfer, *changes, cache=None, **options):
    """A converged picture."""
    picture = Picture(transfer, "front", cache or Cache(BUDGET), **options)
    picture.set_look(make_look(transfer, add_lights(*changes)))
    return run_until_exact(picture)


def edited(picture, transfer, pointer, *changes):
    """Prepare a pointer, apply edits, and converge."""
    if pointer is not None:
        picture.prepare(pointer)
        run_until_exact(picture)
    picture.set_look(make_look(transfer, add_lights(*changes)))
    picture.advance(8)
    return run_until_exact(picture)


@pytest.mark.parametrize("edit", MARKED_EDITS)
def test_every_update_strategy_converges_to_shading_anew(transfer, edit):
    pointer, change = EDITS[edit]
    picture = edited(converged(transfer), transfer, pointer, change)
    assert relative_rmse(picture.image(), exact_image(transfer, make_look(transfer, add_lights(change)))) < ROUNDED


@pytest.mark.parametrize("edit", MARKED_EDITS)
def test_undone_edit_leaves_no_trace(transfer, edit):
    pointer, change = EDITS[edit]
    picture = converged(transfer)
    before = picture.image()
    during = edited(picture, transfer, pointer, change).image()
    after = edited(picture, transfer, None).image()
    np.testing.assert_allclose(after, before, rtol=0, atol=ROUNDED * max(before.max(), during.max()))


def test_watched_picture_converges_to_the_same_image(transfer):
    look = make_look(transfer, add_lights(edit_environment(rotation=77.0)))
    picture = converged(transfer, edit_environment(rotation=77.0), is_watched=True)
    np.testing.assert_array_equal(picture.image(), exact_image(transfer, look))


def test_no_light_is_black(transfer):
    picture = converged(transfer)
    before = picture.image()
    dark = add_lights(
        edit_environment(intensity=0.0), edit_light("Bulb", enabled=False), edit_light("Panel", intensity=0.0)
    )
    picture.set_look(make_look(transfer, dark))
    assert not run_until_exact(picture).image().any()
    picture.set_look(make_look(transfer, add_lights()))
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_doubled_light_doubles_the_picture(transfer):
    picture = converged(transfer)
    before = picture.image()
    twice = (edit_environment(intensity=2.0), edit_light("Bulb", intensity=2.0), edit_light("Panel", intensity=2.0))
    np.testing.assert_array_equal(edited(picture, transfer, None, *twice).image(), 2 * before)
    np.testing.assert_array_equal(exact_image(transfer, make_look(transfer, add_lights(*twice))), 2 * before)


def test_solo_pictures_sum_to_the_whole(transfer):
    picture = converged(transfer)
    whole, total = picture.image(), np.zeros_like(picture.image())
    for source in (*LIGHTS, None) if EditAxis.LIGHT in transfer.axes else (None,):
        off = [edit_light(name, enabled=False) for name in LIGHTS if name != source]
        alone = edited(picture, transfer, None, *off, edit_environment(intensity=float(source is None))).image()
        assert alone.any()
        total += alone
    np.testing.assert_allclose(total, whole, rtol=ADDED * UNIT)


NUM_STEPS, A_STEP = 200, 32  # of the drag, and coefficients of each


def test_highlight_dragged_to_both_ends_and_back_leaves_no_trace(transfer):
    picture = converged(transfer)
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
def test_invalid_pointers_are_rejected_without_change(transfer, pointer):
    picture = converged(transfer)
    before = picture.image()
    with pytest.raises(ParameterError):
        picture.prepare(pointer)
    assert not has_pending_job(picture)
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


def many_terms(document):
    for material in document["materials"].values():
        material["terms"] = [{"model": "lambert", "color": [0.1, 0.1, 0.1], "texture": None}] * 16


def test_edits_over_the_budget_are_rejected_without_change(transfer):
    rows = [transfer.views["front"].rows(k) for k in range(len(transfer.material_names))]
    picture = converged(transfer, cache=(cache := Cache(12 * sum(shaded_bytes(r.stop - r.start) for r in rows))))
    before, used = picture.image(), cache.used_bytes
    with pytest.raises(MemoryBudgetError):
        picture.check(make_look(transfer, add_lights(many_terms)))
    assert (has_pending_job(picture), cache.used_bytes) == (False, used)
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


@pytest.mark.parametrize("pointer", [LOBE, EXPONENT])
def test_picture_is_shaded_if_no_operator_fits(transfer, pointer):
    views, index = transfer.views["front"], transfer.material_names.index("Wall")
    rows = views.rows(index)
    picture = converged(transfer, cache=Cache(operator_bytes(rows.stop - rows.start, 64)))
    actual = edited(picture, transfer, pointer, draw_curve).image()
    assert relative_rmse(actual, exact_image(transfer, make_look(transfer, add_lights(draw_curve)))) < ROUNDED


def test_missing_environment_is_rejected_without_change(transfer):
    picture = converged(transfer)
    before = picture.image()
    look = make_look(transfer, add_lights(set_floor_color))
    gone = look.environment.model_copy(update={"map": "env:0123456789abcdef"})
    with pytest.raises(NotFoundError):
        picture.set_look(look.model_copy(update={"environment": gone}))
    assert not has_pending_job(picture)
    np.testing.assert_array_equal(picture.image(), before)


def skip_without_reference(transfer):
    """Skip methods with their own light, such as the tests' furnace."""
    if EditAxis.LIGHT not in transfer.axes:
        pytest.skip(f"brute force follows light from its sources; {transfer.method} has none")


def test_direct_light_matches_the_reference(scene, transfer, recipe):
    """The reference shades each texel at exact angles; environment triangles and banded curves differ by 2%."""
    skip_without_reference(transfer)
    look = make_look(transfer, add_lights(edit_light("Panel", enabled=False), edit_transport(show="direct")))
    reference = reference_image(scene, "front", look, recipe.size, 0)
    assert relative_rmse(exact_image(transfer, look), reference) < 0.03


OFF = pytest.mark.parametrize(
    "off", [edit_environment(intensity=0.0), edit_light("Bulb", enabled=False)], ids=["of a light", "of the map"]
)


def reference_mean(scene, look, recipe, reflects, num_passes=8):
    """Mean of the reference picture and its standard error. (3,) each"""
    passes = [
        reference_image(scene, "front", look, recipe.size, 64, pass_index=k, reflects=reflects)
        for k in range(num_passes)
    ]
    means = np.mean(passes, axis=(1, 2))
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))


@OFF
def test_indirect_light_of_diffuse_surfaces_matches_the_reference(scene, transfer, recipe, off):
    """Picture means agree to one percent plus the path noise; methods without bounces give zero."""
    skip_without_reference(transfer)
    look = make_look(
        transfer,
        add_lights(edit_light("Panel", enabled=False), off, remove_glossy_term, edit_transport(show="first_bounce")),
    )
    actual = exact_image(transfer, look).mean(axis=(0, 1))
    assert np.all((actual > 0) == has_bounces(transfer))
    expected, deviation = reference_mean(scene, look, recipe, has_bounces(transfer))
    assert np.all(deviation <= 0.05 * expected)
    assert np.all(np.abs(actual - expected) <= 4 * deviation + 0.01 * expected)


@OFF
def test_indirect_light_of_highlights_is_close_to_the_reference(scene, transfer, recipe, off):
    """Highlights reflect uniformly, so one seventh may go elsewhere; without them a third would be missing."""
    skip_without_reference(transfer)
    if not has_bounces(transfer):
        pytest.skip(f"{transfer.method} has no indirect light")
    lights = edit_light("Panel", enabled=False), off, edit_transport(show="first_bounce")
    look = make_look(transfer, add_lights(*lights))
    (expected, deviation), (sent_by_matt, _) = (
        reference_mean(scene, each, recipe, True, 4)
        for each in (look, make_look(transfer, add_lights(*lights, remove_glossy_term)))
    )
    actual = exact_image(transfer, look).mean(axis=(0, 1))
    assert np.all(sent_by_matt < 0.67 * expected)
    assert np.all(np.abs(actual - expected) <= 4 * deviation + 0.15 * expected)
