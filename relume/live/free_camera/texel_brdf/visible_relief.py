"""The relief of a BTF as each view direction sees it: where a direction between them finds the same point.

A ray toward v that crosses the plane at y meets the relief at height H_v(y). A ray toward ω that crosses at x meets the
relief at the height h that the nearest direction v sees,

    h = H_v(x + h (s(ω) − s(v))) ,

with s of `relume.assets.btf.parallax`. A fixed-point iteration from the top of the relief finds it with two fetches,
where a ray would march through the relief. All four views around ω then look up x_v of that height.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.compressed_view import build_mip_levels
from relume.assets.btf.local_pca_btf import LocalPcaBtf
from relume.assets.btf.parallax import compute_shears, parallax_intersection
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.live.free_camera.texel_brdf.texture_coordinates import repeat_fraction

F32 = NDArray[np.float32]

NUM_FETCHES = 2  # of the iteration
_MAX_TEXELS = 1 << 16  # of the finest level: rays through more take seconds, and yarns are wider than a texel
_MAX_BYTE = 255


class VisibleRelief(NamedTuple):
    """Heights that each view direction sees.

    Attributes:
        levels: first texel, height and width of each mip level. skip: levels of the BTF that are finer.
        height: heights, in steps above `lowest`.
        lowest, step: in side lengths of the texture. shear: s of each view direction. max_slope: the longest of them.
    """

    levels: Shaped[NDArray[np.int32], "levels 3"]
    skip: int
    height: Shaped[NDArray[np.uint8], "views texels"]
    lowest: np.float32
    step: np.float32
    shear: Shaped[F32, "views 2"]
    max_slope: np.float32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _trace_texels(relief, lowest, highest, shear, out):  # type: ignore[no-untyped-def]
    """Find the heights that are seen at the centers of texels.

    Args:
        relief: the height map. lowest, highest: its range. shear: s of the direction. out: (height, width), written.
    """
    rows, columns = out.shape
    for row in range(rows):
        for column in range(columns):
            u, v = (column + np.float32(0.5)) / np.float32(columns), (row + np.float32(0.5)) / np.float32(rows)
            out[row, column] = parallax_intersection(relief, lowest, highest, np.float32(u), np.float32(v), shear)


def see_relief(pca_btf: LocalPcaBtf, levels: Shaped[NDArray[np.int32], "levels 3"]) -> VisibleRelief:
    """Trace the heights that each view direction sees, and average them to mip levels.

    Args:
        pca_btf: the BTF. levels: its mip levels that are stored.
    """
    shear, lowest, highest = compute_shears(pca_btf.grid), pca_btf.height.min(), pca_btf.height.max()
    skip = int(np.argmax(levels[:, 1].astype(np.int64) * levels[:, 2] <= (_MAX_TEXELS if highest > lowest else 1)))
    size, num_views = (int(levels[skip, 1]), int(levels[skip, 2])), len(shear)
    heights = np.empty((num_views, *size), np.float32)

    def trace(start: int, stop: int) -> None:
        for view in range(start, stop):
            direction = shear[view, 0], shear[view, 1]
            _trace_texels(pca_btf.height, lowest, highest, direction, heights[view])

    for_ranges(trace, num_views, 1)
    step = max(highest - lowest, np.float32(1e-20)) / np.float32(_MAX_BYTE)
    mip_levels = build_mip_levels(np.ascontiguousarray(heights.reshape(num_views, -1).T), size)
    steps = np.concatenate([level.reshape(-1, num_views) for level in mip_levels]).T - lowest
    stored_levels = np.ascontiguousarray(levels[skip:] - [levels[skip, 0], 0, 0], np.int32)
    height, max_slope = (
        np.rint(steps / step).clip(0, 255).astype(np.uint8),
        np.float32(np.linalg.norm(shear, axis=1).max()),
    )
    return VisibleRelief(stored_levels, skip, np.ascontiguousarray(height), lowest, step, shear, max_slope)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def visible_height(relief, level, view, u, v, shear_u, shear_v):  # type: ignore[no-untyped-def]
    """Find the height of what a ray meets, as a view direction near it sees it.

    Args:
        relief: the `VisibleRelief`. level: mip level of the BTF. view: index of the view direction.
        u, v: crossing of the ray with the plane, in repeats, [0, 1). shear_u, shear_v: s of the ray.
    """
    stored_level = min(max(level - relief.skip, 0), relief.levels.shape[0] - 1)
    first, rows, columns = (
        relief.levels[stored_level, 0],
        relief.levels[stored_level, 1],
        relief.levels[stored_level, 2],
    )
    across, up = shear_u - relief.shear[view, 0], shear_v - relief.shear[view, 1]
    h = relief.lowest + np.float32(255) * relief.step
    for _ in range(NUM_FETCHES):
        x, y = repeat_fraction(u + h * across), repeat_fraction(v - h * up)
        row = min(np.int32(y * np.float32(rows)), rows - 1)
        column = min(np.int32(x * np.float32(columns)), columns - 1)
        h = relief.lowest + relief.step * np.float32(relief.height[view, first + row * columns + column])
    return h
