"""Groups of lights that points see entirely, shaded as one light each.

If a group's curves vary too much within it, its lights are shaded individually. A group outside the support of a fixed
curve contributes nothing. Neither are groups shaded as one light where they share their light with lobe rays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.core.bit_matrix import rows_to_words, words_to_rows
from relume.lights.spherical_triangles import LightClusters
from relume.transport.light_lists import LightList
from relume.transport.lobe_rays import LobeRays, find_lobe_rays
from relume.transport.shading.group_kernel import add_groups, restore_shared, select_groups
from relume.transport.shading.light_list_kernel import TriangleTable, allocate_scratch
from relume.transport.shading_points import ShadingPoints
from relume.transport.term_contraction import Contraction, WholeCurves

F32 = NDArray[np.float32]
Bits = NDArray[np.uint8]


class GroupedLights:
    """Shades groups of lights at blocks of receivers; holds the scratch memory of one thread.

    Args:
        term, contraction, receivers: as in `relume.transport.shading.shader.Shader`. curves: of the contraction.
        groups: of the lights. num_lights: number of individual lights.
    """

    def __init__(
        self,
        term: Term,
        contraction: Contraction,
        curves: WholeCurves,
        groups: LightClusters,
        num_lights: int,
        receivers: ShadingPoints,
    ) -> None:
        self._receivers, self._curves, self._groups = receivers, curves, groups
        self._light_list = LightList(term, contraction, groups.lights, replace(receivers, rays=()))
        self._lobe_rays = _rays_of_groups(receivers, groups)
        self._scratch = allocate_scratch(curves, groups.lights.num_lights, has_groups=True)
        self._visibility_words, self._whole = (
            np.empty(num_lights, np.uint64),
            np.empty(groups.lights.num_lights, np.uint64),
        )

    def add(self, start: int, stop: int, out: Shaped[F32, "m 3 1"]) -> Shaped[Bits, "m bytes"]:
        """Add groups to points [start, stop), at most a block.

        Args:
            out: added to.
        Returns:
            Visibility of the lights that remain to be shaded, as in `ShadingPoints`.
        """
        r, groups, light_list = self._receivers, self._groups, self._light_list
        remaining = np.empty_like(r.visible[start:stop])
        whole = np.empty((stop - start, (len(self._whole) + 7) // 8), np.uint8)
        rows_to_words(r.visible[start:stop], self._visibility_words)
        select_groups(self._visibility_words, groups.first, groups.light_index, self._whole)
        words_to_rows(self._visibility_words, remaining)
        words_to_rows(self._whole, whole)
        shading = light_list.list(start, whole)
        if self._lobe_rays is not None:
            share, group_lights = np.ones((1, shading.shape[1]), np.float32), (groups.first, groups.light_index)
            listed_args = start, stop - start, light_list.listed, share
            self._lobe_rays.share_triangles(groups.lights, r, *listed_args)
            restore_shared(light_list.listed, share[0], *group_lights, stop - start, remaining, shading)
        table = TriangleTable(groups.lights.nodes_by_light, light_list.irradiance_radius, groups.between_variance)
        group_args = table, (groups.first, groups.light_index), self._curves, start, stop, self._scratch
        add_groups(r.points, light_list.listed, shading, *group_args, remaining, out)
        return remaining


def _rays_of_groups(receivers: ShadingPoints, groups: LightClusters) -> LobeRays | None:
    """Return the lobe rays of points for the share of groups, that of their largest light; None without lobe rays."""
    rays = find_lobe_rays(receivers)
    if rays is None:
        return None
    largest = np.maximum.reduceat(rays.environment.solid_angle[groups.light_index], groups.first[:-1])
    return replace(rays, environment=rays.environment._replace(solid_angle=largest))
