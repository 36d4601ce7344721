"""Mean of all texels of a BTF as a BRDF, for distant views and for indirect illumination."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid, interpolation_weights

F32 = NDArray[np.float32]

_LEAST_COSINE = 0.02  # lower bound of cos θi, the divisor of values


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _quotients(grid, average, cosine, sine, wi, wo, out):  # type: ignore[no-untyped-def]
    """wi, wo: (3, n). out: (3, n), written"""
    light, view = np.empty(4, np.int32), np.empty(4, np.int32)
    light_weight, view_weight = np.empty(4, np.float32), np.empty(4, np.float32)
    for p in range(wi.shape[1]):
        out[:, p] = 0
        iz, oz = wi[2, p], wo[2, p]
        if iz <= 0 or oz <= 0:
            continue
        ix, iy = cosine * wi[0, p] + sine * wi[1, p], cosine * wi[1, p] - sine * wi[0, p]
        ox, oy = cosine * wo[0, p] + sine * wo[1, p], cosine * wo[1, p] - sine * wo[0, p]
        cosine_ratio = interpolation_weights(grid, np.float32(ix), np.float32(iy), np.float32(iz), light, light_weight)
        interpolation_weights(grid, np.float32(ox), np.float32(oy), np.float32(oz), view, view_weight)
        for a in range(4):
            for b in range(4):
                weight = view_weight[a] * light_weight[b] * cosine_ratio / max(iz, _LEAST_COSINE)
                for channel in range(3):
                    out[channel, p] += weight * average[view[a], light[b], channel]


def mean_brdf(
    grid: DirectionGrid,
    average: Shaped[F32, "n n 3"],
    rotation: float,
    *directions: NDArray[np.floating],
) -> Shaped[NDArray[np.floating], " 3 *batch"]:
    """The mean BRDF, 1/sr, without the cosine that a BTF's values include.

    Args:
        grid: grid of the directions. average: `LocalPcaBtf.average`. rotation: rotation of the texture, radians.
        directions: x, y, z of wi and of wo, local frame, unit, z = normal; they broadcast. (...) each
    Returns:
        In the type of the directions; zero at and below the horizon.
    """
    broadcast = np.broadcast_arrays(*directions)
    wi, wo = (np.ascontiguousarray([axis.ravel() for axis in broadcast[k : k + 3]]) for k in (0, 3))
    out = np.empty(wi.shape, wi.dtype)
    _quotients(grid, average, math.cos(rotation), math.sin(rotation), wi, wo, out)
    return out.reshape(3, *broadcast[0].shape)
