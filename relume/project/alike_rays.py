"""Light vectors of what cells send to points whose gather rays go alike, quickly.

    t_k(x) = Σ_r w_r h_k(ω_r) L(link(x, r), −ω_r)

Where all points have one seed, ray r leaves each of them in the same local direction, and weighs the same.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import in_basis, num_functions
from relume.light.gather_rays import Pattern, local_ray, small_shifts_of, weight_of
from relume.parallel import for_shares
from relume.project.sent import Sent, light_along
from relume.project.squares import Squares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]


def weighed_functions(pattern: Pattern, seed: int, degree: int) -> F32:
    """Evaluate w_r h_k(ω_r).

    Args:
        pattern: of the rays, all of them by the cosine. seed: of the points. degree: of the functions.
    Returns:
        (K, rays) float32
    """
    if pattern.num_cosine != pattern.num_rays:
        raise ValueError("glossy rays go elsewhere at every point")
    wi, weight = np.empty((pattern.num_rays, 3), np.float32), np.empty(pattern.num_rays, np.float32)
    _direct(pattern, np.uint32(seed), wi, weight)
    functions = in_basis(wi.astype(np.float64))[:, : num_functions(degree)]
    return np.ascontiguousarray((functions * weight[:, None]).T, np.float32)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _direct(pattern, seed, wi, weight):  # type: ignore[no-untyped-def]
    shifts, up = small_shifts_of(pattern, seed), np.float32(1)
    for ray in range(len(wi)):
        x, y, z = local_ray(pattern, ray, shifts, np.float32(0), np.float32(0), up)
        wi[ray, 0], wi[ray, 1], wi[ray, 2] = x, y, z
        weight[ray] = weight_of(pattern, x, y, z, np.float32(0), np.float32(0), up)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _gather(links, squares, rows, functions, sent, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the rays of points rows[start:stop]. out: (m, 3, K)"""
    num_functions, num_rays = functions.shape
    light = np.empty((3, num_rays), np.float32)
    red, green, blue = light
    for i in range(start, stop):
        light_along(sent, links[rows[i]], squares[rows[i]], light)
        for k in range(num_functions):
            r = g = b = np.float32(0)
            for ray in range(num_rays):
                value = functions[k, ray]
                r += value * red[ray]
                g += value * green[ray]
                b += value * blue[ray]
            out[i, 0, k], out[i, 1, k], out[i, 2, k] = r, g, b


def alike_ray_vectors(
    links: NDArray[np.uint16], squares: Squares, rows: NDArray[np.intp], functions: F32, sent: Sent
) -> F32:
    """Find what rays bring to some points; `ray_vectors` is its oracle.

    Args:
        links: cell that each ray of all points hits. (n, rays) uint16
        squares: in which light leaves those cells, from `leaving_squares`. (n, rays) uint8
        rows: the points. (m,). functions: from `weighed_functions`. (K, rays) float32
        sent: by the cells.
    Returns:
        t. (m, 3, K) float32
    """
    out = np.empty((len(rows), 3, len(functions)), np.float32)
    args = (links, squares, rows, functions, sent)
    for_shares(lambda start, stop: _gather(*args, start, stop, out), len(rows))
    return out
