"""Memory that BTFs take while they are shown: known before any of it is allocated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from relume.assets.btf.btf_store import STORE
from relume.core.cache import check_assets
from relume.core.errors import count_text

_FREE_CAMERA_BYTES = 25  # per texel and view direction: 24 coefficients and the height that is seen
_CHANNELS, _FLOAT_BYTES = 3, 4


def memory_bytes(size: tuple[int, int], directions: int, clusters: int, components: int) -> int:
    """Memory of one BTF: its texels, the tables of fixed views, and the coefficients of the free camera.

    Args:
        size: height and width, texels; coarser mip levels have a third of them.
        directions, clusters, components: numbers of them, see `LocalPcaBtf`.
    """
    texels = directions * (4 * size[0] * size[1] // 3) * (1 + components + _FREE_CAMERA_BYTES)
    tables = directions**2 * clusters * (1 + components) * _CHANNELS * _FLOAT_BYTES
    return texels + tables


def check_btfs_fit(terms: Iterable[Mapping[str, Any]]) -> None:
    """Check that the BTFs of a look fit the cache together; only their headers are read.

    Args:
        terms: all terms of the look.
    Raises:
        MemoryBudgetError: they do not fit. NotFoundError: one does not exist.
    """
    names = {str(term["data"]) for term in terms if term["model"] == "measured_btf"}
    if names:
        label = count_text(len(names), "measured texture (BTF)", "measured textures (BTF) at once")
        remedy = "use fewer or smaller ones, or raise the cache budget"
        check_assets(label, sum(map(_stored_bytes, names)), remedy)


def _stored_bytes(data: str) -> int:
    """Memory of a stored BTF."""
    path = STORE.resolve(data)
    try:
        levels = np.load(path / "levels.npy", allow_pickle=False)
        shape = np.load(path / "eigen.npy", mmap_mode="r", allow_pickle=False).shape
    except (OSError, ValueError, EOFError) as problem:
        raise STORE.damaged_error(path) from problem
    if levels.ndim != 2 or levels.shape[1] != 3 or not len(levels) or len(shape) != 5:
        raise STORE.damaged_error(path)
    return memory_bytes((int(levels[0, 1]), int(levels[0, 2])), shape[0], shape[1], shape[2])
