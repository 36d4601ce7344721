"""The judge of a frame: noise is told apart from error, and a biased frame is found out."""

import numpy as np
import pytest

from relume.reference.truth import SIGNIFICANCE, Comparison, Estimate, compare, error_map

SHAPE = (60, 80, 3)


def truth() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.2, 2.0, SHAPE).astype(np.float32)


def estimate(passes: int, noise: float, seed: int = 2) -> Estimate:
    rng = np.random.default_rng(seed)
    found = Estimate.nothing(*SHAPE[:2])
    for _ in range(passes):
        found = found.with_pass((truth() * (1 + noise * rng.standard_normal(SHAPE))).astype(np.float32))
    return found


def judged(scale: float, passes: int = 8, noise: float = 0.05) -> Comparison:
    return compare((scale * truth()).astype(np.float32), estimate(passes, noise))


def test_perfect_frame_differs_by_the_noise_alone() -> None:
    found = judged(1.0)
    assert found.noise == pytest.approx(0.05 / np.sqrt(8), rel=0.03)
    assert found.rmse == pytest.approx(found.noise, rel=0.03)
    assert found.error < 0.3 * found.noise
    # 4,800 pixels, each called different with probability 0.01: ± 4 standard deviations
    assert abs(found.significant - SIGNIFICANCE) < 4 * np.sqrt(SIGNIFICANCE / 4800)


def test_error_of_a_frame_is_found_below_the_noise() -> None:
    found = judged(1.01)
    assert found.noise > 0.01
    assert found.error == pytest.approx(0.01, rel=0.1)
    assert found.significant > 1.2 * SIGNIFICANCE


def test_more_passes_less_noise_same_error() -> None:
    few, many = judged(1.05, passes=4), judged(1.05, passes=64)
    assert many.noise == pytest.approx(few.noise / 4, rel=0.1)
    assert many.error == pytest.approx(0.05, rel=0.02)
    assert many.significant > few.significant


def test_truth_without_noise_calls_rounding_no_difference() -> None:
    found = compare(truth(), estimate(2, 0.0))
    assert found == Comparison(pytest.approx(0, abs=1e-7), 0.0, pytest.approx(0, abs=1e-7), 0.0)


def test_black_truth_is_compared_without_dividing_by_it() -> None:
    black = np.zeros(SHAPE, np.float32)
    nothing = Estimate.nothing(*SHAPE[:2]).with_pass(black).with_pass(black)
    assert compare(black, nothing) == Comparison(0.0, 0.0, 0.0, 0.0)
    assert np.all(error_map(black, nothing) == error_map(black, nothing)[0, 0])


def test_map_is_grey_where_noise_explains_and_coloured_where_not() -> None:
    frame = truth()
    frame[:20] *= 1.5
    frame[40:] *= 0.6
    shown = error_map(frame, estimate(16, 0.02)).astype(int)
    warm, cold = shown[..., 0] - shown[..., 2] > 60, shown[..., 2] - shown[..., 0] > 60
    grey = shown.max(axis=-1) == shown.min(axis=-1)
    assert warm[:20].all()
    assert cold[40:].all()
    assert grey[20:40].mean() > 0.95
