"""Figures that are estimates, with their standard errors: each independent part is left out in turn (the jackknife)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.estimated import Estimated, jackknife, root_of_shares
from relume.reference.truth import error_squared

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class NoiseFree(NamedTuple):
    """A picture against independent noisy ones of the truth, their noise taken off.

    Attributes:
        error: relative RMSE of the picture; 0 where its estimated square is negative.
        bias: the picture's mean over the truth's, less one.
        noise: relative RMS of the noise that the mean of all passes has.
        limit: what the relative RMSE is very likely below, by two standard errors of its square.
    """

    error: Estimated
    bias: Estimated
    noise: float
    limit: float

    @property
    def is_told(self) -> bool:
        """Whether the error can be told from the noise: its square is more than two of its standard errors."""
        return self.error.value > 0 and self.limit**2 < 2 * self.error.value**2

    @property
    def said(self) -> str:
        """Error and bias in words, for the row of another figure."""
        return f"{100 * self.error.value:.1f} % (bias {100 * self.bias.value:.1f} %)"

    @property
    def context(self) -> dict[str, float]:
        """All but the error, for the row of a figure."""
        return {
            "bias": self.bias.value, "bias_standard_error": self.bias.standard_error,
            "noise": self.noise, "limit": self.limit,
        }  # fmt: skip


def over_points(found: NDArray[np.floating], truth: NDArray[np.floating]) -> Estimated:
    """Relative RMSE √(Σ (found − truth)² / Σ truth²) over points that were drawn at random.

    Args:
        found, truth: radiance or irradiance. (n, channels), n at least 2
    """
    truth = truth.astype(np.float64)
    squares, of = ((found - truth) ** 2).sum(axis=1), (truth**2).sum(axis=1)
    return root_of_shares(squares, of)


def over_passes(ours: F64, passes: F32) -> NoiseFree:
    """Relative RMSE of a picture against the mean that noisy pictures share: E[(o − a)(o − b)] = (o − mean)².

    The standard error is that of the passes' noise; the picture itself is taken as it is.

    Args:
        ours: (height, width, 3).
        passes: (passes, height, width, 3), at least 2 of them.
    """
    num, mean_square = len(passes), error_squared(np.zeros_like(ours), passes)[0]
    square, deviation = (term / mean_square for term in error_squared(ours, passes))
    error = np.sqrt(max(0.0, square))
    means = passes.mean(axis=(1, 2, 3), dtype=np.float64)
    biases = ours.mean() / ((means.sum() - means) / (num - 1)) - 1
    spread = ((passes - passes.mean(axis=0, dtype=np.float64)) ** 2).mean() / (num - 1)
    return NoiseFree(
        Estimated(float(error), float(np.sqrt(max(0.0, square) + deviation) - error)),
        Estimated(float(ours.mean() / means.mean() - 1), jackknife(biases)),
        float(np.sqrt(spread / mean_square)),
        float(np.sqrt(max(0.0, square) + 2 * deviation)),
    )
