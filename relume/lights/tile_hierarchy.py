"""Nodes above the tiles of a sphere: what lies below them, and which of them stand for several tiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_FIRST_INNER_CODE = 32  # codes of tiles below are octants


def sum_inner_nodes(codes: Codes, values: F64) -> tuple[Codes, F64]:
    """Find the nodes above tiles, and sum what lies below each.

    Args:
        codes: of the tiles, as `relume.lights.sphere_tiles.Tiles` has them. (M,) values: of the tiles. (K, M)
    Returns:
        Codes of N nodes, none of them a tile, in order; and sums (K, N).
    """
    ancestors, sums = [np.empty(0, np.uint64)], [values[:, :0]]
    while (is_deeper := codes >= _FIRST_INNER_CODE).any():
        codes, values = codes[is_deeper] >> np.uint64(2), values[:, is_deeper]
        ancestors.append(codes)
        sums.append(values)
    inner_codes, node_index = np.unique(np.concatenate(ancestors), return_inverse=True)
    leaf_values = np.concatenate(sums, axis=1)
    return inner_codes, np.array([np.bincount(node_index, row, len(inner_codes)) for row in leaf_values])


def highest_ancestors(codes: Codes, split_codes: Codes) -> Codes:
    """Find the node above each tile under which nothing is split: the highest below those that are. (M,)

    Args:
        codes: of the tiles. (M,) split_codes: nodes that do not stand for what lies below them, with all above them.
    """
    ancestors = codes.copy()
    while True:
        can_rise = (ancestors >= _FIRST_INNER_CODE) & ~np.isin(ancestors >> np.uint64(2), split_codes)
        if not can_rise.any():
            return ancestors
        ancestors[can_rise] >>= np.uint64(2)
