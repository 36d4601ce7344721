"""Light triangles merged into a few larger ones, for operators that are to be there soon.

Tiles are leaves of a hierarchy; merged are those under an inner node that a coarser division would not have split.
What a point sees of a merged triangle is the share of its light that comes from the parts it sees
(docs/adr/0089-operators-of-merged-lights.md).
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.tiles import SOLID_ANGLE_EXPONENT, UNIFORM_SHARE, Tiles, solid_angles
from relume.light.triangles import Parts, Texels, TriangleLights, matched, nodes_of

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_MERGED, _FEWEST = 8, 400  # lights that are merged into one; merged ones
_FIRST_INNER = 32  # codes of tiles below are octants


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
    corners = lights.nodes[:, :3].transpose(2, 1, 0).astype(np.float64)
    parts = Texels(group.astype(np.int32), luminous, lights.direction.astype(np.float64), solid_angles(corners))
    its_corners, mean = matched(Tiles(codes).corners, parts)
    total = parts.sums(luminous, len(codes))
    irradiance = np.stack([parts.sums(light, len(codes)) for light in lights.irradiance.T.astype(np.float64)], axis=1)
    share = np.divide(luminous, total[group], out=np.zeros_like(luminous), where=luminous > 0)
    its_parts = Parts(group.astype(np.int32), share.astype(np.float32))
    return TriangleLights(nodes_of(its_corners), mean.astype(np.float32), irradiance.astype(np.float32), its_parts)


def _coarser(tiles: Tiles, luminous: F64, num: int) -> Codes:
    """Find the tile of a division into about `num` that each tile is in. (M,)

    A node's metric is never below that of its children, so the nodes that are split are those of the largest metrics.
    """
    inner, metric = _inner_nodes(tiles, luminous)
    num_split = min(len(inner), max(0, num - 8) // 3)
    split = inner[np.argsort(-metric, kind="stable")[:num_split]]
    found = tiles.codes.copy()
    while True:
        rises = (found >= _FIRST_INNER) & ~np.isin(found >> np.uint64(2), split)
        if not rises.any():
            return found
        found[rises] >>= np.uint64(2)


def _inner_nodes(tiles: Tiles, luminous: F64) -> tuple[Codes, F64]:
    """Find the inner nodes of the hierarchy, and the metric by which `choose_tiles` splits them."""
    uniform = UNIFORM_SHARE * float(luminous.sum()) / (4 * np.pi)
    above, light, extent = tiles.codes, luminous, tiles.solid_angles
    codes, sums = [], []
    while (is_deeper := above >= _FIRST_INNER).any():
        above, light, extent = above[is_deeper] >> np.uint64(2), light[is_deeper], extent[is_deeper]
        codes.append(above)
        sums.append(np.stack([light, extent]))
    if not codes:
        return np.empty(0, np.uint64), np.empty(0)
    nodes, place = np.unique(np.concatenate(codes), return_inverse=True)
    of_all = np.concatenate(sums, axis=1)
    light, extent = (np.bincount(place, values, len(nodes)).astype(np.float64) for values in of_all)
    return nodes, light * extent**SOLID_ANGLE_EXPONENT + uniform * extent


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


@nb.njit(nogil=True, cache=True)
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
