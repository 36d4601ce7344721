"""The strata of a lamp's surface: where its samples lie, and what quadrilaterals stand for many of them at once.

The unit square is halved again and again, along u or along v, into N = 4^m cells. One sample lies in each, at a place
that each receiver shifts within the cell; together they are Hammersley's points, a net in base 2, so that whatever
rows, columns or squares as large as a cell there are, each has one. Samples are numbered by halvings: those of a part
of the surface that two halvings left follow each other, in fours, sixteens and so on. So a point that sees all of these
needs the part alone.

A lamp's pieces follow each other along u, by their share of its power. A part within one piece is that quadrilateral;
one that spans several has their middle and spread (first and second moments), if they lie flat and side by side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NOT_FLAT = 1e18  # metres
_TINY = 1e-300
_FLAT = 0.97  # length of the mean of normals: they lie within some 14° of it
_LOOSE = 1.25  # times its pieces' area: so large is what stands for them at most
_MORTON = 1024  # a side
_PROBES = (32, 4)  # along u and v, of a part whose moments are asked


class Strata(NamedTuple):
    """Samples of a lamp, before they are shifted.

    Attributes:
        corner: of each sample's cell. (N, 2) float32. size: of all cells. (2,) float32
        uv: where samples lie in their cells, in sizes of these. (N, 2) float32
        seed: of the shifts.
    """

    corner: F32
    size: F32
    uv: F32
    seed: int


class LampParts(NamedTuple):
    """LampParts of a lamp's surface: all of it, its four quarters, their sixteen, … down to cells of samples.

    Attributes:
        corners: of each part, in turn. (P, 4, 3) float32, metres. normal: unit. (P, 3) float32
        share: of the first of the two triangles 0 1 2 and 0 2 3 in the part's light. (P,) float32
        middle: of the part. (P, 3) radius: from there to the farthest corner, metres; `NOT_FLAT` where the part is not
            flat. (P,) float32
    """

    corners: F32
    normal: F32
    share: F32
    middle: F32
    radius: F32


def side_by_side(middles: F64) -> NDArray[np.intp]:
    """Order pieces along a Morton curve, so that those of a part lie together. middles: (T, 3)"""
    if len(middles) < 3:
        return np.arange(len(middles))
    extent = np.ptp(middles, axis=0).max()
    place = ((middles - middles.min(axis=0)) / max(extent, _TINY) * (_MORTON - 1)).astype(np.int64)
    code = np.zeros(len(middles), np.int64)
    for bit in range(_MORTON.bit_length() - 1):
        for axis in range(3):
            code |= (place[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def halvings(num_pieces: int, num_samples: int) -> tuple[int, ...]:
    """Choose which side each halving is along, 0 for u and 1 for v: more of them along u where pieces are many.

    Args:
        num_pieces: of the surface. num_samples: a power of four
    """
    count = num_samples.bit_length() - 1
    along_v = count - min(count, max(count // 2, max(0, num_pieces - 1).bit_length()))
    return (0,) * (count - 2 * along_v) + (0, 1) * along_v


def make_strata(along: tuple[int, ...], seed: int) -> Strata:
    """Place samples. along: from `halvings`. seed: of the shifts"""
    cell, (bits_u, bits_v) = _cells(along), (along.count(0), along.count(1))
    size = np.array([0.5**bits_u, 0.5**bits_v])
    # of Hammersley's points i/N and i's bits backwards, the one in the cell
    place = [_backwards(cell[:, 1], bits_v), _backwards(cell[:, 0], bits_u)]
    within = (np.stack(place, axis=1) + 0.5) * size[::-1]
    return Strata((cell * size).astype(np.float32), size.astype(np.float32), within.astype(np.float32), seed)


def _cells(along: tuple[int, ...]) -> NDArray[np.int64]:
    """Number the columns and rows of the cells that halvings make, in their order. (2^halvings, 2)"""
    number = np.arange(1 << len(along))
    cell = np.zeros((len(number), 2), np.int64)
    for k, axis in enumerate(along):
        cell[:, axis] = 2 * cell[:, axis] + (number >> (len(along) - 1 - k) & 1)
    return cell


def _backwards(number: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Reverse the order of bits."""
    found = np.zeros_like(number)
    for k in range(bits):
        found |= (number >> k & 1) << (bits - 1 - k)
    return found


def make_parts(along: tuple[int, ...], corner: F32, edges: F32, share: F32, *, is_rectangle: bool) -> LampParts:
    """Find the parts of a surface: level after level of quarters, each in the order of its samples.

    Args:
        along: from `halvings`.
        corner, edges, share, is_rectangle: of the surface's pieces, see `relume.light.local.LocalLight`.
    """
    pieces = _Pieces(corner.astype(np.float64), edges.astype(np.float64), share.astype(np.float64), is_rectangle)
    levels = [pieces.parts(along[:count]) for count in range(0, len(along) + 1, 2)]
    return LampParts(*(np.concatenate(of_part).astype(np.float32) for of_part in zip(*levels, strict=True)))


