"""How true a frame is: its difference from brute force, with the noise of brute force told apart from it.

Independent passes x_1 … x_n of the reference give, per pixel, a mean m and the variance s²/n of that mean. Then
E (f − m)² = (f − E m)² + s²/n, so that the frame's own error is what is left when the noise is taken off. A pixel
differs significantly where |f − m| / (s/√n) is beyond Student's t with n − 1 degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from relume.color import luminance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SIGNIFICANCE = 0.01  # of the pixels of a perfect frame are called different
_FULL_COLOUR_STOPS = 0.25
_DARK = 0.01  # of the picture's mean: darker than that, stops say nothing
_GREY, _TOO_BRIGHT, _TOO_DARK = (np.array(c, float) for c in ((56, 56, 56), (235, 94, 52), (66, 135, 245)))


@dataclass(frozen=True)
class Estimate:
    """Sums over passes of the reference.

    Attributes:
        total, squares: of red, green, blue and luminance. (height, width, 4) float64
        passes: number of them.
    """

    total: F64
    squares: F64
    passes: int

    @classmethod
    def nothing(cls, height: int, width: int) -> Estimate:
        """No pass yet."""
        return cls(np.zeros((height, width, 4)), np.zeros((height, width, 4)), 0)

    def with_pass(self, picture: F32) -> Estimate:
        """One more pass. picture: (height, width, 3)"""
        values = _with_luminance(picture)
        return Estimate(self.total + values, self.squares + values**2, self.passes + 1)

    @property
    def mean(self) -> F64:
        """(height, width, 4)"""
        return self.total / self.passes

    @property
    def variance(self) -> F64:
        """Of the mean; at least two passes are needed. (height, width, 4)"""
        spread = np.maximum(self.squares - self.total**2 / self.passes, 0.0)
        return spread / (self.passes - 1) / self.passes


@dataclass(frozen=True)
class Comparison:
    """A frame against an estimate of the truth, each relative to the truth's root mean square over pixels and channels.

    Attributes:
        rmse: of the difference, noise included. noise: of the estimate. error: of the frame, noise taken off.
        significant: share of pixels that differ significantly; `SIGNIFICANCE` of them would by chance.
    """

    rmse: float
    noise: float
    error: float
    significant: float


def compare(frame: F32, estimate: Estimate) -> Comparison:
    """Compare a frame, (height, width, 3), with an estimate of at least two passes."""
    mean, variance = estimate.mean[..., :3], estimate.variance[..., :3]
    scale = max(float(np.mean(mean**2)), 1e-300)
    square, noise = float(np.mean((frame - mean) ** 2)), float(np.mean(variance))
    return Comparison(
        rmse=float(np.sqrt(square / scale)),
        noise=float(np.sqrt(noise / scale)),
        error=float(np.sqrt(max(0.0, square - noise) / scale)),
        significant=float(np.mean(_is_significant(frame, estimate))),
    )


def error_map(frame: F32, estimate: Estimate) -> NDArray[np.uint8]:
    """Where the frame is too bright (orange) or too dark (blue), in full colour from a quarter of a stop on.

    Pixels whose difference the noise explains are grey. Returns: (height, width, 3)
    """
    mean = estimate.mean[..., 3]
    floor = _DARK * max(float(mean.mean()), 1e-300)
    stops = np.log2((_with_luminance(frame)[..., 3] + floor) / (mean + floor))
    amount = np.clip(np.abs(stops) / _FULL_COLOUR_STOPS, 0.0, 1.0) * _is_significant(frame, estimate)
    colour = np.where(stops[..., None] > 0, _TOO_BRIGHT, _TOO_DARK)
    return np.asarray(_GREY + amount[..., None] * (colour - _GREY) + 0.5, np.uint8)


def _is_significant(frame: F32, estimate: Estimate) -> NDArray[np.bool_]:
    """By luminance. Rounding of float32 is no difference. (height, width)"""
    mean, deviation = estimate.mean[..., 3], np.sqrt(estimate.variance[..., 3])
    limit = float(student.ppf(1.0 - SIGNIFICANCE / 2, estimate.passes - 1))
    difference = np.abs(_with_luminance(frame)[..., 3] - mean)
    return np.asarray(difference > np.maximum(limit * deviation, 1e-6 * np.abs(mean)))


def _with_luminance(picture: F32) -> F64:
    return np.concatenate([picture, luminance(picture)[..., None]], axis=-1).astype(np.float64)
