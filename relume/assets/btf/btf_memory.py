"""Memory that BTFs take while they are shown: known before any of it is allocated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from relume.assets.btf.btf_store import load_shape
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
    tables = directions**2 * clusters * (1 + components) * _CHANNELS * (_FLOAT_BYTES + 1)  # and as stored
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
        check_assets(label, sum(memory_bytes(*load_shape(name)) for name in names), remedy)
