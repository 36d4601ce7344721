"""Terms that know of no direction but above and below, under the environment: all lights at once, seen or not.

    R(x) = q(x) Σ_m V(x, m) L_m Ω_m cos θi

To multiply by a zero of a light that is not seen costs less than to list those that are.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.numba_options import UNCOUNTED
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ZERO = np.float32(0)


def diffuse_quotients(term: Term, receivers: ShadingPoints, start: int, stop: int) -> F32:
    """Evaluate the quotients of a Lambertian term, which know of no direction but above and below.

    Args:
        term: the term. receivers: of which [start, stop) are asked.
    Returns:
        (stop - start,) float32
    """
    cos_theta_o = np.einsum("nc,nc->n", receivers.normal[start:stop], receivers.wo[start:stop])
    zeros = np.zeros_like(cos_theta_o)
    return np.asarray(term.quotients(zeros, zeros, zeros + 1, zeros, zeros, cos_theta_o)[0])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _sum_point(n_x, n_y, n_z, bits, x, y, z, red, green, blue, weight, out):  # type: ignore[no-untyped-def]
    """Sum the lights of a point: a function of its own, whose loops are vectors. weight: scratch. (M,)"""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def sum_lights(normal, visible, direction, irradiance, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the lights that points [start, stop) see.

    Args:
        normal: of all points. (n, 3) float32. visible: as in `ShadingPoints`. (n, bytes) uint8
        direction, irradiance: of the lights. (3, M) float32
        out: Σ V L Ω cos θi, written. (stop - start, 3) float32
    """
    _sum(normal, visible, direction, irradiance, start, stop, np.empty(direction.shape[1], np.float32), out)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _sum(normal, visible, direction, irradiance, start, stop, weight, out):  # type: ignore[no-untyped-def]
    """Do what `sum_lights` is for. weight: scratch. (M,)"""
    x, y, z = direction[0], direction[1], direction[2]
    red, green, blue = irradiance[0], irradiance[1], irradiance[2]
    for p in range(start, stop):
        _sum_point(
            normal[p, 0], normal[p, 1], normal[p, 2], visible[p], x, y, z, red, green, blue, weight, out[p - start]
        )


class DiffuseProjector:
    """Shades points of a Lambertian term whose curves are flat.

    Args:
        term: the term. constant: product of its curves. (3,) float32. lights: of the environment.
    """

    def __init__(self, term: Term, constant: F32, lights: TriangleLights) -> None:
        self._term = term
        self._direction = np.ascontiguousarray(lights.direction.T)
        self._irradiance = np.ascontiguousarray((lights.irradiance * constant).T)

    def shade(self, receivers: ShadingPoints, start: int, stop: int) -> F32:
        """Shade receivers [start, stop). (stop - start, 3) float32"""
        out = np.zeros((stop - start, 3), np.float32)
        if self._direction.shape[1]:  # else no bits were read
            sum_lights(receivers.normal, receivers.visible, self._direction, self._irradiance, start, stop, out)
        return out * diffuse_quotients(self._term, receivers, start, stop)[:, None]
