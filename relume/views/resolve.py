"""Resolve view samples to pixels, and encode pixels as bytes: the last two steps of a frame, tile by tile."""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import ArrayLike, NDArray

from relume.core.errors import ParameterError
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.image_io.write_image import to_bytes
from relume.math.rgb9e5 import pack_rgb9e5
from relume.views.frost_filter import FrostFilter
from relume.views.view import Tile, View

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _resolve_tiles(radiance, gain, first, order, throughput, width, tiles, offsets, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the samples of each pixel of tiles [start, stop) into out (pixels, 3)."""
    green_column, blue_column = throughput.shape[1] // 2, throughput.shape[1] - 1  # columns of green and blue
    for t in range(start, stop):
        x0, y0, tile_width, tile_height = tiles[t, 0], tiles[t, 1], tiles[t, 2], tiles[t, 3]
        out_row = offsets[t]
        for y in range(y0, y0 + tile_height):
            for x in range(x0, x0 + tile_width):
                p = y * width + x
                red = green = blue = np.float32(0)
                for k in range(first[p], first[p + 1]):
                    s = order[k]
                    red += throughput[k, 0] * radiance[0, s]
                    green += throughput[k, green_column] * radiance[1, s]
                    blue += throughput[k, blue_column] * radiance[2, s]
                out[out_row, 0], out[out_row, 1], out[out_row, 2] = gain[0] * red, gain[1] * green, gain[2] * blue
                out_row += 1


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _pack_range(pixels, start, stop, out):  # type: ignore[no-untyped-def]
    """Pack pixels [start, stop) of (pixels, 3) into words (pixels,)."""
    for p in range(start, stop):
        out[p] = pack_rgb9e5(pixels[p, 0], pixels[p, 1], pixels[p, 2])


def resolve(
    view: View,
    radiance: Shaped[F32, "3 samples"],
    tiles: Sequence[Tile],
    gain: ArrayLike,
    throughput: Shaped[F32, "samples channels"],
) -> Shaped[F32, "pixels 3"]:
    """Sum view samples to the pixels of tiles, in the order of the tiles, each row-major.

    Args:
        view: view of the samples. tiles: the pixels.
        radiance: radiance of every view sample.
        gain: factor of each channel, from the environment's intensity and color: a number or three.
        throughput: factors of the samples, in the view's order; `View.gains`, with those of samples in mirrors.
    """
    table = np.array(tiles, np.int64).reshape(-1, 4)
    sizes = table[:, 2] * table[:, 3]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    out = np.empty((int(offsets[-1]), 3), np.float32)
    factors = np.array(np.broadcast_to(np.asarray(gain, np.float32), 3))
    args = (radiance, factors, view.first, view.order, throughput, view.width, table, offsets)
    parallel_for_chunks(lambda start, stop: _resolve_tiles(*args, start, stop, out), len(table))
    if view.frost is not None:
        change = factors * _frost_change(view, view.frost, radiance, throughput)
        row = np.full(view.width * view.height, -1, np.int64)
        for (x, y, width, height), offset in zip(table.tolist(), offsets.tolist(), strict=False):
            tile_rows = np.arange(offset, offset + width * height).reshape(height, width)
            row.reshape(view.height, view.width)[y : y + height, x : x + width] = tile_rows
        row = row[view.frost.pixel]
        out[row[row >= 0]] += change[row >= 0]
    return out


def _frost_change(view: View, frost: FrostFilter, radiance: F32, throughput: F32) -> F32:
    """Change of the pixels that show frosted glass by its filter. (p, 3)"""
    num, order = len(frost.pixel), np.ascontiguousarray(view.order[frost.entry])
    sums, tiles, ones = np.empty((num, 3), np.float32), np.array([[0, 0, num, 1]]), np.ones(3, np.float32)
    factors = np.ascontiguousarray(throughput[frost.entry])
    _resolve_tiles(radiance, ones, frost.first, order, factors, num, tiles, np.zeros(1, np.int64), 0, 1, sums)
    return np.asarray(frost.change @ sums, np.float32)


def encode(
    view: View,
    radiance: Shaped[F32, "3 samples"],
    tiles: Sequence[Tile],
    encoding: str,
    gain: ArrayLike,
    throughput: Shaped[F32, "samples channels"],
) -> bytes:
    """Encode pixels of tiles as a frame's payload.

    Args:
        view, radiance, tiles, gain, throughput: as in `resolve`. encoding: "rgb9e5" or "f32" (see docs/api.md).
    Raises:
        ParameterError: the format is unknown.
    """
    return encode_pixels(resolve(view, radiance, tiles, gain, throughput), encoding)


def encode_coverage(alpha: Shaped[F32, "height width"], tiles: Sequence[Tile]) -> bytes:
    """Encode the coverage of each pixel of tiles as one byte, in the order of the tiles."""
    return b"".join(to_bytes(alpha[y : y + height, x : x + width]).tobytes() for x, y, width, height in tiles)


def encode_pixels(pixels: Shaped[F32, "pixels 3"], encoding: str) -> bytes:
    """Encode pixels as a frame's payload.

    Args:
        pixels: radiance. encoding: "rgb9e5" or "f32" (see docs/api.md).
    Raises:
        ParameterError: the format is unknown.
    """
    if encoding == "f32":
        return pixels.tobytes()
    if encoding != "rgb9e5":
        raise ParameterError("format", encoding, "'rgb9e5' or 'f32'")
    return pack_pixels(pixels).tobytes()


def pack_pixels(pixels: Shaped[F32, "pixels 3"]) -> Shaped[NDArray[np.uint32], " pixels"]:
    """Pack pixels (radiance) as RGB9_E5."""
    out = np.empty(len(pixels), np.uint32)
    parallel_for_chunks(lambda start, stop: _pack_range(pixels, start, stop, out), len(pixels))
    return out
