"""Error of a frame relative to the reference, separated from the noise of the reference.

Passes of the reference are independent, but their noise has heavy tails: a highlight rarely samples a small light, and
is then bright. So Student's t distribution does not apply. Passes are summed in batches, whose variation shows
the noise of the mean: if the signs of half of the batches are flipped, the signal cancels and noise of equal variance
remains. The frame's difference in units of its noise is compared with that of sign-flipped batches, over pixels
and over blocks of pixels. The largest set of which at most `FALSE_DISCOVERY_RATE` is expected by chance is called
different (false discovery rate of Benjamini and Hochberg 1995, counted with decoys, Elias and Gygi 2007).

All results follow from that set: if it is empty, no error was found, however large the differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from relume.core.color import luminance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

FALSE_DISCOVERY_RATE = 0.01  # maximum expected fraction of false discoveries
_BLOCKS = (1, 4, 16)  # block sizes, pixels
_NUM_SIGN_FLIPS = 16  # trials with flipped signs
_SEED = 1995
_MAX_BATCHES, _MIN_BATCHES, _BATCH_BYTES = 16, 4, 256 << 20
_IMAGE_BYTES = 12  # per pixel
_ROUNDING = 1e-6  # relative rounding of float32, not counted as a difference
_FULL_COLOR_STOPS = 0.25
_DARK = 0.01  # of the image's mean; stops are meaningless below it
_GRAY, _TOO_BRIGHT, _TOO_DARK = (np.array(c, float) for c in ((56, 56, 56), (235, 94, 52), (66, 135, 245)))


@dataclass(frozen=True)
class Estimate:
    """Sums of reference passes in batches: pass k is in batch k modulo their number.

    Attributes:
        sums: sums per batch.
        passes: number of passes.
    """

    sums: Shaped[F32, "batches height width 3"]
    passes: int

    @classmethod
    def empty(cls, height: int, width: int) -> Estimate:
        """Make an estimate without passes."""
        return cls(np.zeros((_num_batches(height, width), height, width, 3), np.float32), 0)

    @staticmethod
    def planned_bytes(height: int, width: int) -> int:
        """Size of the sums of an image."""
        return _num_batches(height, width) * _IMAGE_BYTES * height * width

    def add(self, picture: Shaped[F32, "height width 3"]) -> Estimate:
        """Add a pass; the new estimate reuses the arrays of this one."""
        self.sums[self.passes % len(self.sums)] += picture
        return Estimate(self.sums, self.passes + 1)

    @property
    def means(self) -> Shaped[F32, "batches height width 3"]:
        """Mean of each batch that has a pass."""
        num = min(self.passes, len(self.sums))
        count = self.passes // len(self.sums) + (np.arange(num) < self.passes % len(self.sums))
        return np.asarray(self.sums[:num] / count.astype(np.float32)[:, None, None, None])

    @property
    def mean(self) -> Shaped[F32, "height width 3"]:
        """Mean of all passes."""
        return np.asarray(self.sums.sum(axis=0, dtype=np.float64) / self.passes, np.float32)


def _num_batches(height: int, width: int) -> int:
    """Number of batches, which memory bounds."""
    return min(max(_BATCH_BYTES // max(1, _IMAGE_BYTES * height * width), _MIN_BATCHES), _MAX_BATCHES)


@dataclass(frozen=True)
class Comparison:
    """Errors of a frame, relative to the root mean square of the reference over pixels and channels.

    Attributes:
        rmse: RMS error of the difference, noise included. noise: noise of the estimate.
        error: error of the frame, without noise; None if it cannot be separated from the noise.
        standard_error: standard deviation of `error` between sets of passes; None if `error` is.
        error_upper_bound: two standard deviations above the error.
        significant_pixel_fraction: fraction of pixels that differ by more than noise explains; at most
            `FALSE_DISCOVERY_RATE` of these by chance.
    """

    rmse: float
    noise: float
    error: float | None
    standard_error: float | None
    error_upper_bound: float
    significant_pixel_fraction: float


def compare(
    frame: Shaped[F32, "height width 3"], estimate: Estimate
) -> tuple[Comparison, Shaped[Mask, "height width"]]:
    """Compare a frame with an estimate of at least two passes.

    Returns:
        The errors, and a mask of significantly different pixels.
    """
    means = estimate.means
    differs = _differing_pixels(frame, means)
    num = len(means)
    reference_power = float(np.mean(means.mean(axis=0, dtype=np.float64) ** 2))
    gram = _gram(frame, means) / max(reference_power, 1e-300)
    mean_squared_difference = float(gram.mean())
    noise = max(0.0, (float(np.trace(gram)) / num - mean_squared_difference) / (num - 1))
    error, deviation = _error_squared(gram)
    is_significant = bool(differs.any()) and error > 2 * deviation
    root = float(np.sqrt(error)) if is_significant else None
    figures = Comparison(
        rmse=float(np.sqrt(mean_squared_difference)),
        noise=float(np.sqrt(noise)),
        error=root,
        standard_error=None if root is None else deviation / (2 * root),
        error_upper_bound=float(np.sqrt(max(0.0, error) + 2 * deviation)),
        significant_pixel_fraction=float(differs.mean()),
    )
    return figures, differs


def error_squared(
    frame: Shaped[NDArray[np.floating], "height width 3"], passes: Shaped[F32, "passes height width 3"]
) -> tuple[float, float]:
    """Mean squared error of a frame without the noise of the passes, and its standard deviation.

    Args:
        frame: the image. passes: independent noisy reference images.
    Returns:
        Both in squared units of the frame; the first may be negative if there is more noise than error.
    """
    return _error_squared(_gram(frame, passes))


def error_map(
    frame: Shaped[F32, "height width 3"], estimate: Estimate, differs: Shaped[Mask, "height width"]
) -> Shaped[NDArray[np.uint8], "height width 3"]:
    """Map of too bright (orange) and too dark (blue) pixels, in full color from a quarter of a stop, in sRGB.

    Args:
        frame: linear radiance. estimate: estimate of the reference.
        differs: pixels from `compare`; all others are gray.
    """
    mean = luminance(estimate.mean).astype(np.float64)
    floor = _DARK * max(float(mean.mean()), 1e-300)
    stops = np.log2((luminance(frame).astype(np.float64) + floor) / (mean + floor))
    amount = np.clip(np.abs(stops) / _FULL_COLOR_STOPS, 0.0, 1.0) * differs
    color = np.where(stops[..., None] > 0, _TOO_BRIGHT, _TOO_DARK)
    return np.asarray(_GRAY + amount[..., None] * (color - _GRAY) + 0.5, np.uint8)


def _gram(frame: NDArray[np.floating], means: F32) -> F64:
    """Gram matrix: mean products of the batches' differences from the frame. (batches, batches)"""
    differences = (frame[None] - means).reshape(len(means), -1)
    step, total = 1 << 20, np.zeros((len(means), len(means)))
    for start in range(0, differences.shape[1], step):
        block = differences[:, start : start + step].astype(np.float64)
        total += block @ block.T
    return total / differences.shape[1]


