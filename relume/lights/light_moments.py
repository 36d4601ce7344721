"""First and second moments of the light in tiles, each in the tangent plane of the sphere at the tile's light.

    x = d · t / (d · n),   m = Σ w x,   S = Σ w (x − m)(x − m)ᵀ + Σ w Ω / 12

d is the direction of a texel, n the mean direction of its tile, t two tangents at n, and w the texel's fraction of the
tile's light. A texel adds its own variance, that of a square of its solid angle Ω.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT

F64 = NDArray[np.float64]


class LightTexels(NamedTuple):
    """The texels of an environment, or other small areas, and their tiles.

    Attributes:
        tile: tile index of each texel. luminous: luminance × solid angle. directions: unit.
        solid_angles: solid angles of the texels, sr.
    """

    tile: Shaped[NDArray[np.int32], " n"]
    luminous: Shaped[F64, " n"]
    directions: Shaped[F64, "n 3"]
    solid_angles: Shaped[F64, " n"]

    def sums(self, values: Shaped[F64, " n"], num_tiles: int) -> Shaped[F64, " M"]:
        """Sum values of texels over each of M tiles."""
        return np.asarray(np.bincount(self.tile, values, num_tiles), np.float64)


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _sum_moments(tile, luminous, directions, solid_angles, fitted_index, inverse_light, mean, frames, out):  # type: ignore[no-untyped-def]
    """Sum w x, w x xᵀ and w Ω of the texels of each fitted tile. out: added to. (F, 6)"""
    for n in range(tile.shape[0]):
        row = fitted_index[tile[n]]
        if row < 0:
            continue
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        height = x * mean[row, 0] + y * mean[row, 1] + z * mean[row, 2]
        u = (x * frames[row, 0, 0] + y * frames[row, 0, 1] + z * frames[row, 0, 2]) / height
        v = (x * frames[row, 1, 0] + y * frames[row, 1, 1] + z * frames[row, 1, 2]) / height
        weight = luminous[n] * inverse_light[row]
        out[row, 0] += weight * u
        out[row, 1] += weight * v
        out[row, 2] += weight * u * u
        out[row, 3] += weight * u * v
        out[row, 4] += weight * v * v
        out[row, 5] += weight * solid_angles[n]


def compute_moments(
    texels: LightTexels,
    total: Shaped[F64, " F"],
    mean: Shaped[F64, "F 3"],
    frames: Shaped[F64, "F 2 3"],
    fitted: Shaped[NDArray[np.intp], " F"],
) -> tuple[Shaped[F64, "F 2"], Shaped[F64, "F 2 2"]]:
    """Return m and S of some tiles.

    Args:
        texels: texels of all tiles. total: luminous light of each fitted tile. mean: mean direction n of each.
        frames: the two tangents t. fitted: indices of the tiles.
    """
    fitted_index = np.full(int(max(texels.tile.max(initial=-1), fitted.max(initial=-1))) + 1, -1, np.int32)
    fitted_index[fitted] = np.arange(len(fitted))
    sums = np.zeros((len(fitted), 6))
    tile, luminous, directions, solid_angles = map(np.ascontiguousarray, texels)
    _sum_moments(tile, luminous, directions, solid_angles, fitted_index, 1 / total, mean, frames, sums)
    (x, y), (xx, xy, yy, extent) = sums.T[:2], sums.T[2:]
    texel_variance = extent / 12
    return sums[:, :2], np.stack(
        [xx - x * x + texel_variance, xy - x * y, xy - x * y, yy - y * y + texel_variance], axis=1
    ).reshape(-1, 2, 2)
