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
from relume.moving.relief.place import cross, dot, row
from relume.moving.relief.tables import DEGREE, WIDTH
from relume.parallel import for_shares

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_LEAST = np.float32(1e-6)


class VertexLight(NamedTuple):
    """What arrives about vertices.

    Attributes:
        tangent: that azimuths are counted from, about as unit. (vertices, 3) float32
        vectors: the first functions of the in-basis. (vertices, 3, F) float32
    """

    tangent: F32
    vectors: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def add_turned(rungs, vectors, which, x, y, sign, weight, out):  # type: ignore[no-untyped-def]
    """Add a light vector, turned.

    Args:
        rungs: the `ladder`. vectors: of which one is added. (n, 3, ≥ F) float32. which: number of it.
        x, y: δ as a vector of any length. sign: −1 where azimuths run the other way round, else 1.
        weight: that it counts with. out: added to. (3, F) float32
    """
    length = math.sqrt(x * x + y * y)
    c, s = np.float32(1), np.float32(0)
    if length > _LEAST:
        c, s = np.float32(x / length), np.float32(y / length)
    re, im = np.float32(weight), np.float32(0)
    for rung in range(rungs.order.shape[0]):
        m, cosine, sine = rungs.order[rung], rungs.cosine[rung], rungs.sine[rung]
        if rungs.a[rung] == 0 and m > 0:
            re, im = re * c - im * s, re * s + im * c
        for channel in range(3):
            along = vectors[which, channel, cosine]
            if m == 0:
                out[channel, cosine] += re * along
            else:
                across = sign * vectors[which, channel, sine]
                out[channel, cosine] += re * along - im * across
                out[channel, sine] += im * along + re * across


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(rungs, vertices, tangents, vectors, is_asked, start, stop, tangent, out):  # type: ignore[no-untyped-def]
    """Find what arrives about vertices [start, stop)."""
    for v in range(start, stop):
        if not is_asked[v]:
            continue
        heaviest = 0
        for k in range(1, vertices.weight.shape[1]):
            if vertices.weight[v, k] > vertices.weight[v, heaviest]:
                heaviest = k
        n, t = row(vertices.normal, v), row(tangents, vertices.point[v, heaviest])
        b = cross(n, t)
        tangent[v, 0], tangent[v, 1], tangent[v, 2] = t
        for k in range(vertices.weight.shape[1]):
            weight, point = vertices.weight[v, k], vertices.point[v, k]
            if weight > 0:
                of_point = row(tangents, point)
                x, y = dot(of_point, t), dot(of_point, b)
                add_turned(rungs, vectors, point, x, y, np.float32(1), weight, out[v])


def light_about(surface: Surface, vectors: F32, is_asked: U8) -> VertexLight:
    """Find what arrives about vertices.

    Args:
        surface: with them and their points. vectors: of the points. (points, 3, K) float32
        is_asked: vertices that are asked about; the others get nothing. (vertices,) uint8
    """
    num, vertices = len(is_asked), surface.vertices
    found = VertexLight(np.zeros((num, 3), np.float32), np.zeros((num, 3, WIDTH), np.float32))
    args = (ladder(DEGREE), vertices, surface.points.tangent, vectors, is_asked)
    for_shares(lambda start, stop: _spread(*args, start, stop, *found), num)
    return found


def light_about_numpy(vertices: Vertices, tangents: F32, vectors: F32, vertex: int) -> tuple[NDArray[np.float64], F32]:
    """Do as `light_about` for one vertex, in plain NumPy: its oracle.

    Args:
        vertices: all. tangents, vectors: of points, (points, 3), (points, 3, K). vertex: number of it.
    Returns:
        Its light vector (3, F), its tangent (3,).
    """
    rungs, weights, points = ladder(DEGREE), vertices.weight[vertex], vertices.point[vertex]
    n, t = vertices.normal[vertex], tangents[points[weights.argmax()]]
    out = np.zeros((3, WIDTH))
    for weight, point in zip(weights, points, strict=True):
        turn = np.arctan2(tangents[point] @ np.cross(n, t), tangents[point] @ t)
        for m, cosine, sine in zip(rungs.order, rungs.cosine, rungs.sine, strict=True):
            phase = vectors[point, :, cosine] + 1j * (vectors[point, :, sine] if m else 0)
            phase = weight * phase * np.exp(1j * m * turn)
            out[:, sine] += phase.imag
            out[:, cosine] += phase.real
    return out, t