def _error_squared(gram: F64) -> tuple[float, float]:
    """Squared error of the frame and its standard deviation: products of different batches have no noise in
    their mean, and the jackknife over batches gives their spread."""
    num = len(gram)
    all_pairs = gram.sum() - np.trace(gram)
    error = float(all_pairs / (num * (num - 1)))
    if num == 2:
        return error, float(np.trace(gram) / 4)
    without = (all_pairs - 2 * (gram.sum(axis=1) - np.diag(gram))) / ((num - 1) * (num - 2))
    return error, float(np.sqrt((num - 1) * np.mean((without - without.mean()) ** 2)))


def _differing_pixels(frame: F32, means: F32) -> Mask:
    """Pixels that differ individually, or as part of a block of pixels that do not. (height, width)"""
    height, width = frame.shape[:2]
    batches, frame_luminance = luminance(means), luminance(frame)
    differs = np.zeros((height, width), np.bool_)
    for size in _BLOCKS:
        pixel_weights = (~differs).astype(np.float64)
        blocks = _differing_blocks(
            _block_means(frame_luminance, pixel_weights, size),
            np.stack([_block_means(b, pixel_weights, size) for b in batches]),
        )
        differs |= np.repeat(np.repeat(blocks, size, axis=0), size, axis=1)[:height, :width]
    return differs


