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
from relume.moving.look_up import need_points
from relume.moving.points.surface import Surface
from relume.moving.points.vertices import Vertices
from relume.moving.relief.numbers import EMPTY, FUNCTIONS, HALF, OF_ORDER, PAIRS, WIDTH
from relume.moving.relief.place import cross, dot, face_places, row
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_LEAST = np.float32(1e-12)
_NOTHING = np.empty((0, 3), np.float32)


class VertexLight(NamedTuple):
    """What arrives about vertices.

    Attributes:
        tangent: that azimuths are counted from, about as unit. (vertices, 3) float32
        vectors: the first functions of the in-basis, in lanes: the cosine parts of the three channels, then their sine
            parts. (vertices, 3 F) float32
    """

    tangent: F32
    vectors: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def turned_by(x, y):  # type: ignore[no-untyped-def]
    """Find cos δ and sin δ, of δ as a vector of any length; (0, 0) turns nothing."""
    square = x * x + y * y
    if square > _LEAST:
        scale = np.float32(1) / math.sqrt(square)
        return np.float32(x * scale), np.float32(y * scale)
    return np.float32(1), np.float32(0)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _turn_by(x, y):  # type: ignore[no-untyped-def]
    """Find cos mδ and sin mδ for m of 1 to 4, of δ as `turned_by` has it."""
    c1, s1 = turned_by(x, y)
    c2, s2 = c1 * c1 - s1 * s1, np.float32(2) * c1 * s1
    return c1, s1, c2, s2, c2 * c1 - s2 * s1, s2 * c1 + c2 * s1, c2 * c2 - s2 * s2, np.float32(2) * c2 * s2


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def add_turned(lanes, turn, side, weight, is_added, out):  # type: ignore[no-untyped-def]
    """Add a light vector, turned.

    Args:
        lanes: of it. (3 F,) float32. turn: from `_turn_by`. side: −1 where azimuths run the other way round, else 1.
        weight: that it counts with. is_added: to what is in `out`, which is written. (3 F,) float32
    """
    c1, s1, c2, s2, c3, s3, c4, s4 = turn
    for i in range(PAIRS):
        # sums over orders, of which each lane has one: what is looked up in arrays that were just written stalls
        is0, is1, is2, is3, is4 = OF_ORDER[0, i], OF_ORDER[1, i], OF_ORDER[2, i], OF_ORDER[3, i], OF_ORDER[4, i]
        cosine = weight * (is0 + c1 * is1 + c2 * is2 + c3 * is3 + c4 * is4)
        sine = weight * (s1 * is1 + s2 * is2 + s3 * is3 + s4 * is4)
        mirror = is0 + side * (np.float32(1) - is0)  # what no order turns is not mirrored either
        a, b = lanes[i], mirror * lanes[PAIRS + i]
        before, other = (out[i], out[PAIRS + i]) if is_added else (np.float32(0), np.float32(0))
        out[i] = before + cosine * a - sine * b
        out[PAIRS + i] = other + sine * a + cosine * b


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _lay(vectors, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Lay the light vectors of the points that are [start, stop) of rows into lanes. out: (points, 3 F)"""
    for p in rows[start:stop]:
        for channel in range(3):
            for i in range(WIDTH):
                if i != EMPTY:  # what that lane had at first, nothing, stays
                    place = i if i < HALF else PAIRS - HALF + i
                    out[p, channel * HALF + place] = vectors[p, channel, FUNCTIONS[i]]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(vertices, tangents, lanes, rows, start, stop, tangent, out):  # type: ignore[no-untyped-def]
    """Find what arrives about the vertices that are [start, stop) of rows."""
    normal, points, weights = vertices
    of_one, sums = np.empty(3 * WIDTH, np.float32), np.empty(3 * WIDTH, np.float32)
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
                of_point = row(tangents, point)
                turn = _turn_by(dot(of_point, t), dot(of_point, b))
                for i in range(3 * WIDTH):  # a row by itself would be counted as a reference
                    of_one[i] = lanes[point, i]
                add_turned(of_one, turn, np.float32(1), weight, True, sums)
        for i in range(3 * WIDTH):
            out[v, i] = sums[i]


class ReliefLight:
    """What arrives about the vertices that a moving picture has seen in a light, and where textures lie.

    Used from one thread at a time.
    """

    def __init__(self) -> None:
        self._vectors: F32 | None = None
        self._places: F32 | None = None
        self._lanes, self._found, self._is_found = _NOTHING, VertexLight(_NOTHING, _NOTHING), np.empty(0, np.uint8)

    def places(self, surface: Surface, positions: F32) -> F32:
        """Find where the surface's triangles lie in textures, once: it stays as it is.

        Args:
            surface, positions: as in `face_places`, which is what is returned.
        """
        if self._places is None:
            self._places = face_places(positions, surface)
        return self._places

    def about(self, surface: Surface, vectors: F32, is_asked: U8) -> VertexLight:
        """Find what arrives about vertices, which is kept as long as the light is.

        Args:
            surface: with them and their points. vectors: of the points, never written to. (points, 3, K) float32
            is_asked: vertices that are asked about; the others have anything. (vertices,) uint8
        """
        if vectors is not self._vectors:
            if len(self._is_found) != len(is_asked):
                num = len(is_asked)
                self._lanes = np.zeros((len(vectors), 3 * WIDTH), np.float32)
                self._found = VertexLight(np.zeros((num, 3), np.float32), np.zeros((num, 3 * WIDTH), np.float32))
            self._vectors, self._is_found = vectors, np.zeros_like(is_asked)
        rows = np.flatnonzero(is_asked & ~self._is_found)
        if len(rows):
            is_needed = np.zeros(len(vectors), np.uint8)
            need_points(surface.vertices, is_asked, is_needed)
            points = np.flatnonzero(is_needed)
            for_shares(lambda start, stop: _lay(vectors, points, start, stop, self._lanes), len(points))
            args = (surface.vertices, surface.points.tangent, self._lanes, rows)
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
