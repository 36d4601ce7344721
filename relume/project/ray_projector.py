"""The projector's other half: light that arrives along rays, from gather cells and from local lights.

R(x) = Σ_r w_r L_r q(x, ω_r) Π_f curve_f(angle_f(x, ω_r)),   w_r = cos θi over the density of rays
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.project.contraction import Contraction
from relume.project.lambertian import uprights
from relume.project.ray_kernel import project_rays, sum_rays, weigh_rays
from relume.project.receivers import GatherRays, Listed, Rays, Receivers, is_lamp
from relume.sharing import Sharing

F32 = NDArray[np.float32]


class RayProjector:
    """Adds the rays of points to what a projector has made of its lights; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        points: where the rays arrive. capacity: points that are listed at once.
    """

    def __init__(self, term: Term, contraction: Contraction, points: Receivers, capacity: int) -> None:
        self._term, self._contraction, self._points, self._capacity = term, contraction, points, capacity
        most = capacity * max((rays.rays_a_point for rays in points.rays), default=0)
        self._listed = Listed(np.empty(capacity + 1, np.int64), *np.empty((3, 3, most), np.float32))

    def add(self, start: int, stop: int, out: F32) -> None:
        """Add points [start, stop) to `out`, laid out as `project_rays` has it."""
        arrived = np.zeros_like(out)
        for rays in self._points.rays:
            if is_lamp(rays, self._contraction.kinds.size):
                continue  # it is listed as triangles
            if isinstance(rays, GatherRays) and rays.sharing is not None:
                self._add_shared(rays, rays.sharing, start, stop, arrived)
            else:
                self._add(rays, self._points, start, stop, arrived)
        out += self._contraction.constant[:, None] * arrived

    def _add_shared(self, rays: GatherRays, sharing: Sharing, start: int, stop: int, out: F32) -> None:
        """Add what points have of their own rays and of their neighbours'."""
        rings, among = sharing.of(self._term).rings(start, stop)
        arrived = np.zeros((len(among), *out.shape[1:]), np.float32)
        self._add(rays.alone(among), self._points.places(among), 0, len(among), arrived)
        shared = arrived.reshape(len(among), -1)
        for within in reversed(rings):
            shared = within @ shared
        out += shared.reshape(out.shape)

    def _add(self, rays: Rays, points: Receivers, start: int, stop: int, out: F32) -> None:
        c = self._contraction
        if c.kinds.size == 0 and self._term.is_lambertian and isinstance(rays, GatherRays):
            out[:, :, 0] += uprights(self._term, points, start, stop)[:, None] * rays.sum(points, start, stop)
            return
        for first in range(start, stop, self._capacity):
            last = min(first + self._capacity, stop)
            shading, some = self._list(rays, points, first, last), out[first - start : last - start]
            if c.kinds.size == 0:
                sum_rays(self._listed.first, self._listed.irradiance, shading, some)
                continue
            project_rays(
                *self._listed, shading,
                c.kinds, c.axes, c.num_bands, c.bands, c.num_rows, c.settings, c.setting_of, c.active, some,
            )  # fmt: skip

    def weigh(self, start: int, stop: int) -> F32:
        """Weigh what each ray of points [start, stop) brings, all curves contracted. (3, rays) float32"""
        c, found = self._contraction, []
        for rays in self._points.rays:
            shading = self._list(rays, self._points, start, stop)
            found.append(np.empty((3, shading.shape[1]), np.float32))
            listed = self._listed
            weigh_rays(
                listed.first[: stop - start + 1], listed.wi, listed.wo, listed.irradiance, shading,
                c.kinds, c.axes, c.num_bands, c.bands, c.num_rows, c.setting_of, found[-1],
            )  # fmt: skip
        return np.concatenate(found, axis=1) * c.constant[:, None]

    def _list(self, rays: Rays, points: Receivers, start: int, stop: int) -> F32:
        """List rays of points; returns the term's quotients. (1 or 3, rays)"""
        listed = self._listed
        num = rays.list_into(listed, points, start, stop)
        return np.asarray(self._term.quotients(*listed.wi[:, :num], *listed.wo[:, :num]))
