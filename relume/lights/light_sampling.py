"""Stratified samples of an area light's surface, and quadrilaterals that represent many of these at once.

The unit square is halved repeatedly, along u or v, into N = 4^m cells. Each cell contains one sample, shifted in it per
receiver; together they are a Hammersley set, a (0, m, 2)-net in base 2: every elementary interval of a cell's
area contains one sample. Samples are numbered by the halvings: those of a part after some halvings are contiguous, in
groups of 4, 16 and so on. If a point sees all samples of a part, it needs only the part.

The pieces of a light are lined up along u, by their fractions of its power. A part within one piece is a quadrilateral
of it; a part of several pieces is represented by a parallelogram with their center and spread (first and second
moments), if they are flat and adjacent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NOT_FLAT_RADIUS = 1e18  # meters
_TINY = 1e-300
_MIN_MEAN_NORMAL_LENGTH = 0.97  # of the mean normal: normals are within some 14° of it
_MAX_AREA_RATIO = 1.25  # maximum area of a parallelogram over that of its pieces
_MORTON_SIDE = 1024  # cells per axis
_MOMENT_GRID = (32, 4)  # samples along u and v for the moments of a part


class LightStrata(NamedTuple):
    """Samples of an area light, before they are shifted.

    Attributes:
        corner: corner of each sample's cell. size: size of all cells.
        uv: samples within their cells, in units of the size. seed: seed of the shifts.
    """

    corner: Shaped[F32, "N 2"]
    size: Shaped[F32, " 2"]
    uv: Shaped[F32, "N 2"]
    seed: int


class EmitterParts(NamedTuple):
    """Hierarchy of parts of an area light's surface: all of it, its 4 quarters, 16, … down to cells of samples.

    Attributes:
        corners: corners of each part, meters. normal: unit.
        first_fraction: fraction of the part's light in the first of its triangles 0 1 2 and 0 2 3.
        center: center of the part.
        radius: from there to the farthest corner, meters; `NOT_FLAT_RADIUS` if it is not flat.
    """

    corners: Shaped[F32, "P 4 3"]
    normal: Shaped[F32, "P 3"]
    first_fraction: Shaped[F32, " P"]
    center: Shaped[F32, "P 3"]
    radius: Shaped[F32, " P"]


def morton_order(centers: Shaped[F64, "T 3"]) -> Shaped[NDArray[np.intp], " T"]:
    """Order pieces along a Morton curve, so that the pieces of a part are close to each other."""
    if len(centers) < 3:
        return np.arange(len(centers))
    extent = np.ptp(centers, axis=0).max()
    grid_position = ((centers - centers.min(axis=0)) / max(extent, _TINY) * (_MORTON_SIDE - 1)).astype(np.int64)
    code = np.zeros(len(centers), np.int64)
    for bit in range(_MORTON_SIDE.bit_length() - 1):
        for axis in range(3):
            code |= (grid_position[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def split_axes(num_pieces: int, num_samples: int) -> tuple[int, ...]:
    """Choose the axis of each halving, 0 for u and 1 for v: more of them along u for many pieces.

    Args:
        num_pieces: number of pieces of the surface. num_samples: a power of four
    """
    num_splits = num_samples.bit_length() - 1
    num_v_splits = num_splits - min(num_splits, max(num_splits // 2, max(0, num_pieces - 1).bit_length()))
    return (0,) * (num_splits - 2 * num_v_splits) + (0, 1) * num_v_splits


def make_strata(split_axis: tuple[int, ...], seed: int) -> LightStrata:
    """Create samples. split_axis: from `split_axes`. seed: seed of the shifts"""
    cell, (bits_u, bits_v) = _list_cells(split_axis), (split_axis.count(0), split_axis.count(1))
    size = np.array([0.5**bits_u, 0.5**bits_v])
    # of the Hammersley points (i/N, radical inverse of i), the one in the cell
    bit_reversed = [_reverse_bits(cell[:, 1], bits_v), _reverse_bits(cell[:, 0], bits_u)]
    offsets = (np.stack(bit_reversed, axis=1) + 0.5) * size[::-1]
    return LightStrata((cell * size).astype(np.float32), size.astype(np.float32), offsets.astype(np.float32), seed)


def _list_cells(split_axis: tuple[int, ...]) -> NDArray[np.int64]:
    """Return columns and rows of the cells after all halvings, in their order. (2^halvings, 2)"""
    number = np.arange(1 << len(split_axis))
    cell = np.zeros((len(number), 2), np.int64)
    for k, axis in enumerate(split_axis):
        cell[:, axis] = 2 * cell[:, axis] + (number >> (len(split_axis) - 1 - k) & 1)
    return cell


def _reverse_bits(number: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Reverse the order of bits."""
    reversed_bits = np.zeros_like(number)
    for k in range(bits):
        reversed_bits |= (number >> k & 1) << (bits - 1 - k)
    return reversed_bits


