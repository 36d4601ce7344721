"""The projector: bins the light that reaches a point along one curve, every other curve multiplied in.

    T_j(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_{f ≠ active} mean_m(f) · Δ_{m,j}

Eqs. 21, 22 and 25 with 26 carried out at once, Ben-Artzi 2006: U is never stored. Triangles over which an angle is not
linear (near its pole) are divided into four until it is (appendix A).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.transfer.eight_bands import NUM as EIGHT
from relume.transfer.listing import list_lights
from relume.transfer.project_kernel import project_points

F32 = NDArray[np.float32]

_NOTHING = 1e-9
_FLAT = 1e-12  # band averages of a constant differ by rounding
_POINTS_A_BLOCK = 48  # directions of a block stay in a core's second-level cache


@dataclass(frozen=True)
class Receivers:
    """Points that light arrives at, seen from one direction each; a pixel or a vertex may own them.

    Attributes:
        normal, tangent: shading frame. wo: towards the viewer. (n, 3) float32, unit
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon. (n, bytes) uint8
    """

    normal: F32
    tangent: F32
    wo: F32
    visible: NDArray[np.uint8]


@dataclass(frozen=True)
class Contraction:
    """A term made ready for the kernel: which curve stays free, and the bands of those that do not.

    Attributes:
        kinds: `Angle` of each curve that depends on wi. (C,) int64
        axes: `Curve.axes` of each. (C, 3) float32
        num_bands: (C,) int64
        bands: padded with the last band; rows are the N settings of each channel, as far as they differ, channel by
            channel. (C, at most 3 N, max J + 8) float32
        num_rows: how many rows of each curve differ: 1, N or 3 N. (C,) int64
        support: bands beyond which a dormant curve is nothing; infinite for the free one. (C,) float32
        constant: product of the curves, where all are flat and none is listed. (3,) float32
        active: index of the free curve, -1 for none.
        num_settings: N, settings of the curves that are contracted at once; 1 where a curve is free.
    """

    kinds: NDArray[np.int64]
    axes: F32
    num_bands: NDArray[np.int64]
    bands: F32
    num_rows: NDArray[np.int64]
    support: F32
    constant: F32
    active: int
    num_settings: int

    @property
    def num_columns(self) -> int:
        """J of the free curve, or N."""
        return int(self.num_bands[self.active]) if self.active >= 0 else self.num_settings


def _support(rows: NDArray[np.float64]) -> float:
    """Number of bands after which each of a curve's rows stays below a billionth of its own peak. rows: (R, J)"""
    seen = np.nonzero((rows > _NOTHING * rows.max(axis=1, keepdims=True)).any(axis=0))[0]
    return float(seen[-1] + 1) if len(seen) else 0.0


def _is_flat(bands: NDArray[np.float64]) -> bool:
    """Whether a curve (3, J) is the same everywhere, but for rounding."""
    return bands.ndim == 2 and bool(np.all(np.ptp(bands, axis=1) <= _FLAT * np.abs(bands[:, 0])))


def _rows(bands: NDArray[np.float64], num_settings: int) -> NDArray[np.float64]:
    """A curve's rows as far as they differ, see `Contraction.bands`. (3, J) or (3, N, J) -> (1, N or 3 N, J)"""
    if np.all(bands == bands[0]):
        return np.atleast_2d(bands[0])
    return bands.reshape(-1, bands.shape[-1]) if bands.ndim == 3 else np.repeat(bands, num_settings, axis=0)


def contract(term: Term, bands: Mapping[str, NDArray[np.float64]], active: str | None) -> Contraction:
    """Make a term ready: curves of the outgoing angle are left out (they multiply the finished sample).

    Args:
        bands: of each curve by name. (3, J) float64, or (3, N, J) for N settings of it at once
        active: the curve that stays free, None to contract all.
    """
    curves = [curve for curve in term.curves if not curve.outgoing]
    constant = np.ones(3)
    if active is None and all(_is_flat(bands[curve.name]) for curve in curves):
        # nothing depends on an angle; with any other curve flat ones stay, for every angle decides where triangles are
        # divided, and a curve that becomes flat must not change that
        constant = np.prod([bands[curve.name].mean(axis=1) for curve in curves], axis=0)
        curves = []
    num_settings = max((bands[curve.name].shape[1] for curve in curves if bands[curve.name].ndim == 3), default=1)
    rows = [_rows(bands[curve.name], num_settings) for curve in curves]
    free = next((k for k, curve in enumerate(curves) if curve.name == active), -1)
    widest = max((row.shape[1] for row in rows), default=1) + EIGHT
    highest = max((len(row) for row in rows), default=1)
    padded = [
        np.pad(np.pad(row, ((0, 0), (0, widest - row.shape[1])), mode="edge"), ((0, highest - len(row)), (0, 0)))
        for row in rows
    ]
    return Contraction(
        np.array([int(curve.angle) for curve in curves], np.int64),
        np.array([curve.axes for curve in curves], np.float32).reshape(-1, 3),
        np.array([row.shape[1] for row in rows], np.int64),
        np.array(padded, np.float32).reshape(len(rows), highest, widest),
        np.array([len(row) for row in rows], np.int64),
        np.array([np.inf if k == free else _support(row) for k, row in enumerate(rows)], np.float32),
        constant.astype(np.float32),
        free,
        num_settings,
    )


class Projector:
    """Projects ranges of receivers under one contraction; holds the scratch memory of one thread."""

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: Receivers) -> None:
        self._term, self._contraction, self._lights, self._receivers = term, contraction, lights, receivers
        self._power = lights.power * contraction.constant
        # radians
        self._support = contraction.support * np.float32(np.pi / 2) / contraction.num_bands.astype(np.float32)
        capacity = _POINTS_A_BLOCK * lights.num_lights
        self._first = np.empty(_POINTS_A_BLOCK + 1, np.int64)
        self._light = np.empty(capacity + 1, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)

    def project(self, start: int, stop: int) -> F32:
        """Transport of points [start, stop) along the free curve, in its bands.

        Returns:
            (stop - start, J, 3) float32; with no free curve (stop - start, N, 3).
        """
        c = self._contraction
        shape = (3, c.num_columns + EIGHT) if c.active >= 0 else (3 * c.num_settings, 1)
        out = np.zeros((stop - start, *shape), np.float32)
        for block in range(start, stop, _POINTS_A_BLOCK):
            end = min(block + _POINTS_A_BLOCK, stop)
            self._block(block, end, out[block - start : end - start])
        return out.reshape(stop - start, 3, shape[0] * shape[1] // 3)[:, :, : c.num_columns].transpose(0, 2, 1)

    def _block(self, start: int, stop: int, out: F32) -> None:
        r, lights, c = self._receivers, self._lights, self._contraction
        num = list_lights(
            r.normal,
            r.tangent,
            r.wo,
            r.visible,
            lights.direction,
            lights.radius,
            c.kinds,
            self._support,
            start,
            stop,
            self._first,
            self._light,
            self._wi,
            self._wo,
        )
        wi, wo = self._wi[:, :num], self._wo[:, :num]
        shading = self._term.quotients(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
        shading *= wi[2]
        project_points(
            r.normal,
            r.tangent,
            self._first,
            self._light,
            shading,
            wo,
            lights.nodes,
            self._power,
            c.kinds,
            c.axes,
            c.num_bands,
            c.bands,
            c.num_rows,
            c.support,
            c.active,
            start,
            stop,
            out,
        )
