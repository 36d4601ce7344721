"""Visibility of an environment's tiles, as far as a bake does not have it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import CancelledError
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import above_horizon, trace_visibility

Bits = NDArray[np.uint8]

_POINTS_PER_BATCH = 65_536


class NewTiles(NamedTuple):
    """The tiles of a refined environment whose visibility is not baked.

    Attributes:
        key: identifies them. num_lights: number of all tiles. tile: indices of these.
        direction: unit, of their shadow rays.
    """

    key: Hashable
    num_lights: int
    tile: Shaped[NDArray[np.intp], " K"]
    direction: Shaped[NDArray[np.float32], "K 3"]

    def unoccluded(self, points: SurfacePoints) -> Shaped[Bits, "n new_bytes"]:
        """Return their visibility from points to which nothing occludes them."""
        return above_horizon(points.normal, self.direction)

    def trace(
        self, scene: EmbreeScene, points: SurfacePoints, is_canceled: Callable[[], bool]
    ) -> Shaped[Bits, "n new_bytes"]:
        """Return their visibility from points.

        Args:
            scene: the occluding triangles. points: the points. is_canceled: polled.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        batches = [np.empty((0, (len(self.tile) + 7) // 8), np.uint8)]
        for start in range(0, points.num_points, _POINTS_PER_BATCH):
            if is_canceled():
                raise CancelledError("the shadows of the environment were canceled")
            some = points.rows(slice(start, start + _POINTS_PER_BATCH))
            ray_args = scene, some.position, some.normal, self.direction, some.alpha_sample
            batches.append(trace_visibility(*ray_args).visible)
        return np.concatenate(batches)

    def insert(self, new: Shaped[Bits, "n new_bytes"], baked: Shaped[Bits, "n bytes"]) -> Shaped[Bits, "n all_bytes"]:
        """Return the visibility of all tiles. new: theirs. baked: of the bake's tiles"""
        out = np.empty((len(baked), (self.num_lights + 7) // 8), np.uint8)
        parallel_for_chunks(lambda start, stop: _insert(new, baked, self.tile, start, stop, out), len(out))
        return out


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _insert(new, baked, tile, start, stop, out):  # type: ignore[no-untyped-def]
    """Write bits of points [start, stop): bit k of `new` to bit tile[k], all others from `baked`."""
    for p in range(start, stop):
        for byte in range(baked.shape[1]):
            out[p, byte] = baked[p, byte]
        for byte in range(baked.shape[1], out.shape[1]):
            out[p, byte] = 0
        for k in range(tile.shape[0]):
            byte, shift = tile[k] >> 3, np.uint8(tile[k] & 7)
            bit = (new[p, k >> 3] >> np.uint8(k & 7)) & np.uint8(1)
            out[p, byte] = (out[p, byte] & ~(np.uint8(1) << shift)) | (bit << shift)
