"""First and second moments of the light in tiles, each in the plane that touches the sphere where the tile's light is.

    x = d · t / (d · n),   m = Σ w x,   S = Σ w (x − m)(x − m)ᵀ + Σ w Ω / 12

with d the direction of a texel, n the mean one of its tile, t two directions across n, and w the texel's share of the
tile's light. A texel is no point: its own extent counts, as that of a square of its solid angle Ω.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.uncounted import UNCOUNTED

F64 = NDArray[np.float64]


class Texels(NamedTuple):
    """The texels of an environment, or other small places, and the tiles they lie in.

    Attributes:
        tile: that each lies in. (n,) luminous: luminance × solid angle. (n,) directions: unit. (n, 3)
        solid_angles: (n,)
    """

    tile: NDArray[np.int32]
    luminous: F64
    directions: F64
    solid_angles: F64

    def sums(self, values: F64, num_tiles: int) -> F64:
        """Sum values (n,) over the texels of each of M tiles. (M,)"""
        return np.asarray(np.bincount(self.tile, values, num_tiles), np.float64)


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _sum(tile, luminous, directions, solid_angles, place_of, per, mean, frames, out):  # type: ignore[no-untyped-def]
    """Sum w x, w x xᵀ and w Ω of the texels of each fitted tile. out: added to. (F, 6)"""
    for n in range(tile.shape[0]):
        place = place_of[tile[n]]
        if place < 0:
            continue
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        height = x * mean[place, 0] + y * mean[place, 1] + z * mean[place, 2]
        u = (x * frames[place, 0, 0] + y * frames[place, 0, 1] + z * frames[place, 0, 2]) / height
        v = (x * frames[place, 1, 0] + y * frames[place, 1, 1] + z * frames[place, 1, 2]) / height
        weight = luminous[n] * per[place]
        out[place, 0] += weight * u
        out[place, 1] += weight * v
        out[place, 2] += weight * u * u
        out[place, 3] += weight * u * v
        out[place, 4] += weight * v * v
        out[place, 5] += weight * solid_angles[n]


def moments_of(texels: Texels, total: F64, mean: F64, frames: F64, fitted: NDArray[np.intp]) -> tuple[F64, F64]:
    """Find m and S of some tiles.

    Args:
        texels: of all tiles. total: luminous light of each fitted tile. (F,)
        mean: its direction n. (F, 3) frames: the two directions t across it. (F, 2, 3)
        fitted: the tiles in question. (F,)
    Returns:
        m (F, 2) and S (F, 2, 2)
    """
    place_of = np.full(int(max(texels.tile.max(initial=-1), fitted.max(initial=-1))) + 1, -1, np.int32)
    place_of[fitted] = np.arange(len(fitted))
    sums = np.zeros((len(fitted), 6))
    tile, luminous, directions, solid_angles = map(np.ascontiguousarray, texels)
    _sum(tile, luminous, directions, solid_angles, place_of, 1 / total, mean, frames, sums)
    (x, y), (xx, xy, yy, extent) = sums.T[:2], sums.T[2:]
    own = extent / 12
    return sums[:, :2], np.stack([xx - x * x + own, xy - x * y, xy - x * y, yy - y * y + own], axis=1).reshape(-1, 2, 2)


def moments_numpy(texels: Texels, mean: F64, frame: F64, tile: int) -> tuple[F64, F64]:
    """Do as `moments_of` for one tile, in plain NumPy: its oracle.

    Args:
        texels: of all tiles. mean: n of this one. (3,) frame: its t. (2, 3) tile: its number.
    """
    _, luminous, directions, solid_angles = (each[texels.tile == tile] for each in texels)
    share = luminous / luminous.sum()
    position = directions @ frame.T / (directions @ mean)[:, None]
    centre = share @ position
    off = position - centre
    return centre, np.einsum("n,ni,nj->ij", share, off, off) + np.eye(2) * (share @ solid_angles) / 12
