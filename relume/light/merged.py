"""Light triangles merged into a few larger ones, for operators that are to be there soon.

Tiles are leaves of a hierarchy; merged are those under an inner node that a coarser division would not have split.
What a point sees of a merged triangle is the share of its light that comes from the parts it sees
(docs/adr/0089-operators-of-merged-lights.md).
"""

from __future__ import annotations

from dataclasses import replace

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.hierarchy import highest, inner_nodes
from relume.light.tiles import SOLID_ANGLE_EXPONENT, UNIFORM_SHARE, Tiles
from relume.light.triangles import Parts, TriangleLights, merged_into
from relume.uncounted import UNCOUNTED

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_MERGED, _FEWEST = 8, 400  # lights that are merged into one; merged ones


def num_merged(num_lights: int) -> int:
    """How many lights an operator is made of that is to be there soon. num_lights: of the bake."""
    return max(_FEWEST, num_lights // _MERGED)


def merge(lights: TriangleLights, tiles: Tiles, num: int) -> TriangleLights:
    """Merge the light of tiles into about `num` triangles, which know their parts.

    Args:
        lights: of the tiles. tiles: M of them. num: of the merged ones (8 + 3k, the next below), if there are more.
    """
    luminous = luminance(lights.irradiance).astype(np.float64)
    codes, group = np.unique(_coarser(tiles, luminous, num), return_inverse=True)
    merged = merged_into(lights, group, codes)
    total = np.bincount(group, luminous, len(codes))
    share = np.divide(luminous, total[group], out=np.zeros_like(luminous), where=luminous > 0)
    return replace(merged, parts=Parts(group.astype(np.int32), share.astype(np.float32)))


def _coarser(tiles: Tiles, luminous: F64, num: int) -> Codes:
    """Find the tile of a division into about `num` that each tile is in. (M,)

    A node's metric is never below that of its children, so the nodes that are split are those of the largest metrics.
    """
    uniform = UNIFORM_SHARE * float(luminous.sum()) / (4 * np.pi)
    inner, (light, extent) = inner_nodes(tiles.codes, np.stack([luminous, tiles.solid_angles]))
    metric = light * extent**SOLID_ANGLE_EXPONENT + uniform * extent  # by which `choose_tiles` splits them
    num_split = min(len(inner), max(0, num - 8) // 3)
    return highest(tiles.codes, inner[np.argsort(-metric, kind="stable")[:num_split]])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def see_parts(visible, group, share, start, stop, seen):  # type: ignore[no-untyped-def]
    """Sum up how much of each merged triangle's light comes from parts that points [start, stop) see.

    Args:
        visible: part m of a point in bit m & 7 of byte m >> 3. (n, bytes) uint8
        group, share: see `Parts`. seen: written, points last: they are done together. (C, ≥ stop - start) float32
    """
    num = stop - start
    bits = np.empty(num, np.uint8)
    seen[:, :num] = 0
    for byte in range(visible.shape[1]):
        any_bit = np.uint8(0)
        for p in range(num):
            bits[p] = visible[start + p, byte]
            any_bit |= bits[p]
        if any_bit == 0:  # many in a row are hidden from neighbours
            continue
        for m in range(8 * byte, min(8 * byte + 8, group.shape[0])):
            of_group, of_part, shift = np.uint64(group[m]), share[m], np.uint8(m & 7)
            for p in range(num):
                seen[of_group, p] += np.float32((bits[p] >> shift) & np.uint8(1)) * of_part


def see_parts_numpy(visible: NDArray[np.uint8], parts: Parts, num: int) -> F64:
    """Do as `see_parts` for all points, in plain NumPy: its oracle.

    Args:
        visible: bits of all parts. (n, bytes) uint8
        parts: which merged triangle each is of, and its share. num: of merged triangles, C.
    Returns:
        (n, C)
    """
    bits = np.unpackbits(visible, axis=1, count=len(parts.group), bitorder="little")
    shares = np.zeros((len(parts.group), num))
    shares[np.arange(len(parts.group)), parts.group] = parts.share
    return np.asarray(bits @ shares)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def weigh_by_parts(first, light, seen, shading):  # type: ignore[no-untyped-def]
    """Weigh what listed merged lights bring by the share that is seen of them.

    Args:
        first, light: from `relume.project.light_culling.list_lights`. seen: from `see_parts`. (C, ≥ points)
        shading: of each entry, multiplied. (1 or 3, K) float32
    """
    for p in range(first.shape[0] - 1):
        for row in range(shading.shape[0]):
            for entry in range(first[p], first[p + 1]):
                shading[row, entry] *= seen[light[entry], p]
