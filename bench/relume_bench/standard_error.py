"""Estimates with their standard errors, by the jackknife: each independent part is left out in turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.jackknife import JackknifeEstimate, jackknife, rms_of_parts
from relume.reference.comparison import error_squared

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class NoiseCorrectedError(NamedTuple):
    """An image against independent noisy reference images, with their noise removed.

    Attributes:
        error: relative RMSE of the image; 0 if its estimated square is negative.
        bias: the image's mean over the reference's, minus one.
        noise: relative RMS noise of the mean of all passes.
        limit: upper bound of the relative RMSE, by two standard errors of its square.
    """

    error: JackknifeEstimate
    bias: JackknifeEstimate
    noise: float
    limit: float

    @property
    def is_significant(self) -> bool:
        """True if the error is above the noise: its square is more than two of its standard errors."""
        return self.error.value > 0 and self.limit**2 < 2 * self.error.value**2

    @property
    def summary(self) -> str:
        """Error and bias as text, for the context of another figure."""
        return f"{100 * self.error.value:.1f} % (bias {100 * self.bias.value:.1f} %)"

    @property
    def context(self) -> dict[str, float]:
        """All fields except the error, for the context of a figure."""
        return {
            "bias": self.bias.value, "bias_standard_error": self.bias.standard_error,
            "noise": self.noise, "limit": self.limit,
        }  # fmt: skip


def estimate_point_error(values: NDArray[np.floating], reference: NDArray[np.floating]) -> JackknifeEstimate:
    """Relative RMSE √(Σ (value − reference)² / Σ reference²) over randomly chosen points.

    Args:
        values, reference: radiance or irradiance. (n, channels), n at least 2
    """
    reference = reference.astype(np.float64)
    squared_errors, squared_reference = ((values - reference) ** 2).sum(axis=1), (reference**2).sum(axis=1)
    return rms_of_parts(squared_errors, squared_reference)


def compare_with_passes(rendered: F64, passes: F32) -> NoiseCorrectedError:
    """Relative RMSE of an image against the common mean of noisy images: E[(o − a)(o − b)] = (o − mean)².

    The standard error is that of the passes' noise; the image itself is taken as exact.

    Args:
        rendered: (height, width, 3).
        passes: (passes, height, width, 3), at least 2.
    """
    num, mean_squared_radiance = len(passes), error_squared(np.zeros_like(rendered), passes)[0]
    relative_squared_error, deviation = (term / mean_squared_radiance for term in error_squared(rendered, passes))
    error = np.sqrt(max(0.0, relative_squared_error))
    means = passes.mean(axis=(1, 2, 3), dtype=np.float64)
    biases = rendered.mean() / ((means.sum() - means) / (num - 1)) - 1
    spread = ((passes - passes.mean(axis=0, dtype=np.float64)) ** 2).mean() / (num - 1)
    return NoiseCorrectedError(
        JackknifeEstimate(float(error), float(np.sqrt(max(0.0, relative_squared_error) + deviation) - error)),
        JackknifeEstimate(float(rendered.mean() / means.mean() - 1), jackknife(biases)),
        float(np.sqrt(spread / mean_squared_radiance)),
        float(np.sqrt(max(0.0, relative_squared_error) + 2 * deviation)),
    )


def compare_pixels(rendered: F64, passes: F32, mask: NDArray[np.bool_]) -> NoiseCorrectedError:
    """As `compare_with_passes`, over some pixels. rendered, passes: as there. mask: (height, width)"""
    return compare_with_passes(rendered[mask][None], passes[:, mask][:, None])
