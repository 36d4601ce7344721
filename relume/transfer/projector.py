"""The projector: bins the light that reaches a point along one curve, every other curve multiplied in.

    T_j(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_{f ≠ active} mean_m(f) · Δ_{m,j}

Eqs. 21, 22 and 25 with 26 carried out at once, Ben-Artzi 2006: U is never stored. Triangles over which an angle is not
linear (near its pole) are divided into four until it is (appendix A).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.brdf.angles import angle_at, angles_into
from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.transfer.overlap import area_below, overlap_of

F32 = NDArray[np.float32]

_QUARTER = np.float32(0.25)
# An angle counts as linear over a triangle when it is this close to linear at the midpoints of the edges, in bands; away
# from the pole, where curves are wider, a share of the angle more.
_TOLERANCE_BANDS = np.float32(0.1)
_TOLERANCE_SHARE = np.float32(0.01)
_QUARTERED_BEND = np.float32(4)  # division in four quarters the bend, so that up to here one division is enough
_MAX_DEPTH = 4
_HALF = np.float32(0.5)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_OWN_NODES = np.arange(6).reshape(1, 6)
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
        bands: padded with the last band. (C, max J, 3) float32
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
        np.ascontiguousarray(np.array(padded, np.float32).reshape(len(rows), 3, widest).transpose(0, 2, 1)),
        constant.astype(np.float32),
        free,
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def bend_of(a, b, c, ab, bc, ca):  # type: ignore[no-untyped-def]
    """How far an angle at the edges' midpoints is from linear between the corners, in units of what is tolerated."""
    bend = max(abs(ab - _HALF * (a + b)), max(abs(bc - _HALF * (b + c)), abs(ca - _HALF * (c + a))))
    return bend / (_TOLERANCE_BANDS + _TOLERANCE_SHARE * min(a, min(b, c)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _quarter(gamma, nodes, m, share, leaves, shares, num):  # type: ignore[no-untyped-def]
    """Append the four triangles that the midpoints of triangle m's edges make; returns the new number of leaves."""
    for child in range(4):
        for k in range(gamma.shape[0]):
            for corner in range(3):
                leaves[num, k, corner] = gamma[k, nodes[m, _CHILDREN[child, corner]]]
        shares[num] = _QUARTER * share
        num += 1
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _bend(gamma, nodes, m):  # type: ignore[no-untyped-def]
    """How far the angles at the edges' midpoints are from linear, in units of what is tolerated; the largest."""
    largest = np.float32(0)
    for k in range(gamma.shape[0]):
        a, b, c = gamma[k, nodes[m, 0]], gamma[k, nodes[m, 1]], gamma[k, nodes[m, 2]]
        ab, bc, ca = gamma[k, nodes[m, 3]], gamma[k, nodes[m, 4]], gamma[k, nodes[m, 5]]
        largest = max(largest, bend_of(a, b, c, ab, bc, ca))
    return largest


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _divide(kinds, scale, corners, ox, oy, oz, stack, depth, dirs, gamma, leaves, shares):  # type: ignore[no-untyped-def]
    """Divide a triangle (corners (3, 3) local) in four until its angles are linear, depth first (appendix A).

    Chord areas share out the light. Writes the corner angles of the leaves (n, C, 3) and their shares (n,); returns n.
    """
    stack[0] = corners
    depth[0] = 0
    top, num = 1, 0
    while top > 0:
        top -= 1
        level = depth[top]
        dirs[:3] = stack[top]
        for edge in range(3):
            following = (edge + 1) % 3
            x = dirs[edge, 0] + dirs[following, 0]
            y = dirs[edge, 1] + dirs[following, 1]
            z = dirs[edge, 2] + dirs[following, 2]
            inverse = np.float32(1) / math.sqrt(x * x + y * y + z * z)
            dirs[3 + edge, 0], dirs[3 + edge, 1], dirs[3 + edge, 2] = x * inverse, y * inverse, z * inverse
        for k in range(kinds.shape[0]):
            for node in range(6):
                gamma[k, node] = scale[k] * angle_at(kinds[k], dirs[node, 0], dirs[node, 1], dirs[node, 2], ox, oy, oz)
        bend = _bend(gamma, _OWN_NODES, 0)
        share = _QUARTER**level
        if bend <= 1:
            leaves[num] = gamma[:, :3]
            shares[num] = share
            num += 1
        elif bend <= _QUARTERED_BEND or level == _MAX_DEPTH - 1:
            num = _quarter(gamma, _OWN_NODES, 0, share, leaves, shares, num)
        else:
            for child in range(4):
                for corner in range(3):
                    for axis in range(3):
                        stack[top + child, corner, axis] = dirs[_CHILDREN[child, corner], axis]
                depth[top + child] = level + 1
            top += 4
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _node_angles(n, t, directions, kinds, scale, ox, oy, oz, local, gamma):  # type: ignore[no-untyped-def]
    """Turn all nodes (3, N) into the frame of normal n and tangent t, and take their angles. Writes local, gamma."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    for v in range(directions.shape[1]):
        x, y, z = directions[0, v], directions[1, v], directions[2, v]
        local[0, v] = t[0] * x + t[1] * y + t[2] * z
        local[1, v] = bx * x + by * y + bz * z
        local[2, v] = n[0] * x + n[1] * y + n[2] * z
    for k in range(kinds.shape[0]):
        angles_into(kinds[k], scale[k], local[0], local[1], local[2], ox, oy, oz, gamma[k])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _project(
    normal, tangent, first, light, shading, local_wo, node_directions, nodes, power, kinds, num_bands, bands,
    active, start, stop, out,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Project points [start, stop); `first`, `light`, `shading` (q · cos θi) and `local_wo` list their visible lights.

    One body, and helpers that take numbers only: arrays handed to a helper in the inner loop would be counted as
    references there, which costs more than the arithmetic.
    """
    num_curves, num_nodes = kinds.shape[0], node_directions.shape[1]
    scale = np.empty(num_curves, np.float32)
    for k in range(num_curves):
        scale[k] = num_bands[k] / (np.pi / 2)
    local = np.empty((3, num_nodes), np.float32)
    gamma = np.empty((num_curves, num_nodes), np.float32)
    leaves = np.empty((4**_MAX_DEPTH, num_curves, 3), np.float32)
    shares = np.empty(4**_MAX_DEPTH, np.float32)
    corners, dirs = np.empty((3, 3), np.float32), np.empty((6, 3), np.float32)
    stack, depth = np.empty((3 * _MAX_DEPTH + 4, 3, 3), np.float32), np.empty(3 * _MAX_DEPTH + 4, np.int64)
    node_gamma = np.empty((num_curves, 6), np.float32)
    one = np.float32(1)
    for p in range(start, stop):
        row = p - start
        begin, end = first[row], first[row + 1]
        if begin == end:
            continue
        ox, oy, oz = local_wo[0, begin], local_wo[1, begin], local_wo[2, begin]
        if num_curves > 0:
            _node_angles(normal[p], tangent[p], node_directions, kinds, scale, ox, oy, oz, local, gamma)
        for entry in range(begin, end):
            m = light[entry]
            # Divide the triangle into leaves over which all angles are linear
            bend = np.float32(0)
            for k in range(num_curves):
                a, b, c = gamma[k, nodes[m, 0]], gamma[k, nodes[m, 1]], gamma[k, nodes[m, 2]]
                ab, bc, ca = gamma[k, nodes[m, 3]], gamma[k, nodes[m, 4]], gamma[k, nodes[m, 5]]
                bend = max(bend, bend_of(a, b, c, ab, bc, ca))
                leaves[0, k, 0], leaves[0, k, 1], leaves[0, k, 2] = a, b, c
            num_leaves = 1
            shares[0] = one
            if bend > _QUARTERED_BEND:
                for corner in range(3):
                    for axis in range(3):
                        corners[corner, axis] = local[axis, nodes[m, corner]]
                num_leaves = _divide(
                    kinds, scale, corners, ox, oy, oz, stack, depth, dirs, node_gamma, leaves, shares
                )  # fmt: skip
            elif bend > 1:
                num_leaves = _quarter(gamma, nodes, m, one, leaves, shares, 0)
            for leaf in range(num_leaves):
                weight = shading[entry] * shares[leaf]
                red, green, blue = power[m, 0] * weight, power[m, 1] * weight, power[m, 2] * weight
                # Multiply by the mean of each dormant curve over the leaf
                for k in range(num_curves):
                    if k == active:
                        continue
                    low, middle, high, rise, fall, rest = overlap_of(leaves[leaf, k, 0], leaves[leaf, k, 1], leaves[leaf, k, 2])
                    last = np.uint64(num_bands[k] - 1)
                    first_band, last_band = min(np.uint64(low), last), min(np.uint64(high), last)
                    below = r = g = b = np.float32(0)
                    for j in range(first_band, last_band):
                        upto = area_below(np.float32(j + np.uint64(1)), low, middle, high, rise, fall, rest)
                        r += (upto - below) * bands[k, j, 0]
                        g += (upto - below) * bands[k, j, 1]
                        b += (upto - below) * bands[k, j, 2]
                        below = upto
                    red *= r + (one - below) * bands[k, last_band, 0]
                    green *= g + (one - below) * bands[k, last_band, 1]
                    blue *= b + (one - below) * bands[k, last_band, 2]
                if active < 0:
                    out[row, 0, 0] += red
                    out[row, 0, 1] += green
                    out[row, 0, 2] += blue
                    continue
                # Share the leaf out to the bands of the free curve (eq. 22)
                low, middle, high, rise, fall, rest = overlap_of(
                    leaves[leaf, active, 0], leaves[leaf, active, 1], leaves[leaf, active, 2]
                )
                last = np.uint64(num_bands[active] - 1)
                first_band, last_band = min(np.uint64(low), last), min(np.uint64(high), last)
                below = np.float32(0)
                for j in range(first_band, last_band):
                    upto = area_below(np.float32(j + np.uint64(1)), low, middle, high, rise, fall, rest)
                    out[row, j, 0] += (upto - below) * red
                    out[row, j, 1] += (upto - below) * green
                    out[row, j, 2] += (upto - below) * blue
                    below = upto
                out[row, last_band, 0] += (one - below) * red
                out[row, last_band, 1] += (one - below) * green
                out[row, last_band, 2] += (one - below) * blue


class Projector:
    """Projects ranges of receivers under one contraction; holds the scratch memory of one thread."""

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: Receivers) -> None:
        self._term, self._contraction, self._lights, self._receivers = term, contraction, lights, receivers
        self._power = lights.power * contraction.constant
        capacity = _POINTS_A_BLOCK * lights.num_lights
        self._first = np.empty(_POINTS_A_BLOCK + 1, np.int64)
        self._light = np.empty(capacity, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)

    def project(self, start: int, stop: int) -> F32:
        """Transport of points [start, stop) along the free curve, in its bands.

        Returns:
            (stop - start, J, 3) float32; J = 1 where no curve is free.
        """
        out = np.zeros((stop - start, self._contraction.num_columns, 3), np.float32)
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
            r.normal, r.tangent, self._first, self._light, shading, wo, lights.node_directions, lights.nodes, self._power,
            c.kinds, c.num_bands, c.bands, c.active, start, stop, out,
        )  # fmt: skip
