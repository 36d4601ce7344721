"""Lights from target images: known lights come back, and targets that no light can reach are reported."""

from __future__ import annotations

import numpy as np
import pytest

from relume.core.errors import ParameterError, ShapeMismatchError
from relume.inverse_lighting.match_lights import match_lights
from relume.inverse_lighting.painting import PaintedTarget, Region, Stroke, brush_mask, painted_target
from relume.inverse_lighting.solve import Target
from relume.inverse_lighting.sources import Sources, merge_changes, replace_operations

SIZE = HEIGHT, WIDTH = 30, 40
POINTERS = ("/environment", "/lights/A", "/lights/B", "/lights/C", "/lights/D")


def make_sources(intensities=(1.0, 1.0, 1.0, 1.0, 1.0), colors=None, *, seed=0):
    """Smooth images of an environment and four lights in different places."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    spots = [np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / 60) for cx, cy in ((5, 5), (35, 5), (5, 25), (35, 25))]
    albedo = rng.uniform(0.2, 0.9, (3, 1, HEIGHT, WIDTH))
    images = albedo * np.stack([np.full((HEIGHT, WIDTH), 0.2), *spots])
    colors = np.ones((5, 3)) if colors is None else np.asarray(colors, float)
    constant = np.full((HEIGHT, WIDTH, 3), 0.01, np.float32)
    return Sources(POINTERS, images.astype(np.float32), constant, np.asarray(intensities, float), colors)


def whole(radiance, weights=None):
    """A target in which all pixels count equally."""
    weights = np.ones(SIZE, np.float32) if weights is None else weights
    return PaintedTarget(Target(radiance, weights), (Region("reference", weights),))


def strengths_after(sources, match):
    """Strength of each source after the changes of a match."""
    return np.array(
        [
            match.changes.get(pointer, {}).get("intensity", intensity)
            * np.asarray(match.changes.get(pointer, {}).get("color", color))
            for pointer, intensity, color in zip(sources.pointers, sources.intensities, sources.colors, strict=True)
        ]
    )


def test_known_intensities_and_colors_come_back():
    sources, rng = make_sources(), np.random.default_rng(1)
    wanted = rng.uniform(0.1, 3.0, (5, 3))
    match = match_lights(sources, whole(sources.image(wanted)), ridge=1e-8)
    np.testing.assert_allclose(strengths_after(sources, match), wanted, rtol=1e-3)
    assert match.residual < 1e-4 < match.residual_before


def test_noise_of_two_percent_leaves_an_error_of_the_picture_below_one_percent():
    sources, rng = make_sources(), np.random.default_rng(2)
    exact = sources.image(rng.uniform(0.1, 3.0, (5, 3)))
    noisy = (exact * (1 + 0.02 * rng.standard_normal(exact.shape))).astype(np.float32)
    match = match_lights(sources, whole(noisy))
    image = sources.image(strengths_after(sources, match))
    assert np.linalg.norm(image - exact) < 0.01 * np.linalg.norm(exact)
    assert match.residual == pytest.approx(0.02, rel=0.1)


def test_intensities_alone_keep_the_colors():
    colors = [[1, 1, 1], [1, 0.5, 0.25], [0.2, 0.6, 1], [1, 1, 1], [0, 0, 1]]
    sources = make_sources(colors=colors)
    wanted = np.array([0.5, 2.0, 3.0, 0.0, 1.5])
    match = match_lights(sources, whole(sources.image(wanted[:, None] * colors)), changes_color=False, ridge=1e-8)
    assert all(set(change) == {"intensity"} for change in match.changes.values())
    np.testing.assert_allclose(strengths_after(sources, match), wanted[:, None] * colors, rtol=1e-3, atol=1e-3)


def test_the_largest_component_of_a_color_stays():
    sources = make_sources(colors=np.full((5, 3), 0.5))
    match = match_lights(sources, whole(sources.image(np.full((5, 3), [2.0, 1.0, 0.5]))), ridge=1e-8)
    for change in match.changes.values():
        np.testing.assert_allclose(change["color"], [0.5, 0.25, 0.125], rtol=1e-3)
        assert change["intensity"] == pytest.approx(4.0, rel=1e-3)


def test_brighter_by_a_stop_doubles_the_only_light_there():
    sources = dim_except(make_sources((0.0, 1.0, 1.0, 1.0, 1.0)), 1)
    stroke = Stroke("brighter", brush_mask([(5.5, 5.5)], 4, (WIDTH, HEIGHT)), 1.0)
    target = painted_target([stroke], sources.image(sources.strengths))
    match = match_lights(sources, target, {"/environment"}, changes_color=False)
    assert set(match.changes) == {"/lights/A"}
    assert match.changes["/lights/A"]["intensity"] == pytest.approx(2.0, rel=0.01)
    assert match.residual < 0.01
    assert match.shortfalls == ()


def dim_except(sources, lit):
    """The sources without a constant; only one of them reaches the left top quarter, and that one nothing else."""
    quarter = np.zeros(SIZE, bool)
    quarter[: HEIGHT // 2, : WIDTH // 2] = True
    for k in range(len(POINTERS)):
        sources.images[:, k] *= quarter == (k == lit)
    sources.constant[:] = 0.0
    return sources


def test_a_color_keeps_the_luminance():
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    sources = Sources(POINTERS, np.tile(sources.images[:1], (3, 1, 1, 1)), 0 * sources.constant, *vars_of(sources))
    stroke = Stroke("color", brush_mask([(5.5, 5.5)], 4, (WIDTH, HEIGHT)), color=(1.0, 0.25, 0.25))
    match = match_lights(sources, painted_target([stroke], sources.image(sources.strengths)), {"/environment"})
    strength = strengths_after(sources, match)[1]
    np.testing.assert_allclose(strength / strength[0], [1.0, 0.25, 0.25], rtol=0.05)
    assert strength @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0, rel=0.02)


def vars_of(sources):
    return sources.intensities, sources.colors


def test_locked_lights_stay():
    sources = make_sources()
    match = match_lights(sources, whole(sources.image(np.full((5, 3), 2.0))), {"/lights/A", "/environment"})
    assert not {"/lights/A", "/environment"} & set(match.changes)
    assert set(match.changes) == {"/lights/B", "/lights/C", "/lights/D"}


def test_all_locked_changes_nothing_and_says_so():
    sources = make_sources()
    stroke = Stroke("brighter", brush_mask([(5, 5)], 3, (WIDTH, HEIGHT)))
    match = match_lights(sources, painted_target([stroke], sources.image(sources.strengths)), POINTERS)
    assert match.changes == {}
    assert [(s.region, s.cause) for s in match.shortfalls] == [(0, "locked")]
    assert match.shortfalls[0].asked_stops == pytest.approx(1.0, abs=1e-3)
    assert match.shortfalls[0].reached_stops == 0.0
    assert match.residual == pytest.approx(0.5)


def test_a_part_that_no_light_reaches_says_so():
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    sources.images[:, :, 12:18] = 0.0
    stroke = Stroke("brighter", brush_mask([(20, 15)], 2, (WIDTH, HEIGHT)))
    match = match_lights(sources, painted_target([stroke], sources.image(sources.strengths)))
    assert match.changes == {}
    assert [s.cause for s in match.shortfalls] == ["no_light"]


def test_contrary_strokes_in_equal_light_are_a_conflict():
    sources = make_sources((1.0, 0.0, 0.0, 0.0, 0.0))
    left, right = (brush_mask([(x, 15)], 5, (WIDTH, HEIGHT)) for x in (8, 32))
    target = painted_target(
        [Stroke("brighter", left, 2.0), Stroke("darker", right, 2.0)], sources.image(sources.strengths)
    )
    match = match_lights(sources, target, POINTERS[1:])
    assert [s.cause for s in match.shortfalls] == ["conflict", "conflict"]


def test_pixels_outside_of_strokes_hold_their_light():
    """Light B also reaches the stroke, a little; A does most of it, because B would change its own surroundings."""
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    stroke = Stroke("brighter", brush_mask([(15, 5)], 3, (WIDTH, HEIGHT)), 1.0)
    match = match_lights(sources, painted_target([stroke], sources.image(sources.strengths)), {"/environment"})
    changes = strengths_after(sources, match).max(axis=-1) - 1.0
    assert changes[1] > 5 * abs(changes[3:]).max()


def test_no_light_is_turned_off_to_make_up_for_a_brighter_one():
    """B lights what A also lights besides the stroke: the unpainted pixels alone would turn B off."""
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    sources.images[:, 1] += 0.5 * sources.images[:, 2]
    stroke = Stroke("brighter", brush_mask([(5.5, 5.5)], 4, (WIDTH, HEIGHT)), 2.0)
    match = match_lights(
        sources, painted_target([stroke], sources.image(sources.strengths)), {"/environment"}, changes_color=False
    )
    assert set(match.changes) == {"/lights/A"}
    assert match.changes["/lights/A"]["intensity"] == pytest.approx(4.0, rel=0.1)


def test_a_darker_stroke_turns_no_light_up():
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    sources.images[:, 1] += 0.5 * sources.images[:, 2]
    stroke = Stroke("darker", brush_mask([(5.5, 5.5)], 4, (WIDTH, HEIGHT)), 1.0)
    match = match_lights(sources, painted_target([stroke], sources.image(sources.strengths)), {"/environment"})
    assert match.changes["/lights/A"]["intensity"] == pytest.approx(0.5, rel=0.1)
    assert (strengths_after(sources, match) <= sources.strengths + 1e-6).all()


def test_lights_that_a_stroke_cannot_tell_apart_change_by_their_share():
    """The least sum of squared relative changes δ with Σ p δ = 1, for shares p of 1/3 and 2/3, is δ = p / Σ p²."""
    sources = make_sources((0.0, 0.5, 1.0, 1.0, 1.0))
    sources.images[:, 2] = sources.images[:, 1]
    sources.images[:, 3:] = sources.constant[:] = 0.0
    target = painted_target([Stroke("brighter", np.ones(SIZE, np.float32), 1.0)], sources.image(sources.strengths))
    match = match_lights(sources, target, {"/environment"}, changes_color=False, ridge=1e-5)
    intensities = {pointer: change["intensity"] for pointer, change in match.changes.items()}
    assert intensities == {"/lights/A": pytest.approx(0.8, rel=0.01), "/lights/B": pytest.approx(2.2, rel=0.01)}


def test_a_stroke_turns_up_a_light_at_0_that_alone_reaches_it():
    sources = dim_except(make_sources((0.0, 0.0, 1.0, 1.0, 1.0)), 1)
    sources.constant[: HEIGHT // 2, : WIDTH // 2] = sources.images[:, 1, : HEIGHT // 2, : WIDTH // 2].transpose(1, 2, 0)
    stroke = Stroke("brighter", brush_mask([(5.5, 5.5)], 4, (WIDTH, HEIGHT)), 1.0)
    target = painted_target([stroke], sources.image(sources.strengths))
    match = match_lights(sources, target, {"/environment"}, changes_color=False)
    assert match.changes == {"/lights/A": {"intensity": pytest.approx(1.0, rel=0.02)}}


def test_later_strokes_paint_over_earlier_ones():
    image = np.ones((*SIZE, 3), np.float32)
    mask = np.ones(SIZE, np.float32)
    target = painted_target([Stroke("brighter", mask, 2.0), Stroke("darker", mask, 1.0)], image)
    np.testing.assert_allclose(target.target.radiance, 2.0)
    assert not target.regions[0].weights.any()


def test_twin_lights_share_a_change():
    sources = make_sources()
    sources.images[:, 2] = sources.images[:, 1]
    match = match_lights(sources, whole(sources.image(np.array([1.0, 3.0, 3.0, 1.0, 1.0])[:, None] * np.ones(3))))
    np.testing.assert_allclose(strengths_after(sources, match)[1:3], 3.0, rtol=0.01)


def test_a_black_light_stays():
    sources = make_sources((1.0, 0.7, 1.0, 1.0, 1.0))
    sources.images[:, 1] = 0.0
    match = match_lights(sources, whole(sources.image(np.full((5, 3), 2.0))))
    assert "/lights/A" not in match.changes
    np.testing.assert_allclose(strengths_after(sources, match)[[0, 2, 3, 4]], 2.0, rtol=0.01)


def test_lights_of_very_different_brightness_are_solved_alike():
    sources = make_sources()
    sources.images[:, 1] *= 1e-5
    sources.images[:, 2] *= 1e5
    wanted = np.array([1.0, 2e3, 2e-3, 1.0, 1.0])[:, None] * np.ones(3)
    match = match_lights(sources, whole(sources.image(wanted)), ridge=1e-8)
    assert match.residual < 0.01


def test_intensities_end_at_the_limit_of_a_look():
    sources = make_sources((0.0, 1.0, 1.0, 1.0, 1.0))
    match = match_lights(sources, whole(sources.image(np.full((5, 3), 1e6))))
    assert max(change["intensity"] for change in match.changes.values()) == pytest.approx(1e4)
    assert match.shortfalls


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_finite_have_no_weight(value):
    sources = make_sources()
    radiance = sources.image(np.full((5, 3), 2.0))
    radiance[:10] = value
    match = match_lights(sources, whole(radiance), ridge=1e-8)
    np.testing.assert_allclose(strengths_after(sources, match), 2.0, rtol=1e-3)
    assert match.residual < 1e-4


def test_a_negative_target_is_black():
    sources = make_sources()
    match = match_lights(sources, whole(np.full((*SIZE, 3), -5.0, np.float32)))
    np.testing.assert_allclose(strengths_after(sources, match), 0.0, atol=0.01)


@pytest.mark.parametrize("strokes", [[], [Stroke("brighter", np.zeros(SIZE, np.float32))]])
def test_without_marked_pixels_nothing_changes(strokes):
    sources = make_sources()
    match = match_lights(sources, painted_target(strokes, sources.image(sources.strengths)))
    assert (match.changes, match.residual, match.shortfalls) == ({}, 0.0, ())


def test_a_target_of_another_size_is_an_error():
    sources = make_sources()
    with pytest.raises(ShapeMismatchError, match="resize"):
        match_lights(sources, whole(np.ones((5, 5, 3), np.float32), np.ones((5, 5), np.float32)))


@pytest.mark.parametrize("weight", [-1.0, np.nan])
def test_weights_are_numbers_of_at_least_zero(weight):
    sources = make_sources()
    with pytest.raises(ParameterError, match="at least 0"):
        match_lights(sources, whole(sources.constant, np.full(SIZE, weight, np.float32)))


def test_a_reference_stroke_needs_a_picture():
    with pytest.raises(ParameterError, match="reference picture"):
        painted_target([Stroke("reference", np.ones(SIZE, np.float32))], np.ones((*SIZE, 3), np.float32))


def test_brush_masks_cover_the_line():
    mask = brush_mask([(10, 10), (30, 10)], 3, (WIDTH, HEIGHT))
    assert mask[10, 20] == mask[8, 10] == 1.0
    assert mask[15, 20] == mask[10, 35] == 0.0
    assert brush_mask([(-1e6, 5.0)], 3, (WIDTH, HEIGHT)).sum() == 0.0
    assert brush_mask([(7.2, 5.9)], 0.01, (WIDTH, HEIGHT))[5, 7] == 1.0


def test_changes_are_merged_into_a_partial_look():
    partial = {"lights": {"A/1": {"kind": "point", "intensity": 1.0}}}
    operations = replace_operations({"/lights/A~11": {"intensity": 2.0}, "/environment": {"color": [1, 0, 0]}})
    assert merge_changes(partial, operations) == {
        "lights": {"A/1": {"kind": "point", "intensity": 2.0}}, "environment": {"color": [1, 0, 0]}
    }  # fmt: skip
    assert partial["lights"]["A/1"]["intensity"] == 1.0
