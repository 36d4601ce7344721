"""Standard errors of figures equal the spread of repeated estimates."""

import numpy as np
import pytest

from relume_bench.standard_error import compare_with_passes, estimate_point_error


def test_standard_error_over_points_is_the_spread_of_repeated_draws() -> None:
    rng = np.random.default_rng(3)
    reference = rng.uniform(0.5, 1.5, (100_000, 3))
    estimates = reference + rng.exponential(0.05, reference.shape)
    drawn = [
        estimate_point_error(estimates[rows], reference[rows])
        for rows in np.split(rng.permutation(len(reference))[:60_000], 200)
    ]
    reported_error = np.mean([estimate.standard_error for estimate in drawn])
    assert reported_error == pytest.approx(np.std([estimate.value for estimate in drawn]), rel=0.15)
    assert np.mean([estimate.value for estimate in drawn]) == pytest.approx(
        estimate_point_error(estimates, reference).value, rel=0.01
    )


def _passes(reference: np.ndarray, noise: float, num: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([reference + rng.normal(0, noise, reference.shape) for _ in range(num)], np.float32)


def test_standard_error_over_passes_is_the_spread_of_repeated_renders() -> None:
    rng = np.random.default_rng(5)
    reference = rng.uniform(0.5, 1.5, (40, 40, 3))
    ours = reference + rng.normal(0.01, 0.05, reference.shape)
    comparisons = [compare_with_passes(ours, _passes(reference, 0.3, 8, seed)) for seed in range(60)]
    for quantity in ("error", "bias"):
        values = [getattr(each, quantity).value for each in comparisons]
        reported_error = np.mean([getattr(each, quantity).standard_error for each in comparisons])
        assert reported_error == pytest.approx(np.std(values), rel=0.3)
    right = np.sqrt(np.mean((ours - reference) ** 2) / np.mean(reference**2))
    assert np.mean([each.error.value for each in comparisons]) == pytest.approx(right, rel=0.03)
    assert np.mean([each.noise for each in comparisons]) == pytest.approx(
        0.3 / np.sqrt(8 * np.mean(reference**2)), rel=0.02
    )


def test_error_of_a_correct_picture_is_rarely_significant() -> None:
    reference = np.random.default_rng(7).uniform(0.5, 1.5, (32, 32, 3))
    significant = [
        compare_with_passes(reference, _passes(reference, 0.3, 8, seed)).is_significant for seed in range(50)
    ]
    assert np.mean(significant) < 0.1
    assert compare_with_passes(1.1 * reference, _passes(reference, 0.3, 8, 99)).is_significant
