"""Points that light arrives at, and the rays along which it comes from other surfaces and from local lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from relume.lights.light_sampling import EmitterParts, LightStrata
from relume.lights.local_lights import SURFACE, LocalLight, make_emitter_parts
from relume.patches.neighbor_filter import NeighborFilter
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.gather_kernel import list_gather_rays, sum_gather_rays
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.ray_kernel import list_local_rays, list_mirror_lights

F32 = NDArray[np.float32]


class ReceiverList(NamedTuple):
    """Memory that rays of a range of points are listed in; see `relume.transport.ray_kernel`."""

    first: NDArray[np.int64]
    wi: F32
    wo: F32
    irradiance: F32


class RayList(Protocol):
    """Rays of n points, at most the same number for each."""

    @property
    def max_rays_per_point(self) -> int:
        """The most rays that any point has."""
        ...

    def unshared(self, rows: NDArray[np.integer]) -> RayList:
        """Choose those of some points, which do not share them."""
        ...

    def list_into(self, receiver_list: ReceiverList, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of points [start, stop) that bring light; returns their number.

        Args:
            receiver_list: memory for them, written. receivers: all points that the rays belong to.
            start, stop: those whose rays are listed.
        """
        ...


def build_ray_lists(rays: RayList, receivers: ShadingPoints, start: int, stop: int) -> ReceiverList:
    """List rays in memory of their own.

    Args:
        rays: that are listed. receivers, start, stop: as of `Rays.list_into`.
    """
    max_rays = (stop - start) * rays.max_rays_per_point
    receiver_list = ReceiverList(
        np.empty(stop - start + 1, np.int64), *(np.empty((3, max_rays), np.float32) for _ in range(3))
    )
    rays.list_into(receiver_list, receivers, start, stop)
    return receiver_list


@dataclass(frozen=True)
class GatherRays:
    """Rays that bring the light of cells.

    Attributes:
        gather_hits: cell that each hits. (n, rays) uint16. pattern: their directions, shifted by the points' seeds.
        outgoing: by cells.
        sharing: among the points; None: each alone.
    """

    gather_hits: NDArray[np.uint16]
    pattern: RayPattern
    outgoing: OutgoingLight
    sharing: NeighborFilter | None = None

    @property
    def max_rays_per_point(self) -> int:
        """The most rays that any point has."""
        return int(self.gather_hits.shape[1])

    def unshared(self, rows: NDArray[np.integer]) -> GatherRays:
        """Choose those of some points, which do not share them."""
        return replace(self, gather_hits=self.gather_hits[rows], sharing=None)

    def list_into(self, receiver_list: ReceiverList, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `receiver_list`; see `RayList`."""
        ray_arrays = self.gather_hits, self.pattern, self.outgoing
        return int(list_gather_rays(receivers.points, receivers.wo, *ray_arrays, start, stop, *receiver_list))

    def sum(self, receivers: ShadingPoints, start: int, stop: int) -> F32:
        """Sum the light of the rays of `receivers` [start, stop), wherever it comes from. (stop - start, 3)"""
        total = np.empty((stop - start, 3), np.float32)
        sum_gather_rays(
            receivers.points, receivers.wo, self.gather_hits, self.pattern, self.outgoing, start, stop, total
        )
        return total


@dataclass(frozen=True)
class LocalRays:
    """Rays that bring a local light.

    Attributes:
        light: of unit emission. strata: its samples, shifted by the points' seeds.
        gain: times the light's unit emission. (3,) float32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, bytes) uint8
    """

    light: LocalLight
    strata: LightStrata
    gain: F32
    visible: NDArray[np.uint8]

    @cached_property
    def emitter_parts(self) -> EmitterParts:
        """LampParts of that surface."""
        return make_emitter_parts(self.light, self.strata)

    @property
    def max_rays_per_point(self) -> int:
        """The most rays that any point has."""
        return len(self.strata.uv)

    def unshared(self, rows: NDArray[np.integer]) -> LocalRays:
        """Choose those of some points; see `RayList`."""
        return replace(self, visible=self.visible[rows])

    def list_into(self, receiver_list: ReceiverList, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `receiver_list`; see `RayList`."""
        ray_arrays = self.light, self.strata, self.gain, self.visible
        return int(list_local_rays(receivers.points, receivers.wo, *ray_arrays, start, stop, *receiver_list))


@dataclass(frozen=True)
class MirrorRays:
    """Rays that bring what flat mirrors throw: one from each light that is seen in them.

    Attributes:
        direction: in which each is seen, unit. (K, 3) float32
        normal_irradiance: what each brings to a surface across its way. (K, 3) float32
        visible: light k of a point in bit k & 7 of byte k >> 3. (n, bytes) uint8
    """

    direction: F32
    normal_irradiance: F32
    visible: NDArray[np.uint8]

    @property
    def max_rays_per_point(self) -> int:
        """The most rays that any point has."""
        return len(self.direction)

    def unshared(self, rows: NDArray[np.integer]) -> MirrorRays:
        """Choose those of some points; see `RayList`."""
        return replace(self, visible=self.visible[rows])

    def list_into(self, receiver_list: ReceiverList, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `receiver_list`; see `RayList`."""
        ray_arrays = self.direction, self.normal_irradiance, self.visible
        return int(list_mirror_lights(receivers.points, receivers.wo, *ray_arrays, start, stop, *receiver_list))


def is_area_light(rays: RayList, num_curves: int) -> TypeGuard[LocalRays]:
    """Whether rays come from a surface of which a term with so many curves lists parts as triangles.

    Where no curve asks where light comes from, its samples are rays as others are.
    """
    return num_curves > 0 and isinstance(rays, LocalRays) and rays.light.kind == SURFACE and bool(rays.light.area > 0)


@dataclass(frozen=True)
class ShadingPoints:
    """Points that light arrives at, each seen from one direction.

    Attributes:
        points: where it arrives. wo: towards the viewer, unit, world space. (n, 3) float32
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon. (n, bytes) uint8
        rays: light that arrives along rays; none where only the environment's triangles are meant.
        uv: where they lie in textures, see `relume.raytrace.surface_interaction.SurfaceInteraction`; None where that is
            not known. (n, 5) float32
        level: of roughness, see `relume.transport.roughness_ranges`; None where all are alike. (n,) uint8
    """

    points: SurfacePoints
    wo: F32
    visible: NDArray[np.uint8]
    rays: Sequence[RayList] = ()
    uv: F32 | None = None
    level: NDArray[np.uint8] | None = None

    @property
    def normal(self) -> F32:
        """The points' normals. (n, 3) float32"""
        return self.points.normal

    @property
    def tangent(self) -> F32:
        """The points' tangents. (n, 3) float32"""
        return self.points.tangent

    def without_light(self, rows: NDArray[np.integer]) -> ShadingPoints:
        """Choose some of them, without their light."""
        uv = None if self.uv is None else self.uv[rows]
        level = None if self.level is None else self.level[rows]
        no_visibility = np.empty((len(rows), 0), np.uint8)
        return ShadingPoints(self.points.rows(rows), self.wo[rows], no_visibility, uv=uv, level=level)

    def subset(self, rows: NDArray[np.integer]) -> ShadingPoints:
        """Choose some of them, with the light of each alone."""
        rays = tuple(rays.unshared(rows) for rays in self.rays)
        return replace(self.without_light(rows), visible=self.visible[rows], rays=rays)