def subdivide_emitter(
    split_axis: tuple[int, ...],
    corner: Shaped[F32, "T 3"],
    edges: Shaped[F32, "T 2 3"],
    power_cdf: Shaped[F32, " T"],
    *,
    is_rectangle: bool,
) -> EmitterParts:
    """Compute the parts of a surface: level by level of quarters, each in the order of its samples.

    Args:
        split_axis: from `split_axes`.
        corner, edges, power_cdf, is_rectangle: fields of the surface's pieces, see
            `relume.lights.local_lights.LocalLight`.
    """
    pieces = _Pieces(corner.astype(np.float64), edges.astype(np.float64), power_cdf.astype(np.float64), is_rectangle)
    quarters = [pieces.subdivide(split_axis[:count]) for count in range(0, len(split_axis) + 1, 2)]
    return EmitterParts(*(np.concatenate(columns).astype(np.float32) for columns in zip(*quarters, strict=True)))


class _Pieces(NamedTuple):
    """A surface parameterized by the unit square: T triangles, or one parallelogram. As in `LocalLight`, float64."""

    corner: F64
    edges: F64
    power_cdf: F64
    is_rectangle: bool

    def subdivide(self, split_axis: tuple[int, ...]) -> tuple[F64, ...]:
        """Return the parts after some halvings, as in `EmitterParts`."""
        size = np.array([0.5 ** split_axis.count(0), 0.5 ** split_axis.count(1)])
        low = _list_cells(split_axis) * size
        centers = low + size / 2
        piece = self.find_piece(centers[:, 0])
        piece_start = self.power_cdf[piece] - np.diff(self.power_cdf, prepend=0)[piece]
        tolerance = 1e-6  # power_cdf is float32
        is_within = (low[:, 0] >= piece_start - tolerance) & (low[:, 0] + size[0] <= self.power_cdf[piece] + tolerance)
        outline = low[:, None] + size * [[0, 0], [1, 0], [1, 1], [0, 1]]
        corners = self.evaluate_position(outline, piece[:, None])
        normal = self.normals()[piece]
        if not is_within.all():
            parallelograms, mean, area = self._fit_parallelograms(low, size)
            length = np.linalg.norm(mean, axis=1)
            is_flat = (length > _MIN_MEAN_NORMAL_LENGTH) & (sum(_halves(parallelograms)) < _MAX_AREA_RATIO * area)
            corners = np.where(is_within[:, None, None], corners, parallelograms)
            normal = np.where(is_within[:, None], normal, mean / np.maximum(length, _TINY)[:, None])
        first, second = _halves(corners)
        center = corners.mean(axis=1)
        radius = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1)
        if not is_within.all():
            radius = np.where(is_within | is_flat, radius, NOT_FLAT_RADIUS)
        return corners, normal, first / np.maximum(first + second, _TINY), center, radius

    def find_piece(self, u: F64) -> NDArray[np.int64]:
        """Return the piece of each u."""
        return np.minimum(np.searchsorted(self.power_cdf, u, side="right"), len(self.power_cdf) - 1)

    def evaluate_position(self, uv: F64, piece: NDArray[np.int64]) -> F64:
        """Return positions of uv (..., 2) on pieces, clamped to their ends. (..., 3)"""
        u, v = np.moveaxis(uv, -1, 0)
        piece = np.broadcast_to(piece, u.shape)
        if not self.is_rectangle:
            width = np.diff(self.power_cdf, prepend=0)[piece]
            root = np.sqrt(np.clip((u - self.power_cdf[piece] + width) / np.maximum(width, _TINY), 0, 1))
            u, v = root * (1 - v), root * v
        edges = self.edges[piece]
        return np.asarray(self.corner[piece] + u[..., None] * edges[..., 0, :] + v[..., None] * edges[..., 1, :])

    def normals(self) -> F64:
        """Unit normals of the pieces. (T, 3)"""
        normals = np.cross(self.edges[:, 0], self.edges[:, 1])
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY))

    def _fit_parallelograms(self, low: F64, size: F64) -> tuple[F64, F64, F64]:
        """Return parallelograms (P, 4, 3) with the moments of parts; mean normals (P, 3); piece areas (P,)."""
        step = (np.stack(np.meshgrid(*map(np.arange, _MOMENT_GRID)), axis=-1).reshape(-1, 2) + 0.5) / _MOMENT_GRID
        uv = low[:, None] + size * step
        piece = self.find_piece(uv[..., 0])
        positions, mean = self.evaluate_position(uv, piece), self.normals()[piece].mean(axis=1)
        areas = np.linalg.norm(np.cross(self.edges[:, 0], self.edges[:, 1]), axis=1) / 2
        area = size.prod() * (areas / np.maximum(np.diff(self.power_cdf, prepend=0), _TINY))[piece].mean(axis=1)
        center = positions.mean(axis=1)
        offsets = positions - center[:, None]
        values, vectors = np.linalg.eigh(np.einsum("pki,pkj->pij", offsets, offsets) / len(step))
        half = np.sqrt(3 * np.maximum(values[:, None, 1:], 0)) * vectors[:, :, 1:]  # a square's variance is half² / 3
        e, f = half[:, :, 1], half[:, :, 0]
        return np.stack([center - e - f, center + e - f, center + e + f, center - e + f], axis=1), mean, area


def _halves(corners: F64) -> tuple[F64, F64]:
    """Areas of the triangles 0 1 2 and 0 2 3 of quadrilaterals (P, 4, 3). (P,) each"""
    a, b, c, d = corners.transpose(1, 0, 2)
    first, second = (np.linalg.norm(np.cross(p - a, q - a), axis=1) / 2 for p, q in ((b, c), (c, d)))
    return np.asarray(first), np.asarray(second)
