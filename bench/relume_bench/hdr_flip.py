"""HDR-FLIP: the difference that people see when they switch between two images of linear radiance.

Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, FLIP: A Difference Evaluator for Alternating
Images; Andersson, Nilsson, Shirley and Akenine-Möller 2021, Visualizing Errors in Rendered High Dynamic Range Images.
Constants and names are theirs. A test compares values with those of the authors' definition.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

F64 = NDArray[np.float64]

PIXELS_PER_DEGREE = 67.02  # a 4K monitor, 0.7 m wide, seen from 0.7 m
_ACES = (0.6**2 * 2.51, 0.6 * 0.03, 0.0, 0.6**2 * 2.43, 0.6 * 0.59, 0.14)
_BRIGHTEST = 0.85  # display value of the median at the longest exposure, and of the maximum at the shortest
_TO_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
_WHITE = _TO_XYZ.sum(axis=1)
# sums of two Gaussians a √(π/b) exp(−π² x²/b), x in degrees: lightness, red–green, blue–yellow
_CONTRAST_SENSITIVITY = (
    ((1.0, 0.0047), (0.0, 1e-5)),
    ((1.0, 0.0053), (0.0, 1e-5)),
    ((34.1, 0.04), (13.5, 0.025)),
)
_COLOR_EXPONENT, _COLOR_KNEE, _KNEE_VALUE = 0.7, 0.4, 0.95
_FEATURE_WIDTH, _FEATURE_EXPONENT = 0.082, 0.5  # degrees


def hdr_flip(image: NDArray[np.floating], reference: NDArray[np.floating]) -> F64:
    """Error of every pixel, the largest over the exposures at which the reference is seen. (height, width), in [0, 1]

    Args:
        image, reference: linear Rec. 709. (height, width, 3)
    """
    start, stop = exposure_range(reference)
    num = max(2, int(np.ceil(stop - start)))
    errors = np.zeros(reference.shape[:2])
    for stops in np.linspace(start, stop, num):
        displayed = [_tone_map(2**stops * np.maximum(picture, 0)) for picture in (image, reference)]
        errors = np.maximum(errors, ldr_flip(*displayed))
    return errors


def without_noise(error: float, noisier: float) -> float:
    """Estimate the mean error against a reference without noise.

    Its square and that of the noise's error add up, and half as many passes have twice the latter:
    e² = 2 error² − noisier². If the noise dominates, about two thirds of its error stay, because small differences
    count for more than in proportion: the estimate is too large then, not too small.

    Args:
        error: mean against the mean of all passes. noisier: the same against the means of halves of them.
    """
    return float(np.sqrt(max(0.0, 2 * error**2 - noisier**2)))


def exposure_range(reference: NDArray[np.floating]) -> tuple[float, float]:
    """Stops at which the brightest pixel, and the pixel of median luminance, are as bright as a display shows well."""
    k = _ACES
    a, b, c = k[0] - _BRIGHTEST * k[3], k[1] - _BRIGHTEST * k[4], k[2] - _BRIGHTEST * k[5]
    bright = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    luminance = np.maximum(reference, 0) @ [0.2126, 0.7152, 0.0722]
    return float(np.log2(bright / max(luminance.max(), 1e-9))), float(np.log2(bright / max(np.median(luminance), 1e-9)))


def ldr_flip(image: F64, reference: F64) -> F64:
    """Error of every pixel of displayed images. (height, width), in [0, 1]

    Args:
        image, reference: linear display values in [0, 1]. (height, width, 3)
    """
    opponents = [_opponents(picture) for picture in (image, reference)]
    color = _redistribute(_hyab(*(_hunt(_lab(np.clip(_linear(_blur(o)), 0, 1))) for o in opponents)))
    edges, points = zip(*(_features((o[..., 0] + 16) / 116) for o in opponents), strict=True)
    feature = np.maximum(np.abs(edges[0] - edges[1]), np.abs(points[0] - points[1]))
    return np.asarray(color ** (1 - (feature / np.sqrt(2)) ** _FEATURE_EXPONENT))


def _tone_map(x: F64) -> F64:
    k = _ACES
    return np.clip((k[0] * x * x + k[1] * x + k[2]) / (k[3] * x * x + k[4] * x + k[5]), 0, 1)


def _opponents(linear: F64) -> F64:
    """Linear RGB to YCxCz."""
    x, y, z = np.moveaxis(linear @ _TO_XYZ.T / _WHITE, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _linear(opponents: F64) -> F64:
    """YCxCz to linear RGB."""
    lightness, red_green, blue_yellow = np.moveaxis(opponents, -1, 0)
    y = (lightness + 16) / 116
    xyz = np.stack([y + red_green / 500, y, y - blue_yellow / 200], axis=-1) * _WHITE
    return np.asarray(xyz @ np.linalg.inv(_TO_XYZ).T)


def _lab(linear: F64) -> F64:
    ratio = linear @ _TO_XYZ.T / _WHITE
    delta = 6 / 29
    x, y, z = np.moveaxis(np.where(ratio > delta**3, np.cbrt(ratio), ratio / (3 * delta**2) + 4 / 29), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _hunt(lab: F64) -> F64:
    """Colors look less saturated when they are dark."""
    saturation = 0.01 * lab[..., :1]
    return np.asarray(lab * np.concatenate([np.ones_like(saturation), saturation, saturation], axis=-1))


def _hyab(a: F64, b: F64) -> F64:
    difference = a - b
    return np.asarray(np.abs(difference[..., 0]) + np.hypot(difference[..., 1], difference[..., 2]))


def _redistribute(distance: F64) -> F64:
    """Color distances to [0, 1]: the larger ones share the little that is left above the knee."""
    green, blue = (_hunt(_lab(np.array(color, np.float64))) for color in ([0, 1, 0], [0, 0, 1]))
    largest = _hyab(green, blue) ** _COLOR_EXPONENT
    value, knee = distance**_COLOR_EXPONENT, _COLOR_KNEE * largest
    above = _KNEE_VALUE + (value - knee) / (largest - knee) * (1 - _KNEE_VALUE)
    return np.asarray(np.where(value < knee, _KNEE_VALUE / knee * value, above))


def _blur(opponents: F64) -> F64:
    """Filter by the contrast sensitivity of people; each Gaussian of a sum is separable."""
    widest = max(b for gaussians in _CONTRAST_SENSITIVITY for _, b in gaussians)
    radius = int(np.ceil(3 * np.sqrt(widest / (2 * np.pi**2)) * PIXELS_PER_DEGREE))
    x = np.arange(-radius, radius + 1) / PIXELS_PER_DEGREE
    channels = []
    for channel, gaussians in zip(np.moveaxis(opponents, -1, 0), _CONTRAST_SENSITIVITY, strict=True):
        kernels = [(a * np.sqrt(np.pi / b), np.exp(-(np.pi**2) * x * x / b)) for a, b in gaussians]
        total = sum(weight * kernel.sum() ** 2 for weight, kernel in kernels)
        channels.append(sum(weight * _separable(channel, kernel, kernel) for weight, kernel in kernels) / total)
    return np.stack(channels, axis=-1)


def _features(lightness: F64) -> tuple[F64, F64]:
    """Magnitudes of edges and of points: first and second derivatives of a Gaussian. (height, width) each"""
    width = 0.5 * _FEATURE_WIDTH * PIXELS_PER_DEGREE
    radius = int(np.ceil(3 * width))
    x = np.arange(-radius, radius + 1)
    smooth = np.exp(-x * x / (2 * width * width))
    kernels = (-x * smooth, (x * x / (width * width) - 1) * smooth)
    smooth = smooth / smooth.sum()
    magnitudes = []
    for kernel in kernels:  # positive weights sum to 1, negative ones to -1
        kernel = np.where(kernel > 0, kernel / kernel[kernel > 0].sum(), -kernel / kernel[kernel < 0].sum())
        magnitudes.append(np.hypot(_separable(lightness, kernel, smooth), _separable(lightness, smooth, kernel)))
    return magnitudes[0], magnitudes[1]


def _separable(values: F64, along_x: F64, along_y: F64) -> F64:
    return np.asarray(
        correlate1d(correlate1d(values, along_x, axis=1, mode="nearest"), along_y, axis=0, mode="nearest")
    )
