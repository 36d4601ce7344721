"""Projector: bins the light that reaches a point along one free curve, with all other curves multiplied in.

    T_j(x) = Σ_m V(x, m) L_m Ω_m cos θi · q(x, ω_m) · Π_{f ≠ active} mean_m(f) · Δ_{m,j}

Eqs. 21, 22 and 25 combined with 26, Ben-Artzi 2006: U is never stored. Triangles over which an angle is not linear
(near its pole) are divided into four until it is (appendix A).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.simd import NUM as EIGHT
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.light_culling import ListedLights
from relume.transport.light_lists import POINTS_PER_BLOCK, AreaLightList, LightList, area_light_lists
from relume.transport.project_kernel import COARSE, FINE, make_scratch, project_points
from relume.transport.ray_projector import RayProjector
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]


class Projector:
    """Projects ranges of receivers under one contraction; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        lights: triangles of the environment. receivers: all points, with their visibility and rays.
    """

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: ShadingPoints) -> None:
        self._contraction, self._lights, self._receivers = contraction, lights, receivers
        self._light_list = LightList(term, contraction, lights, receivers)
        self._rays = RayProjector(term, contraction, receivers, POINTS_PER_BLOCK)
        self._area_lights = area_light_lists(term, contraction, receivers)
        max_lights = max([lights.num_lights, *(area_light.max_triangles_per_point for area_light in self._area_lights)])
        self._fine = FINE if lights.parts is None else COARSE
        self._scratch = make_scratch(contraction.kinds.size, max_lights, contraction.settings.shape[2])

    def project(self, start: int, stop: int) -> Shaped[F32, "m columns 3"]:
        """Return the transport of points [start, stop): in J bands of the free curve, or in N settings without one."""
        c = self._contraction
        num_padded = c.num_columns + EIGHT if c.active >= 0 else -(-c.num_settings // EIGHT) * EIGHT
        out = np.zeros((stop - start, 3, num_padded), np.float32)
        for block in range(start, stop, POINTS_PER_BLOCK):
            end = min(block + POINTS_PER_BLOCK, stop)
            self._block(block, end, out[block - start : end - start])
        self._rays.add(start, stop, out)
        for area_light in self._area_lights:
            self._add_area_light(area_light, start, stop, out)
        return out[:, :, : c.num_columns].transpose(0, 2, 1)

    def _add_area_light(self, area_light: AreaLightList, start: int, stop: int, out: F32) -> None:
        for block in range(start, stop, area_light.points_per_block):
            end = min(block + area_light.points_per_block, stop)
            shading, num = area_light.list(block, end)
            nodes = np.ascontiguousarray(area_light.triangles.nodes[:num].transpose(2, 1, 0))
            irradiance = np.ascontiguousarray(area_light.triangles.irradiance_radius[:num, :3])
            light_args = area_light.listed, shading, nodes, irradiance
            self._project(light_args, block, end, out[block - start : end - start])

    def _block(self, start: int, stop: int, out: F32) -> None:
        light_list = self._light_list
        shading = light_list.list(start, self._receivers.visible[start:stop])
        self._project((light_list.listed, shading, self._lights.nodes, light_list.irradiance), start, stop, out)

    def _project(self, light_args: tuple[ListedLights, F32, F32, F32], start: int, stop: int, out: F32) -> None:
        """Project a block. light_args: `listed` to `irradiance` of `project_points`."""
        block_args = self._contraction, self._fine, start, stop, self._scratch, out
        project_points(self._receivers.points, *light_args, *block_args)
