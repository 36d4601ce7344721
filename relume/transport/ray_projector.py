"""Projection of light along rays, from patches and from local lights.

R(x) = Σ_r w_r L_r q(x, ω_r) Π_f curve_f(angle_f(x, ω_r)),   w_r = cos θi / pdf of the rays
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.patches.neighbor_filter import NeighborFilter
from relume.transport.diffuse_projector import diffuse_quotients, is_constant
from relume.transport.ray_kernel import allocate_scratch, project_rays, sum_rays, weight_rays
from relume.transport.shading_points import GatherRays, RayList, ShadingPoints, allocate_list, is_area_light
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]


class RayProjector:
    """Adds the light of rays to the output of a projector; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        receivers: points with rays. capacity: maximum number of points listed at once.
    """

    def __init__(self, term: Term, contraction: Contraction, receivers: ShadingPoints, capacity: int) -> None:
        self._term, self._contraction, self._receivers, self._capacity = term, contraction, receivers, capacity
        max_rays = max((rays.max_rays_per_point for rays in receivers.rays), default=0)
        self._listed = allocate_list(capacity, capacity * max_rays)
        self._scratch = allocate_scratch(contraction.kinds.size, max_rays, contraction.settings.shape[2])

    def add(self, start: int, stop: int, out: Shaped[F32, "m 3 columns"]) -> None:
        """Add points [start, stop) to `out`; see `project_rays` for its layout."""
        radiance = np.zeros_like(out)
        for rays in self._receivers.rays:
            if is_area_light(rays, self._contraction.kinds.size):
                continue  # listed as triangles
            if isinstance(rays, GatherRays) and rays.sharing is not None:
                self._add_shared(rays, rays.sharing, start, stop, radiance)
            else:
                self._add(rays, self._receivers, start, stop, radiance)
        out += self._contraction.constant[:, None] * radiance

    def _add_shared(self, rays: GatherRays, sharing: NeighborFilter, start: int, stop: int, out: F32) -> None:
        """Add the light of points' own rays and of their neighbors' rays."""
        weights, rows = sharing.weights_and_neighbors(self._term, start, stop)
        radiance = np.zeros((len(rows), *out.shape[1:]), np.float32)
        self._add(rays.unshared(rows), self._receivers.without_light(rows), 0, len(rows), radiance)
        out += (weights @ radiance.reshape(len(rows), math.prod(out.shape[1:]))).reshape(out.shape)

    def _add(self, rays: RayList, receivers: ShadingPoints, start: int, stop: int, out: F32) -> None:
        c = self._contraction
        if is_constant(self._term, c) and isinstance(rays, GatherRays):
            out[:, :, 0] += diffuse_quotients(self._term, receivers, start, stop)[:, None] * rays.sum(
                receivers, start, stop
            )
            return
        for first in range(start, stop, self._capacity):
            last = min(first + self._capacity, stop)
            shading, block_out = self._list(rays, receivers, first, last), out[first - start : last - start]
            if c.kinds.size == 0:
                sum_rays(self._listed.first, self._listed.irradiance, shading, block_out)
                continue
            project_rays(self._listed, shading, c, self._scratch, block_out)

    def weight_rays(self, start: int, stop: int) -> Shaped[F32, "3 rays"]:
        """Return the contribution of each ray of points [start, stop), with all curves contracted."""
        c, ray_weights = self._contraction, []
        for rays in self._receivers.rays:
            shading = self._list(rays, self._receivers, start, stop)
            ray_weights.append(np.empty((3, shading.shape[1]), np.float32))
            weight_rays(self._listed, stop - start, shading, c, self._scratch, ray_weights[-1])
        return np.concatenate(ray_weights, axis=1) * c.constant[:, None]

    def _list(self, rays: RayList, receivers: ShadingPoints, start: int, stop: int) -> F32:
        """List rays of points; return the term's quotients. (1 or 3, rays)"""
        num = rays.list_into(self._listed, receivers, start, stop)
        return np.asarray(self._term.quotients(*self._listed.wi[:, :num], *self._listed.wo[:, :num]))
