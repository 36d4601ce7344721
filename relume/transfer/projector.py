"""The projector: bins the light that reaches a point along one curve, every other curve multiplied in.

    T_j(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_{f ≠ active} mean_m(f) · Δ_{m,j}

Eqs. 21, 22 and 25 with 26 carried out at once, Ben-Artzi 2006: U is never stored. Triangles over which an angle is not
linear (near its pole) are divided into four until it is (appendix A).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.brdf.angles import angle_at, angles_into
from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.transfer.overlap import deposit, multiply_mean

F32 = NDArray[np.float32]

# an angle counts as linear over a triangle when its value at the centroid is this close to the corners' mean, in bands
_TOLERANCE_BANDS = np.float32(0.5)
_MAX_DEPTH = 4
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
        num_bands: (C,) int64
        bands: padded with the last band. (C, 3, max J) float32
        constant: product of the curves that are flat. (3,) float32
        active: index of the free curve, -1 for none.
    """

    kinds: NDArray[np.int64]
    num_bands: NDArray[np.int64]
    bands: F32
    constant: F32
    active: int

    @property
    def num_columns(self) -> int:
        """J of the free curve, or 1."""
        return int(self.num_bands[self.active]) if self.active >= 0 else 1


def contract(term: Term, bands: Mapping[str, NDArray[np.float64]], active: str | None) -> Contraction:
    """Make a term ready: curves of the outgoing angle are left out (they multiply the finished sample).

    Args:
        bands: of each curve by name. (3, J) float64
        active: the curve that stays free, None to contract all.
    """
    kinds, rows, free, constant = [], [], -1, np.ones(3)
    for curve in term.curves:
        if curve.outgoing:
            continue
        values = bands[curve.name]
        if curve.name == active:
            free = len(rows)
        elif np.all(values == values[:, :1]):
            constant *= values[:, 0]
            continue
        kinds.append(int(curve.angle))
        rows.append(values)
    widest = max((row.shape[1] for row in rows), default=1)
    padded = [np.pad(row, ((0, 0), (0, widest - row.shape[1])), mode="edge") for row in rows]
    return Contraction(
        np.array(kinds, np.int64),
        np.array([row.shape[1] for row in rows], np.int64),
        np.array(padded, np.float32).reshape(len(rows), 3, widest),
        constant.astype(np.float32),
        free,
    )


