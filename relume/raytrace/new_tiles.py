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
from relume.raytrace.visibility import trace_visibility

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

    def unoccluded(self, points: SurfacePoints, baked: Shaped[Bits, "n bytes"]) -> Shaped[Bits, "n more_bytes"]:
        """Return the visibility of all tiles at points to which nothing occludes them. baked: of the bake's tiles"""
        above = np.packbits(points.normal @ self.direction.T > 0, axis=1, bitorder="little")
        return self._insert(baked, above)

    def trace(
        self,
        scene: EmbreeScene,
        points: SurfacePoints,
        baked: Shaped[Bits, "n bytes"],
        is_canceled: Callable[[], bool],
    ) -> Shaped[Bits, "n more_bytes"]:
        """Return the visibility of all tiles at points; that of the new ones is traced.

        Args:
            scene: the occluding triangles. points, baked: with the visibility of the bake's tiles. is_canceled: polled.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        batches = [np.empty((0, self._num_bytes), np.uint8)]
        for start in range(0, points.num_points, _POINTS_PER_BATCH):
            if is_canceled():
                raise CancelledError("the shadows of the environment were canceled")
            batch = np.arange(start, min(start + _POINTS_PER_BATCH, points.num_points))
            some = points.rows(batch)
            traced = trace_visibility(scene, some.position, some.normal, self.direction, some.alpha_sample)
            batches.append(self._insert(baked[batch], traced.visible))
        return np.concatenate(batches)

    @property
    def _num_bytes(self) -> int:
        return (self.num_lights + 7) // 8

    def _insert(self, baked: Bits, new: Bits) -> Bits:
        out = np.zeros((len(baked), self._num_bytes), np.uint8)
        out[:, : baked.shape[1]] = baked
        parallel_for_chunks(lambda start, stop: _set_bits(new, self.tile, start, stop, out), len(out))
        return out


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _set_bits(new, tile, start, stop, out):  # type: ignore[no-untyped-def]
    """Copy bit k of points [start, stop) to bit tile[k]. new, out: light m of a point in bit m & 7 of byte m >> 3"""
    for p in range(start, stop):
        for k in range(tile.shape[0]):
            byte, shift = tile[k] >> 3, np.uint8(tile[k] & 7)
            bit = (new[p, k >> 3] >> np.uint8(k & 7)) & np.uint8(1)
            out[p, byte] = (out[p, byte] & ~(np.uint8(1) << shift)) | (bit << shift)