class _Pieces(NamedTuple):
    """A surface, from the unit square: triangles T, or one parallelogram. As in `LocalLight`, float64."""

    corner: F64
    edges: F64
    share: F64
    is_rectangle: bool

    def parts(self, along: tuple[int, ...]) -> tuple[F64, ...]:
        """Find the parts that some halvings leave, as `LampParts` has them."""
        size = np.array([0.5 ** along.count(0), 0.5 ** along.count(1)])
        low = _cells(along) * size
        middles = low + size / 2
        piece = self.piece_of(middles[:, 0])
        below = self.share[piece] - np.diff(self.share, prepend=0)[piece]
        slack = 1e-6  # shares are float32
        is_within = (low[:, 0] >= below - slack) & (low[:, 0] + size[0] <= self.share[piece] + slack)
        outline = low[:, None] + size * [[0, 0], [1, 0], [1, 1], [0, 1]]
        corners = self.place(outline, piece[:, None])
        normal = self.normals()[piece]
        if not is_within.all():
            spread, mean, area = self._spread(low, size)
            length = np.linalg.norm(mean, axis=1)
            is_flat = (length > _FLAT) & (sum(_halves(spread)) < _LOOSE * area)
            corners = np.where(is_within[:, None, None], corners, spread)
            normal = np.where(is_within[:, None], normal, mean / np.maximum(length, _TINY)[:, None])
        first, second = _halves(corners)
        middle = corners.mean(axis=1)
        radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        if not is_within.all():
            radius = np.where(is_within | is_flat, radius, NOT_FLAT)
        return corners, normal, first / np.maximum(first + second, _TINY), middle, radius

    def piece_of(self, u: F64) -> NDArray[np.int64]:
        """Find the piece that each u lies in."""
        return np.minimum(np.searchsorted(self.share, u, side="right"), len(self.share) - 1)

    def place(self, uv: F64, piece: NDArray[np.int64]) -> F64:
        """Find the place of uv (..., 2) on pieces, outside of which it is held at their ends. (..., 3)"""
        u, v = np.moveaxis(uv, -1, 0)
        piece = np.broadcast_to(piece, u.shape)
        if not self.is_rectangle:
            width = np.diff(self.share, prepend=0)[piece]
            root = np.sqrt(np.clip((u - self.share[piece] + width) / np.maximum(width, _TINY), 0, 1))
            u, v = root * (1 - v), root * v
        edges = self.edges[piece]
        return np.asarray(self.corner[piece] + u[..., None] * edges[..., 0, :] + v[..., None] * edges[..., 1, :])

    def normals(self) -> F64:
        """Unit normals of the pieces. (T, 3)"""
        across = np.cross(self.edges[:, 0], self.edges[:, 1])
        return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), _TINY))

    def _spread(self, low: F64, size: F64) -> tuple[F64, F64, F64]:
        """Find parallelograms (P, 4, 3) with the moments of parts; means of their normals (P, 3), their areas (P,)."""
        step = (np.stack(np.meshgrid(*map(np.arange, _PROBES)), axis=-1).reshape(-1, 2) + 0.5) / _PROBES
        uv = low[:, None] + size * step
        piece = self.piece_of(uv[..., 0])
        place, mean = self.place(uv, piece), self.normals()[piece].mean(axis=1)
        areas = np.linalg.norm(np.cross(self.edges[:, 0], self.edges[:, 1]), axis=1) / 2
        area = size.prod() * (areas / np.maximum(np.diff(self.share, prepend=0), _TINY))[piece].mean(axis=1)
        middle = place.mean(axis=1)
        away = place - middle[:, None]
        values, vectors = np.linalg.eigh(np.einsum("pki,pkj->pij", away, away) / len(step))
        half = np.sqrt(3 * np.maximum(values[:, None, 1:], 0)) * vectors[:, :, 1:]  # a square's variance is half² / 3
        e, f = half[:, :, 1], half[:, :, 0]
        return np.stack([middle - e - f, middle + e - f, middle + e + f, middle - e + f], axis=1), mean, area


def _halves(corners: F64) -> tuple[F64, F64]:
    """Areas of the triangles 0 1 2 and 0 2 3 of quadrilaterals (P, 4, 3). (P,) each"""
    a, b, c, d = corners.transpose(1, 0, 2)
    first, second = (np.linalg.norm(np.cross(p - a, q - a), axis=1) / 2 for p, q in ((b, c), (c, d)))
    return np.asarray(first), np.asarray(second)
