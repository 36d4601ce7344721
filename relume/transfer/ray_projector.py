"""The projector's other half: light that arrives by reflection, along gather rays.

R(x) = Σ_r w_r L(link_r) q(x, ω_r) Π_f curve_f(angle_f(x, ω_r)),   w_r = cos θi over the density of rays
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.transfer.contraction import Contraction
from relume.transfer.ray_kernel import list_rays, project_rays
from relume.transfer.receivers import GatherRays, Receivers

F32 = NDArray[np.float32]


class RayProjector:
    """Adds the rays of points to what a projector has made of its lights; holds the scratch memory of one thread.

    Args:
        capacity: points of the largest range.
    """

    def __init__(
        self,
        term: Term,
        contraction: Contraction,
        points: Receivers,
        rays: GatherRays,
        capacity: int,
    ) -> None:
        self._term, self._contraction, self._points, self._rays = term, contraction, points, rays
        self._radiance = rays.radiance * contraction.constant
        self._first = np.empty(capacity + 1, np.int64)
        self._wi, self._wo, self._power = np.empty((3, 3, capacity * rays.links.shape[1]), np.float32)

    def add(self, start: int, stop: int, out: F32) -> None:
        """Add points [start, stop) to `out`, laid out as `project_rays` has it."""
        c, points, rays = self._contraction, self._points, self._rays
        first, wi, wo, power = self._first, self._wi, self._wo, self._power
        num = list_rays(
            points.normal, points.tangent, points.wo, rays.links, rays.pattern, rays.numbers, self._radiance,
            start, stop, first, wi, wo, power,
        )  # fmt: skip
        shading = self._term.quotients(*wi[:, :num], *wo[:, :num])
        project_rays(
            first, wi, wo, power, shading,
            c.kinds, c.axes, c.num_bands, c.bands, c.num_rows, c.settings, c.setting_of, c.active, out,
        )  # fmt: skip
