"""Contraction of a term before projection: the free curve, and the bands of the fixed curves."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.simd import NUM as EIGHT

F32 = NDArray[np.float32]

_NOTHING = 1e-9
_MIN_STEP = 1e-30  # of a curve; denormal floats are several times slower
_FLAT = 1e-12  # band averages of a constant differ by rounding


class WholeCurves(NamedTuple):
    """The C curves of a term with none free, as `relume.transport.shading.table_averages` integrates them.

    Attributes:
        kinds, axes, scale, num_rows: as in `Contraction`.
        steps: per band: its value; sum of the values from it on; total variation from it on. Summed from the end, where
            curves mostly are small, so that differences of small values stay accurate.
    """

    kinds: Shaped[NDArray[np.int64], " C"]
    axes: Shaped[F32, "C 3"]
    scale: Shaped[F32, " C"]
    steps: Shaped[F32, "C bands 3 3"]
    num_rows: Shaped[NDArray[np.int64], " C"]


class Contraction(NamedTuple):
    """A term prepared for the kernels: the free curve, and the bands of the fixed curves.

    Attributes:
        kinds: `Angle` of each curve that depends on wi. axes: `Curve.axes` of each. scale: its bands per radian.
        bands: padded by 8, with the last band. decrements: decrease of each band from the previous one.
        num_rows: 1 if a curve is equal in all channels, else 3.
        settings: settings of the V curves with several settings, settings last: N, padded with zeros to a multiple of
            eight, or three times as many if channels differ.
        setting_index: row of each curve in `settings`, -1 for none.
        support: bands beyond which a fixed curve is zero; infinite for the free one.
        constant: product of the curves, if all are flat and none is listed.
        active: index of the free curve, -1 for none.
        num_settings: N, settings of the curves that are contracted at once; 1 with a free curve.
    """

    kinds: Shaped[NDArray[np.int64], " C"]
    axes: Shaped[F32, "C 3"]
    num_bands: Shaped[NDArray[np.int64], " C"]
    scale: Shaped[F32, " C"]
    bands: Shaped[F32, "C 3 padded"]
    decrements: Shaped[F32, "C 3 padded"]
    num_rows: Shaped[NDArray[np.int64], " C"]
    settings: Shaped[F32, "V padded columns"]
    setting_index: Shaped[NDArray[np.int64], " C"]
    support: Shaped[F32, " C"]
    constant: Shaped[F32, " 3"]
    active: int
    num_settings: int

    @property
    def num_columns(self) -> int:
        """Number of projected columns: J of the free curve, or N."""
        return int(self.num_bands[self.active]) if self.active >= 0 else self.num_settings

    def whole(self) -> WholeCurves:
        """Sum all curves, if none is free and each has one setting; once, as every range of points asks."""
        key = id(self.bands)
        if key not in _whole_curves:
            _whole_curves[key] = self._sum_curves()
            weakref.finalize(self.bands, _whole_curves.pop, key, None).atexit = False
        return _whole_curves[key]

    def without_tails(self, fraction: float) -> Contraction:
        """Return the same for highlights alone: curves end where they stay below a fraction of their peak."""
        support = [_support(rows[:, :num], fraction) for rows, num in zip(self.bands, self.num_bands, strict=True)]
        return self._replace(support=np.array(support, np.float32))

    def _sum_curves(self) -> WholeCurves:
        steps = np.zeros((*self.bands.shape, 3), np.float32)
        for curve_steps, bands, num in zip(steps, self.bands.astype(np.float64), self.num_bands, strict=True):
            values = bands[:, :num][:, ::-1]
            variation = np.abs(np.diff(values, axis=1, prepend=values[:, :1]))
            curve_steps[:, :num] = np.stack([values, values.cumsum(axis=1), variation.cumsum(axis=1)], axis=2)[:, ::-1]
        steps[np.abs(steps) < _MIN_STEP] = 0
        return WholeCurves(self.kinds, self.axes, self.scale, steps, self.num_rows)


_whole_curves: dict[int, WholeCurves] = {}
"""By identity of `Contraction.bands`, as long as these exist."""


def _support(rows: NDArray[np.floating], fraction: float = _NOTHING) -> float:
    """Count the bands beyond which every row of a curve (..., J) stays below a fraction of its peak."""
    above = rows > fraction * rows.max(axis=-1, keepdims=True)
    nonzero_bands = np.nonzero(above.reshape(-1, rows.shape[-1]).any(axis=0))[0]
    return float(nonzero_bands[-1] + 1) if len(nonzero_bands) else 0.0


def _is_flat(bands: NDArray[np.float64]) -> bool:
    """Return True if a curve (3, J) is constant up to rounding."""
    return bands.ndim == 2 and bool(np.all(np.ptp(bands, axis=1) <= _FLAT * np.abs(bands[:, 0])))


def _settings(curves: Sequence[NDArray[np.float64]], widest: int) -> F32:
    """Lay out curves (3, N, J) as `Contraction.settings`. widest: bands of the widest curve, padded"""
    if not curves:
        return np.empty((0, widest, 0), np.float32)
    num_channels = 1 if all(np.all(bands == bands[0]) for bands in curves) else 3
    num_padded = -(-curves[0].shape[1] // EIGHT) * EIGHT
    table = np.zeros((len(curves), widest, num_channels, num_padded), np.float32)
    for rows, bands in zip(table, curves, strict=True):
        rows[: bands.shape[2], :, : bands.shape[1]] = bands[:num_channels].transpose(2, 0, 1)
    return table.reshape(len(curves), widest, -1)


def contract(term: Term, bands: Mapping[str, NDArray[np.float64]], active: str | None) -> Contraction:
    """Contract a term; curves of the outgoing angle are omitted (they multiply the finished sample).

    Args:
        term: with these curves. bands: bands of each curve by name. (3, J) float64, or (3, N, J) for N settings at once
        active: the free curve, None to contract all.
    """
    curves = [curve for curve in term.curves if not curve.depends_on_view]
    constant = np.ones(3)
    if active is None and all(_is_flat(bands[curve.name]) for curve in curves):
        # no dependence on an angle; beside any other curve flat ones stay, since every angle decides where triangles
        # are divided, and this must not change when a curve becomes flat
        constant = np.prod([constant, *(bands[curve.name].mean(axis=1) for curve in curves)], axis=0)
        curves = []
    all_bands = [bands[curve.name] for curve in curves]
    multiple_settings = [rows for rows in all_bands if rows.ndim == 3]
    free = next((k for k, curve in enumerate(curves) if curve.name == active), -1)
    widest = max((rows.shape[-1] for rows in all_bands), default=1) + EIGHT
    single_setting = [rows if rows.ndim == 2 else np.zeros((3, rows.shape[2])) for rows in all_bands]
    padded = [np.pad(rows, ((0, 0), (0, widest - rows.shape[1])), mode="edge") for rows in single_setting]
    has_settings = np.array([rows.ndim == 3 for rows in all_bands], bool)
    all_rows = np.array(padded, np.float32).reshape(len(curves), 3, widest)
    num_bands = np.array([rows.shape[-1] for rows in all_bands], np.int64)
    return Contraction(
        kinds=np.array([int(curve.angle) for curve in curves], np.int64),
        axes=np.array([curve.axes for curve in curves], np.float32).reshape(-1, 3),
        num_bands=num_bands,
        scale=np.asarray(num_bands / (np.pi / 2), np.float32),
        bands=all_rows,
        decrements=-np.diff(all_rows.astype(np.float64), axis=2, prepend=all_rows[:, :, :1]).astype(np.float32),
        num_rows=np.array([1 if np.all(rows == rows[0]) else 3 for rows in single_setting], np.int64),
        settings=_settings(multiple_settings, widest),
        setting_index=np.where(has_settings, np.cumsum(has_settings) - 1, -1),
        support=np.array([np.inf if k == free else _support(rows) for k, rows in enumerate(all_bands)], np.float32),
        constant=constant.astype(np.float32),
        active=free,
        num_settings=multiple_settings[0].shape[1] if multiple_settings else 1,
    )
