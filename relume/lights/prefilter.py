"""Blurred environments: each direction shows the mean of the surrounding light.

Weights are exp((cos γ − 1) / σ²), a Gaussian of σ on the sphere, times the solid angle of each texel, so that seam and
poles do not show. Between two rows of texels weights depend on the difference in azimuth alone, so that rows are
convolved by Fourier transforms.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup, texel_directions, texel_solid_angles

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_ROWS = 256
_TEXELS_PER_SIGMA = 5  # texels widen the blur by 2 %
_MIN_ROWS = 16
_CUTOFF_SIGMAS = 4.0  # σ; beyond it lies less than a thousandth of the weight
_TEXELS_PER_STEP = 1 << 20


def prefiltered(radiance: Shaped[F32, "height width 3"], degrees: float) -> Shaped[F32, "rows columns 3"]:
    """Blur an equirectangular map, into as few texels as represent the result; preserves the mean radiance.

    Args:
        radiance: from `downsampled`. degrees: σ.
    """
    sigma = np.radians(degrees)
    rows = int(np.clip(np.ceil(_TEXELS_PER_SIGMA * np.pi / sigma), _MIN_ROWS, MAX_ROWS))
    areas = texel_solid_angles(rows, 2 * rows)
    spectrum = np.fft.rfft(_resample(radiance, rows) * areas[:, None, None], axis=1)
    elevation = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)
    out = np.empty((rows, 2 * rows, 3), np.float32)
    for row, row_elevation in enumerate(elevation):
        nearby_rows = np.flatnonzero(np.abs(elevation - row_elevation) <= _CUTOFF_SIGMAS * sigma)
        weights = _weights(row_elevation, elevation[nearby_rows], 2 * rows, sigma)
        row_spectrum = np.einsum("nk,nkc->kc", np.fft.rfft(weights, axis=1), spectrum[nearby_rows])
        out[row] = np.fft.irfft(row_spectrum, 2 * rows, axis=0) / (areas[nearby_rows] @ weights.sum(axis=1))
    return np.maximum(out, 0)  # rounding of the transform may be negative beside the sun


def downsampled(radiance: Shaped[F32, "height width 3"]) -> Shaped[F32, "rows columns 3"]:
    """Reduce a map to at most `MAX_ROWS` rows, averaged over solid angle."""
    return np.asarray(_average(radiance, MAX_ROWS) if len(radiance) > MAX_ROWS else radiance, np.float32)


def _weights(row_elevation: float, elevations: F64, width: int, sigma: float) -> F64:
    """Return the weights of texels in rows at `elevations`, for one at `row_elevation`. (rows, width)"""
    azimuth = 2 * np.pi * np.arange(width) / width
    horizontal_cosine = np.cos(row_elevation) * np.cos(elevations)[:, None] * np.cos(azimuth)
    return np.asarray(np.exp((np.sin(row_elevation) * np.sin(elevations)[:, None] + horizontal_cosine - 1) / sigma**2))


def _resample(radiance: F32, rows: int) -> F64:
    """Resample a map: averages if texels become larger, lookups at texel centers otherwise."""
    if len(radiance) > rows:
        return _average(radiance, rows)
    directions = texel_directions(rows, 2 * rows).reshape(-1, 3)
    return lookup(radiance, directions).reshape(rows, 2 * rows, 3).astype(np.float64)


def _average(radiance: F32, rows: int) -> F64:
    height, width, _ = radiance.shape
    resampled_rows, step = np.empty((height, 2 * rows, 3)), max(1, _TEXELS_PER_STEP // width)
    columns, new_columns = np.full(width, 1 / width), np.full(2 * rows, 0.5 / rows)
    for start in range(0, height, step):
        resampled_rows[start : start + step] = _means(radiance[start : start + step], columns, new_columns, axis=1)
    bands, new_bands = texel_solid_angles(height, 1), texel_solid_angles(rows, 1)
    return _means(resampled_rows, bands, new_bands, axis=0)


def _means(values: NDArray[np.floating], measure: F64, new_measure: F64, *, axis: int) -> F64:
    """Average cells over fewer cells of the same extent. measure, new_measure: length of each, along the axis"""
    tail = [1] * (values.ndim - 1)
    edges, new_edges = (np.concatenate([[0.0], np.cumsum(each)]) for each in (measure, new_measure))
    weighted_values = np.moveaxis(values, axis, 0) * measure.reshape(-1, *tail)
    cumulative = np.concatenate([np.zeros_like(weighted_values[:1]), np.cumsum(weighted_values, axis=0)])
    cell_index = np.clip(np.searchsorted(edges, new_edges, side="right") - 1, 0, len(measure) - 1)
    fraction = ((new_edges - edges[cell_index]) / measure[cell_index]).reshape(-1, *tail)
    sums = np.diff(cumulative[cell_index] + fraction * weighted_values[cell_index], axis=0)
    return np.asarray(np.moveaxis(sums / new_measure.reshape(-1, *tail), 0, axis))
