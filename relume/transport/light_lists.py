"""Lights of blocks of points for projectors: listed, in local frames, weighted by the quotient.

Triangles of the environment are the same for all points; the triangles of an area light differ from point to point.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Angle, Term
from relume.lights.light_clusters import visible_fraction, weight_by_visibility
from relume.lights.spherical_triangles import MergedParts, TriangleLights
from relume.transport.area_light_kernel import AreaLight, AreaTriangles, allocate_scratch, list_area_light
from relume.transport.light_culling import CurveSupport, ListedLights, allocate_list, list_lights
from relume.transport.lobe_rays import find_lobe_rays
from relume.transport.shading_points import LocalRays, ShadingPoints, is_area_light
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]
Bits = NDArray[np.uint8]

_TRIANGLES_PER_BLOCK = 4096  # of area lights, at least those of one point
POINTS_PER_BLOCK = 64  # bits of a word; directions of a block stay in a core's second-level cache

_HALF_PI = np.float32(np.pi / 2)


def with_half_angle(support: CurveSupport) -> CurveSupport:
    """Add a bound of the half angle if only two other angles of the half vector are bounded.

    cos θh = cos α cos β, and tan² θh = tan² x + tan² y of the two tilts. See `angle_lower_bounds`.
    """
    limit = {int(kind): float(angle) for kind, angle in zip(*support, strict=True) if angle < _HALF_PI}
    if Angle.ALPHA in limit and Angle.BETA in limit:
        bound = np.arccos(np.cos(limit[Angle.ALPHA]) * np.cos(limit[Angle.BETA]))
    elif Angle.TILT_X in limit and Angle.TILT_Y in limit:
        bound = np.arctan(np.hypot(np.tan(limit[Angle.TILT_X]), np.tan(limit[Angle.TILT_Y])))
    else:
        return support
    return CurveSupport(np.append(support.kinds, Angle.THETA_H), np.append(support.limit, np.float32(bound)))


def _curve_support(contraction: Contraction) -> CurveSupport:
    radians = np.asarray(contraction.support * _HALF_PI / contraction.num_bands, np.float32)
    return with_half_angle(CurveSupport(contraction.kinds, radians))


def _weighted_quotients(term: Term, listed: ListedLights, num: int) -> F32:
    """Return q cos θi of the first entries. (1 or 3, num)"""
    shading = term.quotients(*listed.wi[:, :num], *listed.wo[:, :num])
    shading *= listed.wi[2, :num]
    return shading


class LightList:
    """Lists the lights of blocks of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        lights: triangles of the environment. receivers: all points, with their visibility and rays.
        points_per_block: maximum number of points listed at once.

    Attributes:
        irradiance: of the lights, times constant curves. (M, 3)
        listed: written by `list`.
    """

    def __init__(
        self,
        term: Term,
        contraction: Contraction,
        lights: TriangleLights,
        receivers: ShadingPoints,
        points_per_block: int = POINTS_PER_BLOCK,
    ) -> None:
        self._term, self._lights, self._receivers = term, lights, receivers
        self._lobe_rays = find_lobe_rays(receivers)
        self.irradiance = lights.irradiance * contraction.constant
        self._support = _curve_support(contraction)
        self._visible_fraction = np.empty(
            (lights.num_lights if lights.parts is not None else 0, points_per_block), np.float32
        )
        self._scratch = np.empty((2, lights.num_lights), np.float32)
        self.listed = allocate_list(points_per_block, points_per_block * lights.num_lights)

    @cached_property
    def irradiance_radius(self) -> Shaped[F32, "M 4"]:
        """Irradiance and angular radius of the lights."""
        return np.concatenate([self.irradiance, self._lights.radius[:, None]], axis=1)

    def list(self, start: int, visible: Shaped[Bits, "n bytes"]) -> Shaped[F32, "channels K"]:
        """List the lights of points [start, start + n), at most a block.

        Args:
            visible: visibility of the lights, or of their parts, from these points, as in `ShadingPoints`.
        Returns:
            q cos θi of each entry (one row if all channels are equal).
        """
        r, lights, listed = self._receivers, self._lights, self.listed
        if lights.parts is not None:
            visible = self._visible_clusters(lights.parts, visible)
        light_args = lights.direction, lights.radius, self._support, start, self._scratch
        num = int(list_lights(r.points, r.wo, visible, *light_args, listed))
        shading = _weighted_quotients(self._term, listed, num)
        if lights.parts is not None:
            weight_by_visibility(listed.first[: len(visible) + 1], listed.light, self._visible_fraction, shading)
        if self._lobe_rays is not None:
            self._lobe_rays.share_triangles(lights, r, start, len(visible), listed, shading)
        return shading

    def _visible_clusters(self, subset: MergedParts, visible: Bits) -> Bits:
        """Return the merged lights that are visible at least in part, as bits; fractions are in `_visible_fraction`."""
        visible_fraction(visible, subset.group, subset.fraction, 0, len(visible), self._visible_fraction)
        is_visible = np.ascontiguousarray(self._visible_fraction[:, : len(visible)].T > 0)
        return np.packbits(is_visible, axis=1, bitorder="little")


class AreaLightList:
    """Lists the visible parts of an area light for blocks of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        receivers: all points. rays: from a light with a surface.

    Attributes:
        max_triangles_per_point, points_per_block: maximum listed at once.
        listed, triangles: written by `list`.
    """

    def __init__(self, term: Term, contraction: Contraction, receivers: ShadingPoints, rays: LocalRays) -> None:
        self._term, self._receivers, self._rays = term, receivers, rays
        self._support = _curve_support(contraction)
        gain = np.asarray(rays.gain * contraction.constant, np.float32)
        self._area_light = AreaLight(rays.light, rays.strata, rays.emitter_parts, gain)
        self.max_triangles_per_point = 2 * len(rays.strata.uv)
        self.points_per_block = max(1, _TRIANGLES_PER_BLOCK // self.max_triangles_per_point)
        capacity = self.points_per_block * self.max_triangles_per_point
        self.listed = allocate_list(self.points_per_block, capacity)
        self.triangles = AreaTriangles(np.empty((capacity, 6, 3), np.float32), np.empty((capacity, 4), np.float32))
        self._scratch = allocate_scratch(self.max_triangles_per_point)

    def list(self, start: int, stop: int) -> tuple[Shaped[F32, "channels K"], int]:
        """List the triangles of points [start, stop), at most a block.

        Returns:
            q cos θi of each entry, and the number of triangles.
        """
        r, listed = self._receivers, self.listed
        block_args = self._rays.visible, self._support, start, stop, self._scratch, listed, self.triangles
        num, num_triangles = list_area_light(r.points, r.wo, self._area_light, *block_args)
        return _weighted_quotients(self._term, listed, num), num_triangles


def area_light_lists(term: Term, contraction: Contraction, receivers: ShadingPoints) -> list[AreaLightList]:
    """Allocate lists for all area lights that are listed as triangles, see `is_area_light`.

    Args:
        term: the BRDF term. contraction: its curves. receivers: points, with their rays to local lights.
    """
    area_lights = [rays for rays in receivers.rays if is_area_light(rays, contraction.kinds.size)]
    return [AreaLightList(term, contraction, receivers, rays) for rays in area_lights]
