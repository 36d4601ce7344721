"""Nodes above the tiles of a sphere: what lies below them, and which of them stand for several tiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_FIRST_INNER = 32  # codes of tiles below are octants


def inner_nodes(codes: Codes, values: F64) -> tuple[Codes, F64]:
    """Find the nodes above tiles, and sum what lies below each.

    Args:
        codes: of the tiles, as `relume.light.tiles.Tiles` has them. (M,) values: of the tiles. (K, M)
    Returns:
        Codes of N nodes, none of them a tile, in order; and sums (K, N).
    """
    nodes, sums = [np.empty(0, np.uint64)], [values[:, :0]]
    while (is_deeper := codes >= _FIRST_INNER).any():
        codes, values = codes[is_deeper] >> np.uint64(2), values[:, is_deeper]
        nodes.append(codes)
        sums.append(values)
    found, place = np.unique(np.concatenate(nodes), return_inverse=True)
    below = np.concatenate(sums, axis=1)
    return found, np.array([np.bincount(place, row, len(found)) for row in below])


def highest(codes: Codes, split: Codes) -> Codes:
    """Find the node above each tile under which nothing is split: the highest below those that are. (M,)

    Args:
        codes: of the tiles. (M,) split: nodes that do not stand for what lies below them, with all above them.
    """
    found = codes.copy()
    while True:
        rises = (found >= _FIRST_INNER) & ~np.isin(found >> np.uint64(2), split)
        if not rises.any():
            return found
        found[rises] >>= np.uint64(2)
