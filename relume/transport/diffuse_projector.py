"""Lambertian terms under the environment: all lights are summed, occluded or not.

    R(x) = q(x) Σ_m V(x, m) L_m Ω_m cos θi

Multiplying by V = 0 costs less than listing the visible lights.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ZERO = np.float32(0)


def diffuse_quotients(term: Term, receivers: ShadingPoints, start: int, stop: int) -> Shaped[F32, " m"]:
    """Quotients of a Lambertian term at points [start, stop) of `receivers`; they depend only on the side of ωo."""
    cos_theta_o = np.einsum("nc,nc->n", receivers.normal[start:stop], receivers.wo[start:stop])
    zeros = np.zeros_like(cos_theta_o)
    return np.asarray(term.quotients(zeros, zeros, zeros + 1, zeros, zeros, cos_theta_o)[0])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _sum_point(n, bits, direction, irradiance, weight, out):  # type: ignore[no-untyped-def]
    """Sum the lights of a point; a separate function so that its loops are vectorized. weight: scratch. (M,)"""
    (x, y, z), (red, green, blue) = direction, irradiance
    n_x, n_y, n_z = n[0], n[1], n[2]
    for m in range(weight.shape[0]):
        weight[m] = np.float32((np.int32(bits[m >> 3]) >> np.int32(m & 7)) & np.int32(1))
    for m in range(weight.shape[0]):
        weight[m] *= max(n_x * x[m] + n_y * y[m] + n_z * z[m], _ZERO)
    r = g = b = _ZERO
    for m in range(weight.shape[0]):
        r += weight[m] * red[m]
    for m in range(weight.shape[0]):
        g += weight[m] * green[m]
    for m in range(weight.shape[0]):
        b += weight[m] * blue[m]
    out[0], out[1], out[2] = r, g, b


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_lights(normal, visible, direction, irradiance, start, stop, weight, out):  # type: ignore[no-untyped-def]
    """Sum the visible lights of points [start, stop).

    Args:
        normal: of all points. (n, 3) float32. visible: as in `ShadingPoints`. (n, bytes) uint8
        direction, irradiance: of the lights. (3, M) float32. weight: scratch. (M,)
        out: Σ V L Ω cos θi, written. (stop - start, 3) float32
    """
    by_axis, by_channel = (direction[0], direction[1], direction[2]), (irradiance[0], irradiance[1], irradiance[2])
    for p in range(start, stop):
        _sum_point(normal[p], visible[p], by_axis, by_channel, weight, out[p - start])


class DiffuseProjector:
    """Shades points of a Lambertian term with constant curves.

    Args:
        term: the term. constant: product of its curves. lights: lights of the environment.
    """

    def __init__(self, term: Term, constant: Shaped[F32, " 3"], lights: TriangleLights) -> None:
        self._term = term
        self._direction = np.ascontiguousarray(lights.direction.T)
        self._irradiance = np.ascontiguousarray((lights.irradiance * constant).T)

    def shade(self, receivers: ShadingPoints, start: int, stop: int) -> Shaped[F32, "m 3"]:
        """Return the reflected radiance of receivers [start, stop)."""
        out = np.zeros((stop - start, 3), np.float32)
        if self._direction.shape[1]:  # without lights no visibility is stored
            light_args, weight = (self._direction, self._irradiance), np.empty(self._direction.shape[1], np.float32)
            sum_lights(receivers.normal, receivers.visible, *light_args, start, stop, weight, out)
        return out * diffuse_quotients(self._term, receivers, start, stop)[:, None]
