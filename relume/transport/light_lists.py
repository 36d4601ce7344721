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
from relume.transport.area_light_kernel import list_area_light
from relume.transport.light_culling import list_lights
from relume.transport.shading_points import LocalRays, ShadingPoints, is_area_light
from relume.transport.term_contraction import Contraction

F32 = NDArray[np.float32]
Bits = NDArray[np.uint8]

_TRIANGLES_PER_BLOCK = 4096  # of area lights, at least those of one point
POINTS_PER_BLOCK = 48  # directions of a block stay in a core's second-level cache

_HALF_PI = np.float32(np.pi / 2)


def with_half_angle(
    kinds: Shaped[NDArray[np.int64], " C"], support: Shaped[F32, " C"]
) -> tuple[Shaped[NDArray[np.int64], " B"], Shaped[F32, " B"]]:
    """Bound the half angle if only two other angles of the half vector are bounded. See `angle_lower_bounds`.

    cos θh = cos α cos β, and tan² θh = tan² x + tan² y of the two tilts.

    Args:
        kinds: angles of the curves. support: radians beyond which each is zero.
    Returns:
        Both, with one more angle if there is such a bound.
    """
    limit = {int(kind): float(angle) for kind, angle in zip(kinds, support, strict=True) if angle < _HALF_PI}
    if Angle.ALPHA in limit and Angle.BETA in limit:
        bound = np.arccos(np.cos(limit[Angle.ALPHA]) * np.cos(limit[Angle.BETA]))
    elif Angle.TILT_X in limit and Angle.TILT_Y in limit:
        bound = np.arctan(np.hypot(np.tan(limit[Angle.TILT_X]), np.tan(limit[Angle.TILT_Y])))
    else:
        return kinds, support
    return np.append(kinds, Angle.THETA_H), np.append(support, np.float32(bound))


def _curve_support(contraction: Contraction) -> tuple[NDArray[np.int64], F32]:
    """Return the angles of curves, and the radians beyond which each curve is zero."""
    radians = np.asarray(contraction.support * _HALF_PI / contraction.num_bands, np.float32)
    return with_half_angle(contraction.kinds, radians)


