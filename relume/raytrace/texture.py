"""Trilinear texture lookups in a MIP map, one or several in the footprint of a pixel."""

from __future__ import annotations

import math
import weakref
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.scene.model import WRAPS, Texture
from relume.scene.texture_encoding import ROWS_PER_BATCH, decode, periodic

F32 = NDArray[np.float32]

_UV_COLUMNS = 9  # of `SurfaceInteraction.uv`
_LOOKUPS_PER_RANGE = 16_384
_MAX_LOOKUPS = 8  # along a footprint
_REPEAT, _, _CLAMP = range(len(WRAPS))  # wrap modes in kernels


class MipMap:
    """A texture and its MIP levels down to one texel; the levels are stored in half precision."""

    def __init__(self, texture: Texture) -> None:
        self.wrap, self.coding = texture.wrap, texture.encoding
        self.levels: list[NDArray[Any]] = [texture.pixels]
        while max(self.levels[-1].shape[:2]) > 1:
            self.levels.append(self._downsample(len(self.levels) - 1))

    def level(self, k: int) -> Shaped[F32, "height width channels"]:
        """Decoded values of a level."""
        return decode(self.levels[k], self.coding if k == 0 else None)

    def _downsample(self, k: int) -> NDArray[np.float16]:
        """Compute the level after level k, a few rows at a time."""
        image, coding = self.levels[k], self.coding if k == 0 else None
        strips = [
            _halve(decode(image[start : start + ROWS_PER_BATCH], coding))
            for start in range(0, len(image), ROWS_PER_BATCH)
        ]
        return np.concatenate([strip.astype(np.float16) for strip in strips])

    @staticmethod
    def for_texture(texture: Texture) -> MipMap:
        """Get or make the MIP map of a texture, cached as long as the texture exists."""
        key = id(texture)
        if key not in _pyramids:
            _pyramids[key] = MipMap(texture)
            weakref.finalize(texture, _pyramids.pop, key, None).atexit = False
        return _pyramids[key]

    def texels(self, footprint: Shaped[F32, " n"]) -> Shaped[F32, " n"]:
        """Convert the sides of filters from UV space to texels."""
        return np.asarray(footprint * max(self.levels[0].shape[:2]), np.float32)

    def sample_pixels(self, uv: Shaped[F32, "n 2"], axes: Shaped[F32, "n sides=2 uv=2"]) -> Shaped[F32, "n channels"]:
        """Look up means over pixels' footprints, by 2 × 2 to 2 × `_MAX_LOOKUPS` filtered values in each.

        One filter as large as a footprint reaches more than a pixel beyond it, into what an atlas has beside it, and a
        square one blurs across a long footprint.

        Args:
            uv: v from the top. axes: sides of the footprints, from `FacePoints.texture_sides`.
        """
        height, width = self.levels[0].shape[:2]
        size = np.array([width, height], np.float32)
        major, minor = _ellipse_axes(axes * size)
        length, breadth = np.linalg.norm(major, axis=1), np.linalg.norm(minor, axis=1)
        across = np.where(breadth > 1, 2, 1)
        along = np.clip(np.round(across * length / np.maximum(breadth, 1)), 1, _MAX_LOOKUPS).astype(np.int64)
        side = np.sqrt(length / along * breadth / across) / max(height, width)
        out = np.zeros((len(uv), self.levels[0].shape[2]), np.float32)
        for counts in set(zip(along.tolist(), across.tolist(), strict=True)):
            rows = np.nonzero((along == counts[0]) & (across == counts[1]))[0]
            for cell in np.ndindex(counts):
                i, j = (np.array(cell) + 0.5) / counts - 0.5
                offset = (i * major[rows] + j * minor[rows]) / size
                out[rows] += self.sample((uv[rows] + offset).astype(np.float32), side[rows]) / np.float32(
                    np.prod(counts)
                )
        return out

    def sample(self, uv: Shaped[F32, "n 2"], footprint: Shaped[F32, " n"]) -> Shaped[F32, "n channels"]:
        """Look up filtered values.

        Args:
            uv: v from the top. footprint: side of the filter in UV space.
        """
        texels = np.maximum(self.texels(footprint), 1.0)
        level = np.minimum(np.log2(texels), len(self.levels) - 1)
        lower = np.floor(level).astype(np.int64)
        out = np.zeros((len(uv), self.levels[0].shape[2]), np.float32)
        for k in np.unique(np.concatenate([lower, np.minimum(lower + 1, len(self.levels) - 1)])):
            weight = np.maximum(1 - np.abs(level - k), 0)
            rows = np.nonzero(weight > 0)[0]
            out[rows] += (weight[rows, None] * self._bilinear(int(k), uv[rows])).astype(np.float32)
        return out

    def _bilinear(self, k: int, uv: F32) -> F32:
        image, coding = self.levels[k], self.coding if k == 0 else None
        height, width = image.shape[:2]
        x = uv[:, 0].astype(np.float64) * width - 0.5
        y = uv[:, 1].astype(np.float64) * height - 0.5
        x0, y0 = np.floor(x), np.floor(y)
        fx, fy = (x - x0)[:, None], (y - y0)[:, None]
        columns = [periodic(x0 + dx, width, self.wrap[0]) for dx in (0, 1)]
        rows = [periodic(y0 + dy, height, self.wrap[1]) for dy in (0, 1)]
        texel_rows = [[decode(image[row, column], coding) for column in columns] for row in rows]
        top, bottom = (left * (1 - fx) + right * fx for left, right in texel_rows)
        return np.asarray(top * (1 - fy) + bottom * fy, np.float32)


