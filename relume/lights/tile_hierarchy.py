"""Inner nodes above the tiles of a sphere: sums over them, and ancestors of tiles."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_FIRST_INNER_CODE = 32  # smaller codes are octants


def sum_inner_nodes(
    codes: Shaped[Codes, " M"], values: Shaped[F64, "K M"]
) -> tuple[Shaped[Codes, " N"], Shaped[F64, "K N"]]:
    """Return the sorted codes of the inner nodes above tiles, and the sums of the values below each.

    Args:
        codes: codes of the tiles, see `relume.lights.sphere_tiles.Tiles`. values: values of the tiles.
    """
    ancestors, sums = [np.empty(0, np.uint64)], [values[:, :0]]
    while (is_deeper := codes >= _FIRST_INNER_CODE).any():
        codes, values = codes[is_deeper] >> np.uint64(2), values[:, is_deeper]
        ancestors.append(codes)
        sums.append(values)
    inner_codes, node_index = np.unique(np.concatenate(ancestors), return_inverse=True)
    leaf_values = np.concatenate(sums, axis=1)
    return inner_codes, np.array([np.bincount(node_index, row, len(inner_codes)) for row in leaf_values])


def highest_ancestors(codes: Shaped[Codes, " M"], split_codes: Shaped[Codes, " splits"]) -> Shaped[Codes, " M"]:
    """Return the highest node above each tile that is not split.

    Args:
        codes: codes of the tiles. split_codes: split nodes, with all nodes above these.
    """
    ancestors = codes.copy()
    while True:
        can_rise = (ancestors >= _FIRST_INNER_CODE) & ~np.isin(ancestors >> np.uint64(2), split_codes)
        if not can_rise.any():
            return ancestors
        ancestors[can_rise] >>= np.uint64(2)