@nb.njit(nogil=True, cache=True, fastmath=True)
def _local_directions(normal, tangent, wo, visible, directions, start, stop, first, light, wi, out):  # type: ignore[no-untyped-def]
    """List the visible lights of points [start, stop) in their local frames.

    Writes first (points + 1,), light (K,), wi (3, K) and wo as `out` (3, K); returns K.
    """
    n = 0
    for p in range(start, stop):
        first[p - start] = n
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        tx, ty, tz = tangent[p, 0], tangent[p, 1], tangent[p, 2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        ox = tx * wo[p, 0] + ty * wo[p, 1] + tz * wo[p, 2]
        oy = bx * wo[p, 0] + by * wo[p, 1] + bz * wo[p, 2]
        oz = nx * wo[p, 0] + ny * wo[p, 1] + nz * wo[p, 2]
        for m in range(directions.shape[0]):
            if (visible[p, m >> 3] >> (m & 7)) & 1 == 0:
                continue
            x, y, z = directions[m, 0], directions[m, 1], directions[m, 2]
            light[n] = m
            wi[0, n] = tx * x + ty * y + tz * z
            wi[1, n] = bx * x + by * y + bz * z
            wi[2, n] = nx * x + ny * y + nz * z
            out[0, n], out[1, n], out[2, n] = ox, oy, oz
            n += 1
    first[stop - start] = n
    return n


@nb.njit(nogil=True, cache=True, fastmath=True)
def _leaf(kinds, active, bands, num_bands, corner_gamma, weight, out):  # type: ignore[no-untyped-def]
    """Deposit one triangle over which all angles are linear. corner_gamma (C, 3) in bands; weight (3,), destroyed."""
    for k in range(kinds.shape[0]):
        if k != active:
            multiply_mean(
                corner_gamma[k, 0], corner_gamma[k, 1], corner_gamma[k, 2], bands[k, :, : num_bands[k]], weight
            )
    if active >= 0:
        deposit(corner_gamma[active, 0], corner_gamma[active, 1], corner_gamma[active, 2], weight, out)
    else:
        for channel in range(3):
            out[channel, 0] += weight[channel]


@nb.njit(nogil=True, cache=True, fastmath=True)
def _is_linear(kinds, scale, corner_gamma, x, y, z, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Whether every angle at the centroid (x, y, z) agrees with the mean of its corners."""
    for k in range(kinds.shape[0]):
        mean = (corner_gamma[k, 0] + corner_gamma[k, 1] + corner_gamma[k, 2]) * np.float32(1 / 3)
        if abs(scale[k] * angle_at(kinds[k], x, y, z, ox, oy, oz) - mean) > _TOLERANCE_BANDS:
            return False
    return True


@nb.njit(nogil=True, cache=True, fastmath=True)
def _divided(kinds, active, bands, num_bands, scale, corners, weight, ox, oy, oz, stack, depth, gamma, part, out):  # type: ignore[no-untyped-def]
    """Deposit a triangle (corners (3, 3) local) by dividing it in four until its angles are linear.

    stack (levels, 3, 3), depth (levels,): scratch of a depth-first walk. Chord areas share out the weight.
    """
    stack[0] = corners
    depth[0] = 0
    top = 1
    while top > 0:
        top -= 1
        level = depth[top]
        a, b, c = stack[top, 0].copy(), stack[top, 1].copy(), stack[top, 2].copy()
        for k in range(kinds.shape[0]):
            gamma[k, 0] = scale[k] * angle_at(kinds[k], a[0], a[1], a[2], ox, oy, oz)
            gamma[k, 1] = scale[k] * angle_at(kinds[k], b[0], b[1], b[2], ox, oy, oz)
            gamma[k, 2] = scale[k] * angle_at(kinds[k], c[0], c[1], c[2], ox, oy, oz)
        m = a + b + c
        m /= np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
        if level == _MAX_DEPTH or _is_linear(kinds, scale, gamma, m[0], m[1], m[2], ox, oy, oz):
            share = np.float32(0.25**level)
            for channel in range(3):
                part[channel] = weight[channel] * share
            _leaf(kinds, active, bands, num_bands, gamma, part, out)
            continue
        ab, bc, ca = a + b, b + c, c + a
        ab /= np.sqrt(ab[0] * ab[0] + ab[1] * ab[1] + ab[2] * ab[2])
        bc /= np.sqrt(bc[0] * bc[0] + bc[1] * bc[1] + bc[2] * bc[2])
        ca /= np.sqrt(ca[0] * ca[0] + ca[1] * ca[1] + ca[2] * ca[2])
        stack[top, 0], stack[top, 1], stack[top, 2] = a, ab, ca
        stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2] = ab, b, bc
        stack[top + 2, 0], stack[top + 2, 1], stack[top + 2, 2] = ca, bc, c
        stack[top + 3, 0], stack[top + 3, 1], stack[top + 3, 2] = ab, bc, ca
        depth[top : top + 4] = level + 1
        top += 4


@nb.njit(nogil=True, cache=True, fastmath=True)
def _project(
    normal, tangent, first, light, shading, local_wo, vertices, faces, centroid, power, kinds, num_bands, bands, constant,
    active, start, stop, out,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Project points [start, stop); `first`, `light`, `shading` (q · cos θi) and `local_wo` list their visible lights."""
    num_curves, num_vertices = kinds.shape[0], vertices.shape[0]
    scale = np.empty(num_curves, np.float32)
    for k in range(num_curves):
        scale[k] = num_bands[k] / (np.pi / 2)
    local = np.empty((3, num_vertices), np.float32)
    gamma = np.empty((num_curves, num_vertices), np.float32)
    corner_gamma = np.empty((num_curves, 3), np.float32)
    sub_gamma = np.empty((num_curves, 3), np.float32)
    corners = np.empty((3, 3), np.float32)
    stack = np.empty((3 * _MAX_DEPTH + 2, 3, 3), np.float32)
    depth = np.empty(3 * _MAX_DEPTH + 2, np.int64)
    weight = np.empty(3, np.float32)
    part = np.empty(3, np.float32)
    for p in range(start, stop):
        row = p - start
        if first[row] == first[row + 1]:
            continue
        n, t = normal[p], tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        ox, oy, oz = local_wo[0, first[row]], local_wo[1, first[row]], local_wo[2, first[row]]
        if num_curves > 0:
            for v in range(num_vertices):
                x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
                local[0, v] = t[0] * x + t[1] * y + t[2] * z
                local[1, v] = bx * x + by * y + bz * z
                local[2, v] = n[0] * x + n[1] * y + n[2] * z
            for k in range(num_curves):
                angles_into(kinds[k], scale[k], local[0], local[1], local[2], ox, oy, oz, gamma[k])
        for entry in range(first[row], first[row + 1]):
            m = light[entry]
            for channel in range(3):
                weight[channel] = power[m, channel] * shading[entry] * constant[channel]
            for k in range(num_curves):
                for corner in range(3):
                    corner_gamma[k, corner] = gamma[k, faces[m, corner]]
            x, y, z = centroid[m, 0], centroid[m, 1], centroid[m, 2]
            if _is_linear(
                kinds, scale, corner_gamma,
                t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z, n[0] * x + n[1] * y + n[2] * z,
                ox, oy, oz,
            ):  # fmt: skip
                _leaf(kinds, active, bands, num_bands, corner_gamma, weight, out[row])
                continue
            for corner in range(3):
                for axis in range(3):
                    corners[corner, axis] = local[axis, faces[m, corner]]
            _divided(
                kinds, active, bands, num_bands, scale, corners, weight, ox, oy, oz, stack, depth, sub_gamma, part,
                out[row],
            )  # fmt: skip


class Projector:
    """Projects ranges of receivers under one contraction; holds the scratch memory of one thread."""

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: Receivers) -> None:
        self._term, self._contraction, self._lights, self._receivers = term, contraction, lights, receivers
        capacity = _POINTS_A_BLOCK * lights.num_lights
        self._first = np.empty(_POINTS_A_BLOCK + 1, np.int64)
        self._light = np.empty(capacity, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)

    def project(self, start: int, stop: int) -> F32:
        """Transport of points [start, stop) along the free curve, in its bands.

        Returns:
            (stop - start, 3, J) float32; J = 1 where no curve is free.
        """
        out = np.zeros((stop - start, 3, self._contraction.num_columns), np.float32)
        for block in range(start, stop, _POINTS_A_BLOCK):
            end = min(block + _POINTS_A_BLOCK, stop)
            self._block(block, end, out[block - start : end - start])
        return out

    def _block(self, start: int, stop: int, out: F32) -> None:
        r, lights, c = self._receivers, self._lights, self._contraction
        num = _local_directions(
            r.normal, r.tangent, r.wo, r.visible, lights.direction, start, stop, self._first, self._light, self._wi, self._wo
        )
        wi, wo = self._wi[:, :num], self._wo[:, :num]
        shading = self._term.quotient(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
        shading *= wi[2]
        _project(
            r.normal, r.tangent, self._first, self._light, shading, wo, lights.vertices, lights.faces, lights.centroid,
            lights.power, c.kinds, c.num_bands, c.bands, c.constant, c.active, start, stop, out,
        )  # fmt: skip
