"""Coefficients of points averaged over patches.

Function pairs of order m turn by m φ when the tangent turns by φ about the normal (`relume.math.zernike`).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.math.zernike import OUTGOING_DEGREE, recurrence
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.outgoing_patch_light import NUM_OUTGOING

F32 = NDArray[np.float32]

_LEAST_LENGTH = np.float32(1e-12)  # of a patch's tangent on a point's surface


def mean_coefficients(
    tangent: Shaped[F32, "G 3"], points: SurfacePoints, point_coefficients: Shaped[F32, "n 3 k"]
) -> Shaped[F32, "G 3 J"]:
    """Average the coefficients of points over patches, rotated to the frames of the patches.

    Args:
        tangent: of the patches. points: the same number per patch, patch by patch.
        point_coefficients: in the points' own frames, of any number of functions; those beyond J are left out.
    """
    out = np.zeros((len(tangent), 3, NUM_OUTGOING), np.float32)
    if not len(tangent):
        return out
    table = recurrence(OUTGOING_DEGREE)
    args = tangent, points.normal, points.tangent, point_coefficients, table.order, table.cosine, table.sine
    parallel_for_chunks(lambda start, stop: _average(*args, start, stop, out), len(tangent))
    return out


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def _average(patch_tangent, normal, tangent, coefficients, order, cosine, sine, start, stop, out):  # type: ignore[no-untyped-def]
    """Average the coefficients of patches [start, stop) into `out`."""
    points_per_patch, width = normal.shape[0] // patch_tangent.shape[0], coefficients.shape[2]
    weight = np.float32(1 / points_per_patch)
    for patch in range(start, stop):
        p = patch_tangent[patch]
        for point in range(patch * points_per_patch, (patch + 1) * points_per_patch):
            n, t = normal[point], tangent[point]
            along = p[0] * t[0] + p[1] * t[1] + p[2] * t[2]
            across = (
                p[0] * (n[1] * t[2] - n[2] * t[1])
                + p[1] * (n[2] * t[0] - n[0] * t[2])
                + p[2] * (n[0] * t[1] - n[1] * t[0])
            )
            length = np.float32(math.sqrt(along * along + across * across))
            is_defined = length > _LEAST_LENGTH
            x, y = (along / length, across / length) if is_defined else (np.float32(1), np.float32(0))
            m, power_x, power_y = 0, np.float32(1), np.float32(0)  # cos m φ and sin m φ, of ascending orders
            for row in range(order.shape[0]):
                while m < order[row]:
                    power_x, power_y, m = power_x * x - power_y * y, power_x * y + power_y * x, m + 1
                i, j = cosine[row], sine[row]
                if j >= width:
                    continue
                for channel in range(3):
                    of_cosine, of_sine = coefficients[point, channel, i], coefficients[point, channel, j]
                    out[patch, channel, i] += weight * (power_x * of_cosine + power_y * of_sine)
                    if i != j:
                        out[patch, channel, j] += weight * (power_x * of_sine - power_y * of_cosine)
