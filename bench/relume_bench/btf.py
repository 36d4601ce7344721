"""btf.compression_*: error, ratio and time of BTF compression, both coders side by side.

Six synthetic BTFs: three reliefs (weave, pebbles, corduroy) and three flat materials of images (felt, leather, print),
256 × 256 texels, or as many as the environment variable RELUME_BTF_TEXELS says.

`btf.compression_error`: relative RMS of all values after compression and rounding at 1/50 byte per channel and image,
√Σ(compressed − original)² ÷ √Σ original², the better coder; the worst relief. `btf.compression_flat_error`: the worst
flat material. The context has both coders for each material in four norms, since Müller 2004 states none: `linear`, the
one above; `energy`, its square; `srgb`, RMS of 8-bit sRGB values over 255, of radiance over that of a matte white
surface in the same light; `delta_e`, mean CIE 1976 color difference for the same white. Further: `ratio`; `memory_mb`
of the arrays and tables while rendering; `ideal`, the relative RMS of the ideal coder of single views at that ratio,
without its tables, which bounds no coder that uses several views. `btf.compression_ratio`: at an error of 5 %, reliefs.
`btf.compression_s`: time of the slowest relief to 5 %.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from relume.assets.btf.compress import Coders
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.partial_results import PartialCompression
from relume.assets.btf.stored_arrays import stored_bytes
from relume.assets.btf.value_cache import ValueFile
from relume.core.color import srgb_encode
from relume.core.memory_usage import live_bytes
from relume.image_io.color_difference import to_lab
from relume.synthetic_btf.synthesize import GEOMETRIES
from relume_bench.btf_flat import FLAT_MATERIALS
from relume_bench.btf_synthetic import SyntheticBtf, compression_texels, open_values_folder
from relume_bench.figure import Figure

_AT_RATIO, _AT_ERROR = 50.0, 0.05
_LEAST_BOUND, _MOST_BOUND = 0.005, 0.5
_TRIALS = 4  # compressions per coder; each halves the interval of bounds, as a ratio
_SOME_TEXELS = 200


class _Compression(NamedTuple):
    """The smallest error of a coder at the ratio: relative RMS, and the figures of the context."""

    error: float
    figures: dict[str, float]


def measure(tiny: bool) -> list[Figure]:
    """Make the BTFs, and compress each by both coders."""
    with open_values_folder(tiny) as values_folder:
        btfs = {name: SyntheticBtf(name, values_folder, tiny, compression_texels()) for name in _names()}
        results = {name: _compare_coders(btf) for name, btf in btfs.items()}
        relief_times = [_time(btfs[name]) for name in GEOMETRIES]
    context = {
        "texels": "×".join(map(str, btfs["weave"].values.size)),
        "places_a_texel": {name: btf.grid**2 for name, btf in btfs.items()},
        "coders": {
            name: {coder: result.figures if result else None for coder, result in by_coder.items()}
            for name, by_coder in results.items()
        },
    }
    best = {
        name: min((result.error for result in by_coder.values() if result), default=1.0)
        for name, by_coder in results.items()
    }
    return [
        Figure("btf.compression_error", 100 * max(best[name] for name in GEOMETRIES), "%", context),
        Figure("btf.compression_flat_error", 100 * max(best[name] for name in FLAT_MATERIALS), "%", context),
        Figure("btf.compression_ratio", min(ratio for _, ratio in relief_times), "× smaller", context),
        Figure("btf.compression_s", max(seconds for seconds, _ in relief_times), "s", context),
    ]


def _names() -> tuple[str, ...]:
    return *GEOMETRIES, *FLAT_MATERIALS


def _time(btf: SyntheticBtf) -> tuple[float, float]:
    """Seconds of a compression to `_AT_ERROR`, and its ratio."""
    start_time = time.perf_counter()
    compressed = btf.compress(_AT_ERROR)
    return time.perf_counter() - start_time, compressed.measured_bytes / stored_bytes(compressed)


def _compare_coders(btf: SyntheticBtf) -> dict[str, _Compression | None]:
    """Both coders at `_AT_RATIO`."""
    with tempfile.TemporaryDirectory() as folder:
        partial = PartialCompression(Path(folder), {})
        coders = Coders(btf.values, btf.height, lambda fraction: None, lambda: False, partial)
        ideal = _estimate_energy_bound(btf.values)
        return {
            name: _at_ratio(compress_to, btf.values, ideal)
            for name, compress_to in (("per_view", coders.per_view), ("whole_brdfs", coders.whole_brdfs))
        }


def _at_ratio(
    compress_to: Callable[[float], LocalPcaBtf | None], values: ValueFile, ideal: float
) -> _Compression | None:
    """Search the bound with the smallest error at `_AT_RATIO`."""
    best: tuple[LocalPcaBtf, float] | None = None
    low, high = np.log((_LEAST_BOUND, _MOST_BOUND))
    for _ in range(_TRIALS):
        middle = 0.5 * (low + high)
        compressed = compress_to(float(np.exp(middle)))
        if compressed is None:  # the bound is out of reach
            low = middle
            continue
        trials = [compressed.with_components(num) for num in range(compressed.num_components + 1)]
        ratios = [trial.measured_bytes / stored_bytes(trial) for trial in trials]
        for trial, ratio in zip(trials, ratios, strict=True):
            if ratio >= _AT_RATIO and (best is None or trial.error[-1] < best[0].error[-1]):
                best = trial, ratio
        low, high = (low, middle) if ratios[-1] >= _AT_RATIO else (middle, high)
    return None if best is None else _describe(values, *best, ideal)


def _describe(values: ValueFile, compressed: LocalPcaBtf, ratio: float, ideal: float) -> _Compression:
    error = compressed.error[-1]
    texels = np.linspace(0, compressed.size[0] * compressed.size[1] - 1, _SOME_TEXELS).astype(int)
    decoded = np.stack([compressed.texel_brdf(texel) for texel in texels], axis=2)
    exact = np.stack([values.get_view(view)[:, texels] for view in range(len(decoded))])
    encoded, exact_encoded = (np.rint(255 * srgb_encode(np.clip(np.pi * each, 0, 1))) for each in (decoded, exact))
    srgb = float(np.sqrt(np.mean((encoded - exact_encoded) ** 2)) / 255)
    labs = [to_lab(np.pi * np.maximum(each, 0).astype(np.float64)) for each in (decoded, exact)]  # white is matte
    delta_e = float(np.linalg.norm(np.subtract(*labs), axis=-1).mean())
    return _Compression(
        error,
        {
            "linear": error, "energy": error**2, "srgb": srgb, "delta_e": delta_e, "ratio": ratio,
            "clusters": compressed.mean.shape[1], "components": compressed.num_components,
            "memory_mb": (live_bytes(compressed) + compressed.tables().nbytes) / 1e6, "ideal": ideal,
        },
    )  # fmt: skip


def _estimate_energy_bound(values: ValueFile) -> float:
    """Error of the ideal coder of single views at `_AT_RATIO`, relative RMS: reverse water-filling.

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
    target_bits = 8 * 3 * values.grid.num_directions**2 / _AT_RATIO  # bits of all views per texel
    return float(np.sqrt(np.interp(target_bits, bits[::-1], residual[::-1]) / energy))
