"""btf.compression_*: error, ratio and time of BTF compression.

`btf.compression_error`: relative RMS of all values after compression and rounding at 1/50 byte per channel and image;
the worst of the three synthetic BTFs. `curve` in the context: ratio and error for three error bounds, each with
decreasing numbers of components; interpolated linearly in logarithms between the best points. In parentheses: the error
of the ideal coder at the same size, without its tables. Norm: √Σ(compressed − original)² ÷ √Σ original²; `range_error`
divides by the RMS of the brightest thousandth instead, as for errors of 8-bit images; `delta_e` is the mean color
difference (CIE 1976) of texels in full light at that ratio. `btf.compression_ratio`: at an error of 5 %.
`btf.compression_s`: time of the slowest of the three to 5 %.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.value_cache import ValueFile
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume_bench.btf_synthetic import SyntheticBtf, open_values_folder
from relume_bench.figure import Figure

_BOUNDS = (0.05, 0.1, 0.2)
_AT_RATIO, _AT_ERROR = 50.0, 0.05
_RATIOS = (12.5, 25.0, _AT_RATIO, 100.0, 150.0)  # compared with the ideal coder's
_SOME_TEXELS = 200
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])  # ITU-R BT.709-6


class _Curve(NamedTuple):
    """Rate-distortion curve of one BTF: ratios and errors; seconds to the first bound; of_range: see the module."""

    samples: list[tuple[float, float]]
    seconds: float
    range_error: float
    delta_e: float
    least: list[float]

    @property
    def _best(self) -> NDArray[np.float64]:
        """Pareto-optimal points, logarithms, ratios and errors increasing. (2, n)"""
        best: list[tuple[float, float]] = []
        for ratio, error in sorted(self.samples, reverse=True):
            if not best or error < best[-1][1]:
                best.append((ratio, error))
        return np.asarray(np.log(best[::-1]).T)

    @property
    def errors(self) -> list[float]:
        """Errors at `_RATIOS`; beyond the measured range its last value."""
        ratio, error = self._best
        return [float(log_error) for log_error in np.exp(np.interp(np.log(_RATIOS), ratio, error))]

    @property
    def error(self) -> float:
        return self.errors[_RATIOS.index(_AT_RATIO)]

    @property
    def ratio(self) -> float:
        ratio, error = self._best
        return float(np.exp(np.interp(np.log(_AT_ERROR), error, ratio)))


def measure(tiny: bool) -> list[Figure]:
    """Make the three BTFs, and compress each for several bounds."""
    with open_values_folder(tiny) as values_folder:
        synthetic_btfs = {name: SyntheticBtf(name, values_folder, tiny) for name in GEOMETRIES}
        curves = {name: _curve(btf) for name, btf in synthetic_btfs.items()}
    first = synthetic_btfs["weave"]
    context = {
        "texels": "×".join(map(str, first.values.size)),
        "places_a_texel": first.grid**2,
        "curves": _describe(curves),
    }
    return [
        Figure("btf.compression_error", 100 * max(btf.error for btf in curves.values()), "%", context),
        Figure("btf.compression_ratio", min(btf.ratio for btf in curves.values()), "× smaller", context),
        Figure("btf.compression_s", max(btf.seconds for btf in curves.values()), "s", context),
    ]


def _curve(btf: SyntheticBtf) -> _Curve:
    samples, start_time, seconds, values = [], time.perf_counter(), 0.0, btf.values
    smallest: tuple[float, LocalPcaBtf] | None = None
    for bound in _BOUNDS:
        uncompressed = btf.compress(bound)
        seconds = seconds or time.perf_counter() - start_time
        for num in range(uncompressed.num_components + 1):
            bounds = uncompressed.with_components(num)
            ratio = bounds.measured_bytes / bounds.num_bytes
            samples.append((ratio, bounds.error[-1]))
            if ratio >= _AT_RATIO and (smallest is None or bounds.error[-1] < smallest[0]):
                smallest = bounds.error[-1], bounds
    sample = np.concatenate([values.get_view(view).ravel()[::7] for view in range(0, 81, 8)]).astype(np.float64)
    brightest = np.sort(sample)[-max(1, len(sample) // 1000) :]
    to_range = float(np.sqrt(np.mean(sample**2)) / np.sqrt(np.mean(brightest**2)))
    delta_e = float("nan") if smallest is None else _delta_e(values, smallest[1])
    return _Curve(samples, seconds, to_range, delta_e, _estimate_energy_bound(values))


def _estimate_energy_bound(values: ValueFile) -> list[float]:
    """Error of the ideal coder with as many bits, relative RMS, at each of `_RATIOS`: reverse water-filling.

    For independent Gaussian components of variances λ, R bits per texel leave Σ min(λ, θ) with R = Σ max(0, ½ log₂
    λ/θ). Components are the principal ones of each view, bits are shared between views, tables are free.
    """
    energy, level_variances = 0.0, []
    for view in range(values.grid.num_directions):
        rows = values.get_view(view).transpose(1, 0, 2).reshape(values.size[0] * values.size[1], -1)
        energy += float(np.einsum("ij,ij->", rows, rows, dtype=np.float64))
        centered = rows - rows.mean(axis=0)
        level_variances.append(np.linalg.eigvalsh((centered.T @ centered).astype(np.float64)))
    variance = np.maximum(np.concatenate(level_variances), 1e-12 * energy)
    level = np.geomspace(variance.min(), variance.max(), 4000)
    bits = np.array([0.5 * np.log2(np.maximum(variance / threshold, 1)).sum() for threshold in level])
    residual = np.array([np.minimum(variance, threshold).sum() for threshold in level])
    target_bits = 8 * 3 * values.grid.num_directions**2 / np.array(_RATIOS)  # bits of all views per texel
    return [float(threshold) for threshold in np.sqrt(np.interp(target_bits, bits[::-1], residual[::-1]) / energy)]


def _delta_e(values: ValueFile, compressed: LocalPcaBtf) -> float:
    """Mean color difference of some texels over all directions; white is a matte white surface in the same light."""
    texels = np.linspace(0, compressed.levels[0, 1] * compressed.levels[0, 2] - 1, _SOME_TEXELS).astype(int)
    decoded = np.stack([compressed.texel_brdf(texel) for texel in texels], axis=2)
    exact = np.stack([values.get_view(view)[:, texels] for view in range(len(decoded))])
    return float(np.linalg.norm(_to_lab(decoded) - _to_lab(exact), axis=-1).mean())


def _to_lab(values: NDArray[Any]) -> NDArray[np.float64]:
    """CIE L*a*b* of linear Rec. 709 radiance; white is a matte white surface. (..., 3)"""
    relative_xyz = np.pi * np.maximum(values, 0).astype(np.float64) @ (_TO_XYZ / _TO_XYZ.sum(axis=1, keepdims=True)).T
    x, y, z = np.moveaxis(
        np.where(relative_xyz > 216 / 24389, np.cbrt(relative_xyz), relative_xyz * 841 / 108 + 4 / 29), -1, 0
    )
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _describe(curves: dict[str, _Curve]) -> dict[str, Any]:
    return {
        name: {
            "curve": [
                f"1:{ratio:g} {error:.1%} ({least:.1%})"
                for ratio, error, least in zip(_RATIOS, curve.errors, curve.least, strict=True)
            ],
            "of_range": curve.error * curve.range_error,
            "delta_e": curve.delta_e,
        }
        for name, curve in curves.items()
    }
