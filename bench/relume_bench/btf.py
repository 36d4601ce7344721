"""btf.compression_*: how well BTFs are kept.

`btf.compression_error`: relative RMS of all values, of what is kept as it is rounded, where it is a fiftieth of a byte
for each channel of each image; the worst of the three synthetic BTFs. `curve` of the context: ratio and error of what
was kept for three bounds, with fewer and fewer of its components; between the best of them, logarithms are linear. In
brackets is what the ideal coder of as many bytes misses, whose tables cost nothing. The norm:
√Σ(kept − made)² ÷ √Σ made²; `range_error` divides by √mean square of the brightest thousandth instead, as errors of
8-bit images are often told; `delta_e` is the mean colour difference (CIE 1976) of texels in full light at that ratio.
`btf.compression_ratio`: at an error of 5 %. `btf.compression_s`: what the slowest of the three takes to 5 %.
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
_RATIOS = (12.5, 25.0, _AT_RATIO, 100.0, 150.0)  # that the curve is told at, beside the ideal coder's
_SOME_TEXELS = 200
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])  # ITU-R BT.709-6


class _Curve(NamedTuple):
    """Of one BTF: ratios and errors of what may be kept; seconds to the first bound; of_range: see the module."""

    samples: list[tuple[float, float]]
    seconds: float
    range_error: float
    delta_e: float
    least: list[float]

    @property
    def _best(self) -> NDArray[np.float64]:
        """Points that no other is better than in both, logarithms, ratios and errors rising. (2, n)"""
        best: list[tuple[float, float]] = []
        for ratio, error in sorted(self.samples, reverse=True):
            if not best or error < best[-1][1]:
                best.append((ratio, error))
        return np.asarray(np.log(best[::-1]).T)

    @property
    def errors(self) -> list[float]:
        """At each of `_RATIOS`; beyond what was tried the last of it."""
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
    """Make the three, and compress each for some bounds."""
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
    """What the ideal coder of as many bits misses, relative RMS, at each of `_RATIOS`: reverse water-filling.

    Of independent Gaussian components of variances λ, R bits a texel leave Σ min(λ, θ) with R = Σ max(0, ½ log₂ λ/θ).
    Components are the best of each view, bits go to whichever view they tell most of, tables cost nothing.
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
    target_bits = 8 * 3 * values.grid.num_directions**2 / np.array(_RATIOS)  # bits of all views of a texel
    return [float(threshold) for threshold in np.sqrt(np.interp(target_bits, bits[::-1], residual[::-1]) / energy)]


def _delta_e(values: ValueFile, compressed: LocalPcaBtf) -> float:
    """Mean colour difference of some texels from all sides, where white is a matt white surface in the same light."""
    texels = np.linspace(0, compressed.levels[0, 1] * compressed.levels[0, 2] - 1, _SOME_TEXELS).astype(int)
    decoded = np.stack([compressed.texel_brdf(texel) for texel in texels], axis=2)
    exact = np.stack([values.get_view(view)[:, texels] for view in range(len(decoded))])
    return float(np.linalg.norm(_to_lab(decoded) - _to_lab(exact), axis=-1).mean())


def _to_lab(values: NDArray[Any]) -> NDArray[np.float64]:
    """CIE L*a*b* of linear Rec. 709 radiance; white is what a matt white surface sends. (..., 3)"""
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
