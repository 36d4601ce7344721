"""Samples of a view that are seen in mirrors: by which, and how they count for their pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.camera.ray_paths import NO_MIRROR, SpecularChain
from relume.core.errors import ChunkDamagedError
from relume.store.bake_protocol import StoreReader

F32 = NDArray[np.float32]


class MirrorSamples(NamedTuple):
    """m samples that are seen in mirrors, of a view's n.

    Attributes:
        sample: their rows, ascending. (m,) int64
        order_index: of each in the view's `order`. (m,) int64
        throughput: what its radiance is multiplied by for its pixel, mirrors apart. (m, 3) float32
        chain: the mirrors that it is seen in.
        origin: where the last of them is. (m, 3) float32. direction: from there, unit. (m, 3) float32
        distance: from there; infinite of the background. (m,) float32
    """

    sample: NDArray[np.int64]
    order_index: NDArray[np.int64]
    throughput: F32
    chain: SpecularChain
    origin: F32
    direction: F32
    distance: F32

    def restrict_to(self, rows: slice) -> slice:
        """Which of them are among some rows of the view."""
        first, stop = np.searchsorted(self.sample, (rows.start, rows.stop))
        return slice(int(first), int(stop))


def read_mirror_samples(
    store: StoreReader, k: int, order: NDArray[np.int32], sample_throughput: F32, num_surface: int
) -> MirrorSamples | None:
    """Read which samples of a view are seen in mirrors; None where none is.

    Args:
        store: an open store. k: number of the view. order: of its samples, by pixel. (n,)
        sample_throughput: of each sample. (n, 3) num_surface: of the samples, those that are on surfaces, which come
            first.
    Raises:
        ChunkDamagedError: a mirror is of a material that the scene has not.
    """
    if not store.attributes.get("has_layers"):
        return None
    prefix = f"views/{k}"
    material = store.read(f"{prefix}/mirror")
    sample = np.flatnonzero(material[:, 0] != NO_MIRROR)
    if not len(sample):
        return None
    if int(np.where(material == NO_MIRROR, 0, material).max()) >= len(store.attributes["materials"]):
        raise ChunkDamagedError(prefix, "a mirror has a material that the scene has not")
    order_index = np.empty(len(order), np.int64)
    order_index[order] = np.arange(len(order))
    chain = SpecularChain(material, store.read(f"{prefix}/mirror_cosine"), store.read(f"{prefix}/mirror_tint"))
    origin, direction = (store.read(f"{prefix}/{name}")[sample] for name in ("camera", "position"))
    distance, surface_rows = (
        np.full(len(sample), np.inf, np.float32),
        slice(0, int(np.searchsorted(sample, num_surface))),
    )
    offset = direction[surface_rows] - origin[surface_rows]
    distance[surface_rows] = np.linalg.norm(offset, axis=1)
    direction[surface_rows] = offset / np.maximum(distance[surface_rows], 1e-30)[:, None]
    throughput = np.array(sample_throughput[sample], np.float32)
    return MirrorSamples(sample, order_index[sample], throughput, chain.rows(sample), origin, direction, distance)