def footprint_sides(uv: Shaped[F32, "n uv"]) -> Shaped[F32, "n 2 2"]:
    """Return the sides of pixels' footprints in UV space, as rows; of squares if only their size is known.

    Args:
        uv: as in `relume.raytrace.surface_interaction.SurfaceInteraction`; older stores lack the sides.
    """
    if uv.shape[1] >= _UV_COLUMNS:
        return uv[:, 5:_UV_COLUMNS].reshape(-1, 2, 2)
    return np.asarray(uv[:, 2, None, None] * np.eye(2, dtype=np.float32))


def sample_image(texture: Texture, uv: Shaped[F32, "n uv"]) -> Shaped[F32, "n channels"]:
    """Look up a texture on all threads.

    Args:
        texture: any. uv: as in `relume.raytrace.surface_interaction.SurfaceInteraction`; see `footprint_sides`.
    """
    pyramid, out = MipMap.for_texture(texture), np.empty((len(uv), texture.pixels.shape[2]), np.float32)

    def sample_range(start: int, stop: int) -> None:
        out[start:stop] = pyramid.sample_pixels(uv[start:stop, :2], footprint_sides(uv[start:stop]))

    for_ranges(sample_range, len(uv), _LOOKUPS_PER_RANGE)
    return out


def _ellipse_axes(sides: Shaped[F32, "n 2 2"]) -> tuple[Shaped[F32, "n 2"], Shaped[F32, "n 2"]]:
    """The long and the short axis of the ellipse whose conjugate diameters are the sides of parallelograms."""
    u, v = sides[..., 0], sides[..., 1]
    uu, vv, uv = (u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)
    mean, half_difference = (uu + vv) / 2, np.hypot((uu - vv) / 2, uv)
    angle = 0.5 * np.arctan2(2 * uv, uu - vv)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    length, breadth = np.sqrt(mean + half_difference), np.sqrt(np.maximum(mean - half_difference, 0))
    return length[:, None] * direction, breadth[:, None] * np.stack([-direction[:, 1], direction[:, 0]], axis=1)


_pyramids: dict[int, MipMap] = {}
"""MIP maps by identity of their textures, as long as these exist; comparing contents is not worth the time."""


def _halve(image: F32) -> F32:
    height, width = image.shape[:2]
    padded = np.pad(
        image, ((0, height % 2 if height > 1 else 1), (0, width % 2 if width > 1 else 1), (0, 0)), mode="edge"
    )
    return np.asarray(
        (padded[0::2, 0::2] + padded[1::2, 0::2] + padded[0::2, 1::2] + padded[1::2, 1::2]) / 4, np.float32
    )


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def _texel(wrap, index, size):  # type: ignore[no-untyped-def]
    """Map a texel's index into an image with mirrored repeat, or clamp it."""
    if wrap == _CLAMP:
        return min(max(index, 0), size - 1)
    folded = index % (2 * size)
    return min(folded, 2 * size - 1 - folded)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def two_texels(wrap, coordinate, size):  # type: ignore[no-untyped-def]
    """Find two adjacent texels for linear interpolation along one side of an image, and the weight of the second.

    wrap: one of `WRAPS`. coordinate: coordinate along the image's side, 0 to 1. size: texels along it.
    """
    if wrap == _REPEAT:
        # so that indices are out of range by at most one texel, and no division is needed
        coordinate -= math.floor(coordinate)
    texel_coordinate = coordinate * np.float32(size) - np.float32(0.5)
    below = math.floor(texel_coordinate)
    first = np.int64(below)
    second = first + 1
    if wrap == _REPEAT:
        return (
            first + size if first < 0 else first,
            second - size if second >= size else second,
            np.float32(texel_coordinate - below),
        )
    return _texel(wrap, first, size), _texel(wrap, second, size), np.float32(texel_coordinate - below)
