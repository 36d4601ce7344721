"""How true a frame is: its difference from brute force, with the noise of brute force told apart from it.

Passes of the reference are independent, but their noise has heavy tails: that a highlight finds a small light is rare,
and bright. So nothing here trusts a table of Student's t. Passes are added up in batches, and the batches say by
themselves how far noise alone carries their mean: with the signs of half of them turned, the truth cancels and noise of
the same spread is left. What a frame differs by, over its own noise, is compared with what such turned batches give,
over pixels and over blocks of them, and the largest set is called different of which at most `FALSE_DISCOVERY_RATE` is
so by chance (the false discovery rate of Benjamini and Hochberg 1995, counted as with decoys, Elias and Gygi 2007).

All that is said of a frame follows from that set: where it is empty no error was found, however large the differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from relume.core.color import luminance

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

FALSE_DISCOVERY_RATE = 0.01  # of what is called different, at most
_BLOCKS = (1, 4, 16)  # pixels across
_NUM_SIGN_FLIPS = 16  # of the batches' signs
_SEED = 1995
_MAX_BATCHES, _MIN_BATCHES, _BATCH_BYTES = 16, 4, 256 << 20
_ROUNDING = 1e-6  # of float32, relative: no difference
_FULL_COLOR_STOPS = 0.25
_DARK = 0.01  # of the picture's mean: darker than that, stops say nothing
_GRAY, _TOO_BRIGHT, _TOO_DARK = (np.array(c, float) for c in ((56, 56, 56), (235, 94, 52), (66, 135, 245)))


@dataclass(frozen=True)
class Estimate:
    """Passes of the reference, added up in batches: pass k in batch k modulo their number.

    Attributes:
        sums: of red, green and blue. (batches, height, width, 3) float32
        passes: number of them.
    """

    sums: F32
    passes: int

    @classmethod
    def empty(cls, height: int, width: int) -> Estimate:
        """No pass yet; so many batches that they take a bounded part of the memory."""
        num_fitting = _BATCH_BYTES // max(1, 12 * height * width)
        num = min(max(num_fitting, _MIN_BATCHES), _MAX_BATCHES)
        return cls(np.zeros((num, height, width, 3), np.float32), 0)

    def add(self, picture: F32) -> Estimate:
        """One more pass, (height, width, 3); what this estimate held is the new one's."""
        self.sums[self.passes % len(self.sums)] += picture
        return Estimate(self.sums, self.passes + 1)

    @property
    def means(self) -> F32:
        """Of each batch that has a pass. (batches, height, width, 3)"""
        num = min(self.passes, len(self.sums))
        count = self.passes // len(self.sums) + (np.arange(num) < self.passes % len(self.sums))
        return np.asarray(self.sums[:num] / count.astype(np.float32)[:, None, None, None])

    @property
    def mean(self) -> F32:
        """Of all passes. (height, width, 3)"""
        return np.asarray(self.sums.sum(axis=0, dtype=np.float64) / self.passes, np.float32)


@dataclass(frozen=True)
class Comparison:
    """A frame against an estimate of the truth, each relative to the truth's root mean square over pixels and channels.

    Attributes:
        rmse: of the difference, noise included. noise: of the estimate.
        error: of the frame, noise taken off; None where that cannot be told from the noise.
        standard_error: of `error`, one standard deviation of what other passes would make of it; None where that is.
        error_upper_bound: what the error is very likely below.
        significant_pixel_fraction: share of pixels that differ by more than noise explains; at most
            `FALSE_DISCOVERY_RATE` of these by chance.
    """

    rmse: float
    noise: float
    error: float | None
    standard_error: float | None
    error_upper_bound: float
    significant_pixel_fraction: float