def _weighted_quotients(term: Term, wi: F32, wo: F32) -> F32:
    """Return q cos θi of entries, (1 or 3, K). wi, wo: local. (3, K)"""
    shading = term.quotients(wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
    shading *= wi[2]
    return shading


class LightList:
    """Lists the lights of blocks of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        lights: triangles of the environment. receivers: all points, with their visibility and rays.

    Attributes:
        irradiance: irradiance of the lights, times constant curves. (M, 3)
        first, light: written by `list`, see `list_lights`.
    """

    def __init__(self, term: Term, contraction: Contraction, lights: TriangleLights, receivers: ShadingPoints) -> None:
        self._term, self._lights, self._receivers = term, lights, receivers
        self.irradiance = lights.irradiance * contraction.constant
        self._kinds, self._support = _curve_support(contraction)
        capacity = POINTS_PER_BLOCK * lights.num_lights
        self._visible_fraction = np.empty(
            (lights.num_lights if lights.parts is not None else 0, POINTS_PER_BLOCK), np.float32
        )
        self.first = np.empty(POINTS_PER_BLOCK + 1, np.int64)
        self.light = np.empty(capacity + 1, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)

    @cached_property
    def irradiance_radius(self) -> Shaped[F32, "M 4"]:
        """Irradiance and angular radius of the lights."""
        return np.concatenate([self.irradiance, self._lights.radius[:, None]], axis=1)

    def list(
        self, start: int, stop: int, visible: Shaped[Bits, "n bytes"]
    ) -> tuple[Shaped[F32, "channels K"], Shaped[F32, "3 capacity"]]:
        """List the lights of points [start, stop), at most a block.

        Args:
            visible: visibility of the lights, or of their parts, from these points, as in `ShadingPoints`.
        Returns:
            q cos θi of each entry (one row if all channels are equal), and the local wo of each. The latter has its
            full capacity: a slice has another memory layout, for which kernels would be compiled again.
        """
        r, lights, rows = self._receivers, self._lights, slice(start, stop)
        if lights.parts is not None:
            visible = self._visible_clusters(lights.parts, visible)
        num = list_lights(
            r.normal[rows], r.tangent[rows], r.wo[rows], visible, lights.direction, lights.radius, self._kinds,
            self._support, 0, stop - start, self.first, self.light, self._wi, self._wo,
        )  # fmt: skip
        shading = _weighted_quotients(self._term, self._wi[:, :num], self._wo[:, :num])
        if lights.parts is not None:
            weight_by_visibility(self.first[: stop - start + 1], self.light, self._visible_fraction, shading)
        return shading, self._wo

    def _visible_clusters(self, subset: MergedParts, visible: Bits) -> Bits:
        """Return the merged lights that are visible at least in part, as bits; fractions are in `_visible_fraction`."""
        visible_fraction(visible, subset.group, subset.fraction, 0, len(visible), self._visible_fraction)
        return np.packbits(self._visible_fraction[:, : len(visible)].T > 0, axis=1, bitorder="little")


class AreaLightList:
    """Lists the visible parts of an area light for blocks of receivers; holds the scratch memory of one thread.

    Args:
        term: the BRDF term. contraction: its curves, from `contract`.
        receivers: all points. rays: from a light with a surface.

    Attributes:
        max_triangles_per_point, points_per_block: maximum listed at once.
        first, light: written by `list`, see `list_area_light`.
    """

    def __init__(self, term: Term, contraction: Contraction, receivers: ShadingPoints, rays: LocalRays) -> None:
        self._term, self._receivers, self._rays = term, receivers, rays
        self._kinds, self._support = _curve_support(contraction)
        self._gain = np.asarray(rays.gain * contraction.constant, np.float32)
        self.max_triangles_per_point = 2 * len(rays.strata.uv)
        self.points_per_block = max(1, _TRIANGLES_PER_BLOCK // self.max_triangles_per_point)
        capacity = self.points_per_block * self.max_triangles_per_point
        self.first, self.light = np.empty(self.points_per_block + 1, np.int64), np.empty(capacity + 1, np.int32)
        self._wi, self._wo = np.empty((2, 3, capacity), np.float32)
        self._nodes, self._irradiance_radius = (
            np.empty((capacity, 6, 3), np.float32),
            np.empty((capacity, 4), np.float32),
        )

    def list(
        self, start: int, stop: int
    ) -> tuple[Shaped[F32, "channels K"], Shaped[F32, "3 capacity"], Shaped[F32, "M 6 3"], Shaped[F32, "M 4"]]:
        """List the triangles of points [start, stop), at most a block.

        Returns:
            q cos θi of each entry, the local wo of each, nodes of the triangles, and their irradiance and radius.
        """
        r, rays = self._receivers, self._rays
        num, num_triangles = list_area_light(
            r.points, r.wo, (rays.light, rays.strata, rays.emitter_parts, self._gain), rays.visible, self._kinds,
            self._support, start, stop, self.first, self.light, self._wi, self._wo, self._nodes,
            self._irradiance_radius,
        )  # fmt: skip
        return (
            _weighted_quotients(self._term, self._wi[:, :num], self._wo[:, :num]),
            self._wo,
            self._nodes[:num_triangles],
            self._irradiance_radius[:num_triangles],
        )


def area_light_lists(term: Term, contraction: Contraction, receivers: ShadingPoints) -> list[AreaLightList]:
    """Allocate lists for all area lights that are listed as triangles, see `is_area_light`.

    Args:
        term: the BRDF term. contraction: its curves. receivers: points, with their rays to local lights.
    """
    area_lights = [rays for rays in receivers.rays if is_area_light(rays, contraction.kinds.size)]
    return [AreaLightList(term, contraction, receivers, rays) for rays in area_lights]
