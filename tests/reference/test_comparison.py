"""Comparison of a frame with a noisy reference: a correct frame passes despite heavy tails, errors are detected."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.assets.environments.equirect import texel_directions
from relume.core.color import luminance
from relume.look import default_look, validate
from relume.reference import reference_image
from relume.reference.comparison import FALSE_DISCOVERY_RATE, Comparison, Estimate, compare, error_map
from relume.scene.model import Material

SHAPE = (60, 80, 3)


def reference_image_of_ones() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.2, 2.0, SHAPE).astype(np.float32)


def added(passes) -> Estimate:
    total = Estimate.empty(*passes[0].shape[:2])
    for picture in passes:
        total = total.add(picture)
    return total


def estimate(passes: int, noise: float, seed: int = 2) -> Estimate:
    rng = np.random.default_rng(seed)
    return added(
        [
            (reference_image_of_ones() * (1 + noise * rng.standard_normal(SHAPE))).astype(np.float32)
            for _ in range(passes)
        ]
    )


def comparison_of(scale: float, passes: int = 8, noise: float = 0.05) -> Comparison:
    return compare((scale * reference_image_of_ones()).astype(np.float32), estimate(passes, noise))[0]


@pytest.mark.parametrize("passes", [2, 3, 4, 8, 32, 64])
def test_a_perfect_frame_differs_by_noise_only(passes: int) -> None:
    comparison = comparison_of(1.0, passes)
    assert comparison.noise == pytest.approx(0.05 / np.sqrt(passes), rel=0.05)
    assert comparison.rmse == pytest.approx(comparison.noise, rel=0.05)
    assert (comparison.error, comparison.significant_pixel_fraction) == (None, 0.0)
    assert comparison.error_upper_bound < comparison.noise * (1.5 if passes == 2 else 0.5)


def test_errors_below_the_noise_are_detected() -> None:
    comparison = comparison_of(1.01)
    assert comparison.noise > 0.015
    assert comparison.error == pytest.approx(0.01, rel=0.1)
    assert comparison.error < comparison.error_upper_bound < 1.2 * comparison.error
    assert comparison.significant_pixel_fraction > 0.9  # of blocks; single pixels are not significant


def test_more_passes_reduce_noise_and_keep_the_error() -> None:
    few, many = comparison_of(1.05, passes=4), comparison_of(1.05, passes=64)
    assert many.noise == pytest.approx(few.noise / 4, rel=0.1)
    assert many.error == pytest.approx(0.05, rel=0.02)
    assert many.error_upper_bound < few.error_upper_bound


def test_a_few_wrong_pixels_are_detected() -> None:
    frame = reference_image_of_ones()
    frame[10:13, 20:26] *= 2
    comparison, differs = compare(frame, estimate(16, 0.05))
    assert differs[10:13, 20:26].mean() > 0.9
    assert 18 / 4800 <= comparison.significant_pixel_fraction < 40 / 4800


def test_few_differences_are_false_positives() -> None:
    frame = reference_image_of_ones()
    frame[:, 32:] *= 1.1  # aligned with blocks
    differs = compare(frame, estimate(16, 0.1))[1]
    assert differs[:, 32:].mean() > 0.95
    # for each block size, and a block has many pixels
    assert differs[:, :32].sum() < 4 * FALSE_DISCOVERY_RATE * differs.sum()


def test_rounding_is_no_difference_from_a_noiseless_reference() -> None:
    comparison, _ = compare(reference_image_of_ones(), estimate(4, 0.0))
    assert (comparison.noise, comparison.error, comparison.significant_pixel_fraction) == (
        pytest.approx(0, abs=1e-6),
        None,
        0.0,
    )
    wrong = reference_image_of_ones()
    wrong[:4] *= 1.01
    comparison, differs = compare(wrong, estimate(4, 0.0))
    assert comparison.error == pytest.approx(
        0.01 * np.sqrt((reference_image_of_ones()[:4] ** 2).sum() / (reference_image_of_ones() ** 2).sum()), rel=1e-3
    )
    assert differs[:4].all()
    assert not differs[4:].any()


def test_a_black_reference_causes_no_division_by_zero() -> None:
    black = np.zeros(SHAPE, np.float32)
    nothing = added([black] * 4)
    comparison, differs = compare(black, nothing)
    assert comparison == Comparison(0.0, 0.0, None, None, 0.0, 0.0)
    assert np.all(error_map(black, nothing, differs) == error_map(black, nothing, differs)[0, 0])


def test_large_images_have_fewer_batches() -> None:
    assert len(Estimate.empty(480, 640).sums) == 16
    assert Estimate.empty(2048, 2048).sums.nbytes <= 256 << 20
    assert len(Estimate.empty(3000, 4000).sums) == 4


def test_the_error_map_is_gray_for_noise_and_colored_for_differences() -> None:
    frame = reference_image_of_ones()
    frame[:20] *= 1.5
    frame[40:] *= 0.6
    reference = estimate(16, 0.02)
    shown = error_map(frame, reference, compare(frame, reference)[1]).astype(int)
    warm, cold = shown[..., 0] - shown[..., 2] > 60, shown[..., 2] - shown[..., 0] > 60
    gray = shown.max(axis=-1) == shown.min(axis=-1)
    assert warm[:20].all()
    assert cold[40:].all()
    assert gray[24:36].mean() > 0.95


def sun_environment() -> np.ndarray:
    """A colored environment with a sun of 2.2°, ten thousand times as bright."""
    d = texel_directions(64, 128).astype(float)
    radiance = 0.4 + 0.3 * d[..., 1:2] * [0.6, 0.8, 1.0] + 0.15 * np.sin(9 * d[..., :1]) * [1.0, 0.5, 0.2]
    towards = np.array([-1, 1.2, 1.0]) / np.linalg.norm([-1, 1.2, 1.0])
    sun = (d @ towards > np.cos(np.radians(2.2)))[..., None] * np.array([3e3, 2.7e3, 2.2e3])
    return np.maximum(radiance + sun, 0).astype(np.float32)


def metals(roughness: float):
    """A metal ball and a coated ball on a floor."""
    metal = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": roughness, "f0": [0.9, 0.7, 0.4]}}
    coat = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": roughness, "f0": 0.04}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.5, 0.45, 0.4]},)),
        Material("Metal", (metal,)),
        Material("Coated", ({"model": "lambert", "color": [0.3, 0.05, 0.05]}, coat)),
    ]
    meshes = [
        quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0),
        sphere("ball", [-0.5, 0.5, 0], 0.5, 1, num_rings=24),
        sphere("small", [0.6, 0.4, 0.4], 0.4, 2, num_rings=24),
    ]
    camera = make_camera("front", [0.2, 1.2, 3], [0, 0.4, 0], 0.7)
    return make_tiny_scene(*meshes, camera=camera, environment=sun_environment(), materials=materials)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.06, 0.2, 0.5])  # at lower roughness, balls are mirrors and also show the floor
def test_frames_under_a_small_sun_are_judged_correctly(roughness: float) -> None:
    """A frame of the same reference with other random numbers and four times as many, against passes of few texels."""
    scene, size = metals(roughness), (40, 30)
    look = validate({}, default_look(scene.materials))
    frame = reference_image(scene, "front", look, size, 1024, pass_index=1_000)
    reference = added([reference_image(scene, "front", look, size, 16, pass_index=k) for k in range(16)])
    comparison, _ = compare(frame, reference)
    assert comparison.significant_pixel_fraction <= 0.01
    assert comparison.error is None or comparison.error < 0.01

    floor = {"terms": [{"model": "lambert", "color": [0.525, 0.4725, 0.42]}]}
    brighter = {"materials": {"Floor": floor}}
    of_brighter = validate(brighter, default_look(scene.materials))
    lit = reference_image(scene, "front", of_brighter, size, 1024, pass_index=1_000)
    of_floor = np.abs(lit - frame).max(axis=2) > 0.02 * frame.max(axis=2)
    differs = compare(lit, reference)[1]
    assert of_floor.mean() > 0.3
    assert differs[of_floor].mean() > 2 / 3  # a server samples four times as many texels

    shifted = frame.copy()
    ball = (slice(8, 22), slice(8, 19))
    shifted[ball] = np.roll(frame[ball], 1, axis=1)
    change, noise = np.abs(luminance(shifted) - luminance(frame)), luminance(reference.means).std(axis=0, ddof=1) / 4
    difference = (change > 6 * noise) & (change > 0.5 * luminance(frame))
    differs = compare(shifted, reference)[1]
    assert difference.sum() > 20
    assert differs[difference].mean() > 0.85
    differs[ball] = False
    assert differs.mean() < 0.01