def compare(frame: F32, estimate: Estimate) -> tuple[Comparison, Mask]:
    """Compare a frame, (height, width, 3), with an estimate of at least two passes.

    Returns:
        The figures, and which pixels differ. (height, width)
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


def error_squared(frame: NDArray[np.floating], passes: F32) -> tuple[float, float]:
    """The mean square of a frame's error, noise of the passes taken off, and its standard deviation.

    Args:
        frame: (height, width, 3). passes: independent noisy pictures of the truth. (passes, height, width, 3)
    Returns:
        Both in the frame's unit squared; the first may be negative where there is more noise than error.
    """
    return _error_squared(_gram(frame, passes))


def error_map(frame: F32, estimate: Estimate, differs: Mask) -> NDArray[np.uint8]:
    """Where the frame is too bright (orange) or too dark (blue), in full colour from a quarter of a stop on.

    Args:
        frame: linear radiance. (height, width, 3)
        estimate: of the truth, of the same size.
        differs: pixels as `compare` has found them; all others are grey. (height, width)
    Returns:
        sRGB. (height, width, 3) uint8
    """
    mean = luminance(estimate.mean).astype(np.float64)
    floor = _DARK * max(float(mean.mean()), 1e-300)
    stops = np.log2((luminance(frame).astype(np.float64) + floor) / (mean + floor))
    amount = np.clip(np.abs(stops) / _FULL_COLOR_STOPS, 0.0, 1.0) * differs
    color = np.where(stops[..., None] > 0, _TOO_BRIGHT, _TOO_DARK)
    return np.asarray(_GRAY + amount[..., None] * (color - _GRAY) + 0.5, np.uint8)


def _gram(frame: NDArray[np.floating], means: F32) -> F64:
    """Mean products of the batches' differences from the frame, over pixels and channels. (batches, batches)"""
    differences = (frame[None] - means).reshape(len(means), -1)
    step, total = 1 << 20, np.zeros((len(means), len(means)))
    for start in range(0, differences.shape[1], step):
        block = differences[:, start : start + step].astype(np.float64)
        total += block @ block.T
    return total / differences.shape[1]


def _error_squared(gram: F64) -> tuple[float, float]:
    """The frame's own error, squared, and its standard deviation: products of different batches have no noise in
    their mean, and leaving each batch out in turn tells how they scatter."""
    num = len(gram)
    all_pairs = gram.sum() - np.trace(gram)
    error = float(all_pairs / (num * (num - 1)))
    if num == 2:
        return error, float(np.trace(gram) / 4)
    without = (all_pairs - 2 * (gram.sum(axis=1) - np.diag(gram))) / ((num - 1) * (num - 2))
    return error, float(np.sqrt((num - 1) * np.mean((without - without.mean()) ** 2)))


def _differing_pixels(frame: F32, means: F32) -> Mask:
    """Pixels that differ by themselves, or else as part of a block of such as do not. (height, width)"""
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
    """Means over blocks of size × size, by `pixel_weights`; 0 where that is. values: (h, w). Returns: (rows, cols)"""
    rows, columns = (np.arange(0, length, size) for length in values.shape)
    sums, weights = (
        np.add.reduceat(np.add.reduceat(array, rows, axis=0), columns, axis=1)
        for array in (values * pixel_weights, pixel_weights)
    )
    return np.asarray(sums / np.maximum(weights, 1e-300))


def _differing_blocks(frame_means: F64, batches: F64) -> Mask:
    """Blocks that differ; none where there are too few batches. shown: (rows, columns). batches: (n, rows, columns)"""
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
        # what is left of the spread does not depend on this noise
        residual = np.maximum(sum_squares - num * noise**2, 0.0)
        null_ratios.append(_noise_ratio(noise, residual / (num * (num - 2)), mean))
    return noise_ratios >= _threshold(noise_ratios.ravel(), np.concatenate(null_ratios, axis=None))


def _noise_ratio(difference: F64, variance: F64, mean: F64) -> F64:
    """How many standard deviations a difference is; 0 where it is rounding. Arguments: (rows, columns)

    An event that neighbours have seen may have been missed here: their variance counts too, scaled to this brightness.
    """
    brightness_squared = mean**2 + 1e-300
    smoothed_variance = brightness_squared * uniform_filter(variance / brightness_squared, 3, mode="nearest")
    floor = _ROUNDING * np.abs(mean) + 1e-300
    size, deviation = np.abs(difference), np.sqrt(np.maximum(variance, smoothed_variance))
    return np.asarray(np.where(size > floor, size / np.maximum(deviation, floor), 0.0))


def _sign_flips(num: int) -> list[F64]:
    """Weights of batches by which their means cancel and their noise has that of the mean of all. (num,) each"""
    rng = np.random.default_rng((_SEED, num))
    flips = []
    for _ in range(_NUM_SIGN_FLIPS):
        signs = rng.permutation(np.where(np.arange(num) % 2 == 0, 1.0, -1.0))
        signs -= signs.mean()
        flips.append(signs / np.sqrt(num * (signs**2).sum()))
    return flips


def _threshold(noise_ratios: F64, null_ratios: F64) -> float:
    """The least value from which on at most `FALSE_DISCOVERY_RATE` are expected by chance; infinite if there is none.

    Args:
        null_ratios: of so many trials as `_sign_flips` has.
    """
    values = np.sort(noise_ratios[noise_ratios > 0])
    num_discoveries = len(values) - np.arange(len(values))
    num_false = len(null_ratios) - np.searchsorted(np.sort(null_ratios), values, side="left")
    passing = np.nonzero((num_false + 1) / _NUM_SIGN_FLIPS <= FALSE_DISCOVERY_RATE * num_discoveries)[0]
    return float(values[passing[0]]) if len(passing) else np.inf