def _block_means(values: F32, pixel_weights: F64, size: int) -> F64:
    """Means over blocks of size × size, weighted; 0 if all weights are. values: (h, w). Returns: (rows, cols)"""
    rows, columns = (np.arange(0, length, size) for length in values.shape)
    sums, weights = (
        np.add.reduceat(np.add.reduceat(array, rows, axis=0), columns, axis=1)
        for array in (values * pixel_weights, pixel_weights)
    )
    return np.asarray(sums / np.maximum(weights, 1e-300))


def _differing_blocks(frame_means: F64, batches: F64) -> Mask:
    """Mask of blocks that differ; empty if there are too few batches. batches: (n, rows, columns)"""
    num = len(batches)
    if num < _MIN_BATCHES:
        return np.zeros(frame_means.shape, np.bool_)
    mean = batches.mean(axis=0)
    deviations = batches - mean
    sum_squares = (deviations**2).sum(axis=0)
    noise_ratios = _noise_ratio(frame_means - mean, sum_squares / (num * (num - 1)), mean)
    null_ratios = []
    for batch_weights in _sign_flips(num):
        noise = np.tensordot(batch_weights, deviations, 1)
        # the remaining spread is independent of this noise
        residual = np.maximum(sum_squares - num * noise**2, 0.0)
        null_ratios.append(_noise_ratio(noise, residual / (num * (num - 2)), mean))
    return noise_ratios >= _threshold(noise_ratios.ravel(), np.concatenate(null_ratios, axis=None))


def _noise_ratio(difference: F64, variance: F64, mean: F64) -> F64:
    """Differences in standard deviations; 0 for rounding errors. Arguments: (rows, columns)

    A rare event in neighboring pixels may be missing here: their relative variance counts too.
    """
    brightness_squared = mean**2 + 1e-300
    smoothed_variance = brightness_squared * uniform_filter(variance / brightness_squared, 3, mode="nearest")
    floor = _ROUNDING * np.abs(mean) + 1e-300
    size, deviation = np.abs(difference), np.sqrt(np.maximum(variance, smoothed_variance))
    return np.asarray(np.where(size > floor, size / np.maximum(deviation, floor), 0.0))


def _sign_flips(num: int) -> list[F64]:
    """Weights of batches that cancel their means and have the same noise as the mean of all. (num,) each"""
    rng = np.random.default_rng((_SEED, num))
    flips = []
    for _ in range(_NUM_SIGN_FLIPS):
        signs = rng.permutation(np.where(np.arange(num) % 2 == 0, 1.0, -1.0))
        signs -= signs.mean()
        flips.append(signs / np.sqrt(num * (signs**2).sum()))
    return flips


def _threshold(noise_ratios: F64, null_ratios: F64) -> float:
    """Least value above which at most `FALSE_DISCOVERY_RATE` are expected by chance; infinite if there is none.

    Args:
        null_ratios: noise ratios of all `_NUM_SIGN_FLIPS` trials.
    """
    values = np.sort(noise_ratios[noise_ratios > 0])
    num_discoveries = len(values) - np.arange(len(values))
    num_false = len(null_ratios) - np.searchsorted(np.sort(null_ratios), values, side="left")
    passing = np.nonzero((num_false + 1) / _NUM_SIGN_FLIPS <= FALSE_DISCOVERY_RATE * num_discoveries)[0]
    return float(values[passing[0]]) if len(passing) else np.inf
