"""An environment seen out of focus: every direction shows the mean of the light about it.

Weights are exp((cos γ − 1) / σ²), a Gaussian of σ on the sphere, times the solid angle of each texel: there is neither
a seam nor a pole. Between two rows of texels weights depend on the difference in azimuth alone, so that rows are
convolved by Fourier transforms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import lookup, texel_directions, texel_solid_angles

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_ROWS = 256
_TEXELS_A_SIGMA = 5  # texels widen the blur by a fiftieth
_FEWEST_ROWS = 16
_REACH = 4.0  # σ; beyond it lies less than a thousandth of the weight
_TEXELS_A_STEP = 1 << 20


def blurred(radiance: F32, degrees: float) -> F32:
    """Blur an equirectangular map, into as few texels as hold the result; time and size are bounded by the map's.

    Args:
        radiance: from `reduced`. degrees: σ.
    Returns:
        (rows, 2 · rows, 3) float32, as bright in all as the map
    """
    sigma = np.radians(degrees)
    rows = int(np.clip(np.ceil(_TEXELS_A_SIGMA * np.pi / sigma), _FEWEST_ROWS, MOST_ROWS))
    areas = texel_solid_angles(rows, 2 * rows)
    spectrum = np.fft.rfft(_resampled(radiance, rows) * areas[:, None, None], axis=1)
    elevation = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)
    out = np.empty((rows, 2 * rows, 3), np.float32)
    for row, here in enumerate(elevation):
        near = np.flatnonzero(np.abs(elevation - here) <= _REACH * sigma)
        weights = _weights(here, elevation[near], 2 * rows, sigma)
        summed = np.einsum("nk,nkc->kc", np.fft.rfft(weights, axis=1), spectrum[near])
        out[row] = np.fft.irfft(summed, 2 * rows, axis=0) / (areas[near] @ weights.sum(axis=1))
    return np.maximum(out, 0)  # the transform leaves a rest of rounding beside the sun


def reduced(radiance: F32) -> F32:
    """Bring a map to at most `MOST_ROWS` rows, by means over solid angle. (height, width, 3) float32"""
    return np.asarray(_averaged(radiance, MOST_ROWS) if len(radiance) > MOST_ROWS else radiance, np.float32)


def _weights(here: float, there: F64, width: int, sigma: float) -> F64:
    """Weigh the texels of rows at elevations `there`, by their azimuth from one at `here`. (rows, width)"""
    azimuth = 2 * np.pi * np.arange(width) / width
    level = np.cos(here) * np.cos(there)[:, None] * np.cos(azimuth)
    return np.asarray(np.exp((np.sin(here) * np.sin(there)[:, None] + level - 1) / sigma**2))


def _resampled(radiance: F32, rows: int) -> F64:
    """Sample a map at other texels: their means where they are larger, else what is in their middle."""
    if len(radiance) > rows:
        return _averaged(radiance, rows)
    at = texel_directions(rows, 2 * rows).reshape(-1, 3)
    return lookup(radiance, at).reshape(rows, 2 * rows, 3).astype(np.float64)


def _averaged(radiance: F32, rows: int) -> F64:
    height, width, _ = radiance.shape
    across, step = np.empty((height, 2 * rows, 3)), max(1, _TEXELS_A_STEP // width)
    columns, new_columns = np.full(width, 1 / width), np.full(2 * rows, 0.5 / rows)
    for start in range(0, height, step):
        across[start : start + step] = _means(radiance[start : start + step], columns, new_columns, axis=1)
    bands, new_bands = texel_solid_angles(height, 1), texel_solid_angles(rows, 1)
    return _means(across, bands, new_bands, axis=0)


def _means(values: NDArray[np.floating], measure: F64, new_measure: F64, *, axis: int) -> F64:
    """Average cells over fewer ones that cover the same. measure, new_measure: length of each, along the axis"""
    tail = [1] * (values.ndim - 1)
    edges, new_edges = (np.concatenate([[0.0], np.cumsum(each)]) for each in (measure, new_measure))
    cells = np.moveaxis(values, axis, 0) * measure.reshape(-1, *tail)
    total = np.concatenate([np.zeros_like(cells[:1]), np.cumsum(cells, axis=0)])
    cell = np.clip(np.searchsorted(edges, new_edges, side="right") - 1, 0, len(measure) - 1)
    share = ((new_edges - edges[cell]) / measure[cell]).reshape(-1, *tail)
    sums = np.diff(total[cell] + share * cells[cell], axis=0)
    return np.asarray(np.moveaxis(sums / new_measure.reshape(-1, *tail), 0, axis))
