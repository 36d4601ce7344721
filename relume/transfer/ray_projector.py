"""The projector's other half: light that arrives along rays, from gather cells and from local lights.

R(x) = Σ_r w_r L_r q(x, ω_r) Π_f curve_f(angle_f(x, ω_r)),   w_r = cos θi over the density of rays
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.transfer.contraction import Contraction
from relume.transfer.ray_kernel import project_rays
from relume.transfer.receivers import Listed, Receivers

F32 = NDArray[np.float32]


class RayProjector:
    """Adds the rays of points to what a projector has made of its lights; holds the scratch memory of one thread.

    Args:
        capacity: points of the largest range.
    """

    def __init__(self, term: Term, contraction: Contraction, points: Receivers, capacity: int) -> None:
        self._term, self._contraction, self._points = term, contraction, points
        self._rays = [rays.times(contraction.constant) for rays in points.rays]
        most = capacity * max((rays.rays_a_point for rays in points.rays), default=0)
        self._listed = Listed(np.empty(capacity + 1, np.int64), *np.empty((3, 3, most), np.float32))

    def add(self, start: int, stop: int, out: F32) -> None:
        """Add points [start, stop) to `out`, laid out as `project_rays` has it."""
        c, listed = self._contraction, self._listed
        for rays in self._rays:
            num = rays.list_into(listed, self._points, start, stop)
            shading = self._term.quotients(*listed.wi[:, :num], *listed.wo[:, :num])
            project_rays(
                *listed, shading,
                c.kinds, c.axes, c.num_bands, c.bands, c.num_rows, c.settings, c.setting_of, c.active, out,
            )  # fmt: skip
