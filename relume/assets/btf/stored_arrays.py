"""Arrays of a compressed BTF as they are stored: entropy coded by deflate (zlib), similar numbers together.

Weights and eigenvectors are bytes, one component after another, since components have different distributions. Means
are bytes too: multiples of their steps beside the average. If all views share weights, these are stored once for the
finest level; those of coarser levels are stored for each view.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid
from relume.assets.btf.local_pca_btf import INT8_MAX, LocalPcaBtf, SharedTexels
from relume.assets.btf.parallax import visible_texels

Arrays = dict[str, NDArray[Any]]


def to_arrays(btf: LocalPcaBtf) -> Arrays:
    """Arrays to store."""
    deviation = btf.mean.astype(np.float32) - btf.average[:, None]
    codes = np.rint(deviation / np.maximum(btf.mean_step, 1e-30)[:, :, None, None]).clip(-INT8_MAX, INT8_MAX)
    arrays: Arrays = {
        **{name: getattr(btf, name) for name in ("levels", "mean_step", "step", "average", "height")},
        "mean": codes.astype(np.int8),
        "eigen": np.moveaxis(btf.eigen, 2, 0),
        "cluster": btf.cluster,
        "weight": np.moveaxis(btf.weight, 2, 0),
    }
    if btf.shared is not None:
        num = btf.size[0] * btf.size[1]
        arrays["shared_cluster"], arrays["shared_weight"] = btf.shared.cluster, btf.shared.weight.T
        arrays["cluster"], arrays["weight"] = arrays["cluster"][:, num:], arrays["weight"][:, :, num:]
    return arrays


def from_arrays(arrays: Mapping[str, NDArray[Any]], grid: DirectionGrid, error: tuple[float, ...]) -> LocalPcaBtf:
    """Invert `to_arrays`.

    Args:
        arrays: by name. grid: grid of the directions. error: relative RMS by the number of components.
    Raises:
        ValueError, KeyError, IndexError: the arrays are inconsistent.
    """
    average, cluster, weight = arrays["average"], arrays["cluster"], np.moveaxis(arrays["weight"], 0, 2)
    mean = average[:, None] + arrays["mean"] * arrays["mean_step"][:, :, None, None]
    shared = None
    if "shared_cluster" in arrays:
        shared = SharedTexels(arrays["shared_cluster"], np.ascontiguousarray(arrays["shared_weight"].T))
        height, width = (int(side) for side in arrays["levels"][0, 1:])
        source = visible_texels(arrays["height"], grid, (height, width))
        cluster = np.concatenate([shared.cluster[source], cluster], axis=1)
        weight = np.concatenate([shared.weight[source], weight], axis=1)
    return LocalPcaBtf(
        grid=grid, error=error, shared=shared, cluster=cluster, weight=np.ascontiguousarray(weight),
        mean=mean.astype(np.float16), eigen=np.ascontiguousarray(np.moveaxis(arrays["eigen"], 0, 2)),
        **{name: arrays[name] for name in ("levels", "mean_step", "step", "average", "height")},
    )  # fmt: skip


def stored_bytes(btf: LocalPcaBtf) -> int:
    """Stored size without mip levels, which the measured data do not have either."""
    arrays, num = to_arrays(btf), btf.size[0] * btf.size[1]
    if btf.shared is None:
        arrays["cluster"], arrays["weight"] = arrays["cluster"][:, :num], arrays["weight"][:, :, :num]
    else:  # the last cluster belongs to the mip levels
        del arrays["cluster"], arrays["weight"]
        arrays["eigen"] = arrays["eigen"][:, :, :-1]
        arrays.update({name: arrays[name][:, :-1] for name in ("mean", "mean_step", "step")})
    return sum(len(zlib.compress(np.ascontiguousarray(array).tobytes())) for array in arrays.values())
