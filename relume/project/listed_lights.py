"""The lights of a few points at a time, as projectors want them: listed, turned, weighed by the quotient."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.light.triangles import TriangleLights
from relume.project.contraction import Contraction
from relume.project.light_culling import list_lights
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]

POINTS_A_BLOCK = 48  # directions of a block stay in a core's second-level cache


class ListedLights:
    """Lists the lights of blocks of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        lights: triangles of the environment; `receivers` tell which of them each point sees.
        receivers: all points, and what arrives at them.

    Attributes:
        irradiance: of the lights, times curves that are the same everywhere. (M, 3)
        first, light: written by `list`, see `list_lights`.
    """

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: Receivers) -> None:
        self._term, self._contraction, self._lights, self._receivers = term, contraction, lights, receivers
        self.irradiance = lights.irradiance * contraction.constant
        # radians
        self._support = contraction.support * np.float32(np.pi / 2) / contraction.num_bands.astype(np.float32)
        capacity = POINTS_A_BLOCK * lights.num_lights
        self.first = np.empty(POINTS_A_BLOCK + 1, np.int64)
        self.light = np.empty(capacity + 1, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)

    def list(self, start: int, stop: int) -> tuple[F32, F32]:
        """List the lights of points [start, stop), a block of them at most.

        Returns:
            q cos θi of each entry (1 or 3, K), and the local wo (3, K) that it belongs to.
        """
        r, lights = self._receivers, self._lights
        num = list_lights(
            r.normal, r.tangent, r.wo, r.visible, lights.direction, lights.radius, self._contraction.kinds,
            self._support, start, stop, self.first, self.light, self._wi, self._wo,
        )  # fmt: skip
        wi, wo = self._wi[:, :num], self._wo[:, :num]
        shading = self._term.quotients(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
        shading *= wi[2]
        return shading, wo
