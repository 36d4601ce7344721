"""The projector: bins the light that reaches a point along one curve, every other curve multiplied in.

    T_j(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_{f ≠ active} mean_m(f) · Δ_{m,j}

Eqs. 21, 22 and 25 with 26 carried out at once, Ben-Artzi 2006: U is never stored. Triangles over which an angle is not
linear (near its pole) are divided into four until it is (appendix A).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.project.contraction import Contraction
from relume.project.eight_bands import NUM as EIGHT
from relume.project.light_culling import list_lights
from relume.project.project_kernel import project_points
from relume.project.ray_projector import RayProjector
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]

_POINTS_A_BLOCK = 48  # directions of a block stay in a core's second-level cache


class Projector:
    """Projects ranges of receivers under one contraction; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        lights: triangles of the environment; `receivers` tell which of them each point sees.
        receivers: all points, and what arrives at them.
    """

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: Receivers) -> None:
        self._term, self._contraction, self._lights, self._receivers = term, contraction, lights, receivers
        self._irradiance = lights.irradiance * contraction.constant
        # radians
        self._support = contraction.support * np.float32(np.pi / 2) / contraction.num_bands.astype(np.float32)
        capacity = _POINTS_A_BLOCK * lights.num_lights
        self._first = np.empty(_POINTS_A_BLOCK + 1, np.int64)
        self._light = np.empty(capacity + 1, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)
        self._rays = RayProjector(term, contraction, receivers, _POINTS_A_BLOCK)

    def project(self, start: int, stop: int) -> F32:
        """Project points [start, stop): their transport along the free curve, in its bands.

        Returns:
            (stop - start, J, 3) float32; with no free curve (stop - start, N, 3).
        """
        c = self._contraction
        num_padded = c.num_columns + EIGHT if c.active >= 0 else -(-c.num_settings // EIGHT) * EIGHT
        out = np.zeros((stop - start, 3, num_padded), np.float32)
        for block in range(start, stop, _POINTS_A_BLOCK):
            end = min(block + _POINTS_A_BLOCK, stop)
            self._block(block, end, out[block - start : end - start])
        self._rays.add(start, stop, out)
        return out[:, :, : c.num_columns].transpose(0, 2, 1)

    def _block(self, start: int, stop: int, out: F32) -> None:
        r, lights, c = self._receivers, self._lights, self._contraction
        num = list_lights(
            r.normal,
            r.tangent,
            r.wo,
            r.visible,
            lights.direction,
            lights.radius,
            c.kinds,
            self._support,
            start,
            stop,
            self._first,
            self._light,
            self._wi,
            self._wo,
        )
        wi, wo = self._wi[:, :num], self._wo[:, :num]
        shading = self._term.quotients(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
        shading *= wi[2]
        project_points(
            r.normal,
            r.tangent,
            self._first,
            self._light,
            shading,
            wo,
            lights.nodes,
            self._irradiance,
            c.kinds,
            c.axes,
            c.num_bands,
            c.bands,
            c.num_rows,
            c.settings,
            c.setting_of,
            c.support,
            c.active,
            start,
            stop,
            out,
        )
