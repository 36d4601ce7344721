"""Light vectors where texels are: of points, turned into one frame about each vertex, then into the texture's.

Light that is φ further round in one frame is φ + δ in another about the same normal:

    t_m^cos ← cos mδ t_m^cos − sin mδ t_m^sin,   t_m^sin ← sin mδ t_m^cos + cos mδ t_m^sin
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import ladder
from relume.moving.points.surface import Surface
from relume.moving.points.vertices import Vertices
from relume.moving.relief.numbers import EMPTY, FUNCTIONS, HALF, WIDTH
from relume.moving.relief.place import cross, dot, row
from relume.parallel import for_shares

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_LEAST = np.float32(1e-12)
_NOTHING = np.empty((0, 3), np.float32)


class VertexLight(NamedTuple):
    """What arrives about vertices.

    Attributes:
        tangent: that azimuths are counted from, about as unit. (vertices, 3) float32
        vectors: the first functions of the in-basis, in lanes, channels outermost. (vertices, 3 F) float32
    """

    tangent: F32
    vectors: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def turns(x, y, side, weight, turn):  # type: ignore[no-untyped-def]
    """Find what turns light vectors.

    Args:
        x, y: δ as a vector of any length; (0, 0) turns nothing.
        side: −1 where azimuths run the other way round, else 1. weight: that light counts with.
        turn: written: what the lanes of cosines and of sines give to those of cosines, then to those of sines.
            (4, F / 2) float32
    """
    square = x * x + y * y
    c1, s1 = np.float32(1), np.float32(0)
    if square > _LEAST:
        scale = np.float32(1) / math.sqrt(square)
        c1, s1 = np.float32(x * scale), np.float32(y * scale)
    c2, s2 = c1 * c1 - s1 * s1, np.float32(2) * c1 * s1
    c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
    c4, s4 = c2 * c2 - s2 * s2, np.float32(2) * c2 * s2
    # as `ORDERS` has them
    turn[0, 0], turn[0, 1], turn[0, 2], turn[0, 3] = c1, c2, np.float32(1), np.float32(1)
    turn[0, 4], turn[0, 5], turn[0, 6], turn[0, 7] = c1, c3, c2, c4
    turn[2, 0], turn[2, 1], turn[2, 2], turn[2, 3] = s1, s2, np.float32(0), np.float32(0)
    turn[2, 4], turn[2, 5], turn[2, 6], turn[2, 7] = s1, s3, s2, s4
    for i in range(HALF):
        turn[0, i] *= weight
        turn[2, i] *= weight
        turn[1, i], turn[3, i] = -side * turn[2, i], side * turn[0, i]
    turn[3, 2] = turn[3, 3] = weight  # what no order turns is not mirrored either


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def add_turned(lanes, turn, out):  # type: ignore[no-untyped-def]
    """Add a light vector, turned.

    Args:
        lanes: of it. (3 F,) float32. turn: from `turns`. out: added to. (3 F,) float32
    """
    for channel in range(3):
        low = channel * WIDTH
        for i in range(HALF):
            along, across = lanes[low + i], lanes[low + HALF + i]
            out[low + i] += turn[0, i] * along + turn[1, i] * across
            out[low + HALF + i] += turn[2, i] * along + turn[3, i] * across


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(vertices, tangents, vectors, rows, start, stop, tangent, out):  # type: ignore[no-untyped-def]
    """Find what arrives about the vertices that are [start, stop) of rows."""
    normal, points, weights = vertices
    turn, lanes = np.empty((4, HALF), np.float32), np.zeros(3 * WIDTH, np.float32)
    sums = np.empty(3 * WIDTH, np.float32)
    for v in rows[start:stop]:
        heaviest = 0
        for k in range(1, weights.shape[1]):
            if weights[v, k] > weights[v, heaviest]:
                heaviest = k
        n, t = row(normal, v), row(tangents, points[v, heaviest])
        b = cross(n, t)
        tangent[v, 0], tangent[v, 1], tangent[v, 2] = t
        for i in range(3 * WIDTH):
            sums[i] = 0
        for k in range(weights.shape[1]):
            weight, point = weights[v, k], points[v, k]
            if weight > 0:
                for channel in range(3):
                    for i in range(WIDTH):
                        if i != EMPTY:  # what that lane had at first, nothing, stays
                            lanes[channel * WIDTH + i] = vectors[point, channel, FUNCTIONS[i]]
                of_point = row(tangents, point)
                turns(dot(of_point, t), dot(of_point, b), np.float32(1), weight, turn)
                add_turned(lanes, turn, sums)
        for i in range(3 * WIDTH):
            out[v, i] = sums[i]


class ReliefLight:
    """What arrives about the vertices that a moving picture has seen in a light; used from one thread at a time."""

    def __init__(self) -> None:
        self._vectors: F32 | None = None
        self._found, self._is_found = VertexLight(_NOTHING, _NOTHING), np.empty(0, np.uint8)

    def about(self, surface: Surface, vectors: F32, is_asked: U8) -> VertexLight:
        """Find what arrives about vertices, which is kept as long as the light is.

        Args:
            surface: with them and their points. vectors: of the points, never written to. (points, 3, K) float32
            is_asked: vertices that are asked about; the others have anything. (vertices,) uint8
        """
        if vectors is not self._vectors:
            if len(self._is_found) != len(is_asked):
                num = len(is_asked)
                self._found = VertexLight(np.zeros((num, 3), np.float32), np.zeros((num, 3 * WIDTH), np.float32))
            self._vectors, self._is_found = vectors, np.zeros_like(is_asked)
        rows = np.flatnonzero(is_asked & ~self._is_found)
        if len(rows):
            args = (surface.vertices, surface.points.tangent, vectors, rows)
            for_shares(lambda start, stop: _spread(*args, start, stop, *self._found), len(rows))
            self._is_found[rows] = 1
        return self._found


def light_about_numpy(vertices: Vertices, tangents: F32, vectors: F32, vertex: int) -> tuple[NDArray[np.float64], F32]:
    """Do as `ReliefLight.about` for one vertex, in plain NumPy: its oracle.

    Args:
        vertices: all. tangents, vectors: of points, (points, 3), (points, 3, K). vertex: number of it.
    Returns:
        Its light vector by functions, (3, K), its tangent (3,).
    """
    rungs, weights, points = ladder(), vertices.weight[vertex], vertices.point[vertex]
    n, t = vertices.normal[vertex], tangents[points[weights.argmax()]]
    out = np.zeros(vectors.shape[1:])
    for weight, point in zip(weights, points, strict=True):
        turn = np.arctan2(tangents[point] @ np.cross(n, t), tangents[point] @ t)
        for m, cosine, sine in zip(rungs.order, rungs.cosine, rungs.sine, strict=True):
            phase = vectors[point, :, cosine] + 1j * (vectors[point, :, sine] if m else 0)
            phase = weight * phase * np.exp(1j * m * turn)
            out[:, sine] += phase.imag
            out[:, cosine] += phase.real
    return out, t
