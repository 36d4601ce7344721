"""Samples of a view in mirrors: their specular chains, and their weights in pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.ray_paths import NO_MIRROR, SpecularChain
from relume.core.errors import ChunkDamagedError
from relume.store.bake_protocol import StoreReader

F32 = NDArray[np.float32]


class MirrorSamples(NamedTuple):
    """Samples in mirrors, m of a view's n.

    Attributes:
        sample: rows of the samples, ascending.
        order_index: index in the view's `order`.
        throughput: factor of the radiance in its pixel, without mirrors.
        chain: the mirrors on the path.
        origin: point on the last mirror. direction: unit direction from `origin`.
        distance: distance from `origin`; infinite for the background.
    """

    sample: Shaped[NDArray[np.int64], " m"]
    order_index: Shaped[NDArray[np.int64], " m"]
    throughput: Shaped[F32, "m 3"]
    chain: SpecularChain
    origin: Shaped[F32, "m 3"]
    direction: Shaped[F32, "m 3"]
    distance: Shaped[F32, " m"]

    def restrict_to(self, rows: slice) -> slice:
        """Slice of the mirror samples that are among some rows of the view."""
        first, stop = np.searchsorted(self.sample, (rows.start, rows.stop))
        return slice(int(first), int(stop))


def read_mirror_samples(
    store: StoreReader,
    k: int,
    order: Shaped[NDArray[np.int32], " n"],
    sample_throughput: Shaped[F32, "n channels"],
    num_surface: int,
) -> MirrorSamples | None:
    """Read the samples of a view in mirrors; None if there are none.

    Args:
        store: an open store. k: index of the view. order: order of its samples, by pixel.
        sample_throughput: throughput of each sample.
        num_surface: number of samples on surfaces, which come first.
    Raises:
        ChunkDamagedError: a mirror has a material that does not exist in the scene.
    """
    if not store.attributes.get("has_layers"):
        return None
    prefix = f"views/{k}"
    material = store.read(f"{prefix}/mirror")
    sample = np.flatnonzero(material[:, 0] != NO_MIRROR)
    if not len(sample):
        return None
    if int(np.where(material == NO_MIRROR, 0, material).max()) >= len(store.attributes["materials"]):
        raise ChunkDamagedError(prefix, "a mirror has a material that does not exist in the scene")
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
