"""btf.*: how well BTFs are kept, how near they are to what they stand for, how quickly they are shown.

`btf.compression_error`: relative RMS of all values, of what is kept as it is rounded, where it is a fiftieth of a byte
for each channel of each image; the worst of the three synthetic BTFs. `points` of the context is the curve: ratio and
error of what was kept for three bounds, with fewer and fewer of its components; between the best of them, logarithms
are linear. The norm: √Σ(kept − made)² ÷ √Σ made²; `of_range` divides by √mean square of the brightest thousandth
instead, as errors of 8-bit images are often told; `delta_e` is the mean colour difference (CIE 1976) of texels in full
light at that ratio.
`btf.compression_ratio`: at an error of 5 %. `btf.compression_s`: what the slowest of the three takes to 5 %.

`btf.geometry_rmse`: a plane that is covered with the woven BTF, under a sky, against Mitsuba's paths through the real
small geometry on the same place, seen from between the directions that the BTF was made for. Its noise is taken off.
`btf.table_rmse`: the same plane's view samples against sums over all values before compression.

`btf.view_fps`, `btf.light_ms`: the still life at 400×400, every surface covered with the weave: frames while the eye
moves, and from a turned environment to the frame, all bounces, followed roughly.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.btf_pictures import against_geometry, against_table
from bench.figure import Figure
from bench.moving_scene import MovingScene, rotated
from relume.btf.compress import compress
from relume.btf.eigen import EigenBtf
from relume.btf.rings import ubo_rings
from relume.btf.shelf import STORE, BtfRecord, keep
from relume.btf.values import Values
from relume.synthetic.make import GEOMETRIES
from relume.synthetic.render import SmallGeometry

_BOUNDS = (0.05, 0.1, 0.2)
_FINE = 0.02  # of what is compared with all values
_AT_RATIO, _AT_ERROR = 50.0, 0.05
_SOME_TEXELS = 200
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])  # ITU-R BT.709-6


class _Curve(NamedTuple):
    """Of one BTF: ratios and errors of what may be kept; seconds to the first bound; of_range: see the module."""

    points: list[tuple[float, float]]
    seconds: float
    of_range: float
    delta_e: float

    @property
    def _best(self) -> NDArray[np.float64]:
        """Points that no other is better than in both, logarithms, ratios and errors rising. (2, n)"""
        best: list[tuple[float, float]] = []
        for ratio, error in sorted(self.points, reverse=True):
            if not best or error < best[-1][1]:
                best.append((ratio, error))
        return np.asarray(np.log(best[::-1]).T)

    @property
    def error(self) -> float:
        ratio, error = self._best
        return float(np.exp(np.interp(np.log(_AT_RATIO), ratio, error)))

    @property
    def ratio(self) -> float:
        ratio, error = self._best
        return float(np.exp(np.interp(np.log(_AT_ERROR), error, ratio)))


def measure(tiny: bool) -> list[Figure]:
    """Make the three, compress each for some bounds, and compare and show the first."""
    size, grid = (8, 1) if tiny else (128, 2)
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        made = {name: _made(name, at / name, size, grid) for name in GEOMETRIES}
        curves = {name: _curve(values) for name, values in made.items()}
        context = {"texels": f"{size}×{size}", "places_a_texel": grid**2, "curves": _told(curves)}
        with STORE.at(at / "btfs"):
            record = _kept(at, made["weave"], _BOUNDS[0])
            return [
                Figure("btf.compression_error", 100 * max(one.error for one in curves.values()), "%", context),
                Figure("btf.compression_ratio", min(one.ratio for one in curves.values()), "× smaller", context),
                Figure("btf.compression_s", max(one.seconds for one in curves.values()), "s", context),
                against_geometry(record, at, tiny),
                against_table(_kept(at, made["weave"], _FINE), made["weave"], at, tiny),
                *_shown(record, at, tiny),
            ]


def _made(name: str, folder: Path, size: int, grid: int) -> Values:
    values = Values(folder, ubo_rings(), (size, size))
    small = SmallGeometry(GEOMETRIES[name](), ubo_rings(), (size, size), grid, 1)
    values.fill(small.seen_from, lambda share: None, lambda: False)
    return values


def _compressed(values: Values, bound: float) -> EigenBtf:
    return compress(values, bound, lambda share: None, lambda: False)


def _kept(folder: Path, values: Values, bound: float) -> BtfRecord:
    source = folder / "weave.json"
    source.write_text(str(bound))
    return keep(folder / "btfs", source, "Weave", "weave", lambda: _compressed(values, bound))


def _curve(values: Values) -> _Curve:
    points, began, seconds = [], time.perf_counter(), 0.0
    smallest: tuple[float, EigenBtf] | None = None
    for bound in _BOUNDS:
        whole = _compressed(values, bound)
        seconds = seconds or time.perf_counter() - began
        for num in range(whole.num_components + 1):
            fewer = whole.with_components(num)
            ratio = fewer.measured_bytes / fewer.num_bytes
            points.append((ratio, fewer.error[-1]))
            if ratio >= _AT_RATIO and (smallest is None or fewer.error[-1] < smallest[0]):
                smallest = fewer.error[-1], fewer
    sample = np.concatenate([values.seen_from(view).ravel()[::7] for view in range(0, 81, 8)]).astype(np.float64)
    brightest = np.sort(sample)[-max(1, len(sample) // 1000) :]
    to_range = float(np.sqrt(np.mean(sample**2)) / np.sqrt(np.mean(brightest**2)))
    return _Curve(points, seconds, to_range, float("nan") if smallest is None else _delta_e(values, smallest[1]))


def _delta_e(values: Values, kept: EigenBtf) -> float:
    """Mean colour difference of some texels from all sides, where white is a matt white surface in the same light."""
    chosen = np.linspace(0, kept.levels[0, 1] * kept.levels[0, 2] - 1, _SOME_TEXELS).astype(int)
    found = np.stack([kept.texel(texel) for texel in chosen], axis=2)
    made = np.stack([values.seen_from(view)[:, chosen] for view in range(len(found))])
    return float(np.linalg.norm(_lab(found) - _lab(made), axis=-1).mean())


def _lab(values: NDArray[Any]) -> NDArray[np.float64]:
    """CIE L*a*b* of linear Rec. 709 radiance; white is what a matt white surface sends. (..., 3)"""
    of_white = np.pi * np.maximum(values, 0).astype(np.float64) @ (_TO_XYZ / _TO_XYZ.sum(axis=1, keepdims=True)).T
    x, y, z = np.moveaxis(np.where(of_white > 216 / 24389, np.cbrt(of_white), of_white * 841 / 108 + 4 / 29), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _told(curves: dict[str, _Curve]) -> dict[str, Any]:
    return {
        name: {
            "points": [f"1:{ratio:.0f} {error:.1%}" for ratio, error in sorted(one.points)],
            "of_range": one.error * one.of_range,
            "delta_e": one.delta_e,
        }
        for name, one in curves.items()
    }


def _shown(record: BtfRecord, folder: Path, tiny: bool) -> list[Figure]:
    still = MovingScene("interior" if tiny else "still_life", folder, (40, 40) if tiny else (400, 400), tiny)

    def covered(document: dict[str, Any]) -> None:
        for material in document["materials"].values():
            material["terms"] = [{**record.terms()[0], "params": {"scale": 4.0}}]

    def turned(document: dict[str, Any], share: float) -> None:
        covered(document)
        rotated(document, share)

    frames = 3 if tiny else 40
    eye, light = still.eye_s(frames, covered), still.edits(frames, turned, is_watched=True)
    context = {"size": "400×400", "points": still.num_points, "every_surface": "woven"}
    return [
        Figure("btf.view_fps", 1 / float(np.median(eye)), "frames/s", context),
        Figure("btf.light_ms", 1e3 * light.median_s, "ms", {**context, **light.said(), "bounces": "all"}),
    ]
