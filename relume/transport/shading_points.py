"""Shading points, and the rays along which light reaches them from other surfaces and from local lights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, TypeGuard

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.light_sampling import EmitterParts, LightStrata
from relume.lights.local_lights import SURFACE, LocalLight, make_emitter_parts
from relume.patches.neighbor_filter import NeighborFilter
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.gather_kernel import allocate_scratch, list_gather_rays, sum_gather_rays
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.ray_kernel import list_local_rays, list_mirror_lights

F32 = NDArray[np.float32]


class ListedRays(NamedTuple):
    """Memory for the K listed rays of a range of points, in the points' local frames.

    Attributes:
        first: begin of each point's rays. wi: local directions. wo: local wo of each ray's point. irradiance: w · L.
    """

    first: Shaped[NDArray[np.int64], " ends"]
    wi: Shaped[F32, "3 K"]
    wo: Shaped[F32, "3 K"]
    irradiance: Shaped[F32, "3 K"]


def allocate_list(num_points: int, max_rays: int) -> ListedRays:
    """Allocate memory for the rays of a number of points."""
    return ListedRays(np.empty(num_points + 1, np.int64), *np.empty((3, 3, max_rays), np.float32))


class RayList(Protocol):
    """Rays of n points, with a common maximum per point."""

    @property
    def max_rays_per_point(self) -> int:
        """Maximum number of rays of a point."""
        ...

    def unshared(self, rows: Shaped[NDArray[np.integer], " m"]) -> RayList:
        """Select the rays of some points, without sharing among neighbors."""
        ...

    def list_into(self, listed: ListedRays, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of points [start, stop) that carry light; return their number.

        Args:
            listed: memory for the rays, written. receivers: all points. start, stop: range of points.
        """
        ...


def build_ray_lists(rays: RayList, receivers: ShadingPoints, start: int, stop: int) -> ListedRays:
    """List rays in newly allocated memory. See `RayList.list_into`."""
    listed = allocate_list(stop - start, (stop - start) * rays.max_rays_per_point)
    rays.list_into(listed, receivers, start, stop)
    return listed


@dataclass(frozen=True)
class GatherRays:
    """Rays that carry the light of patches.

    Attributes:
        gather_hits: patch that each ray hits. pattern: ray directions, shifted by the points' seeds.
        outgoing: outgoing radiance of the patches.
        sharing: filter over neighboring points; None: each point uses its own rays.
    """

    gather_hits: Shaped[NDArray[np.uint16], "n rays"]
    pattern: RayPattern
    outgoing: OutgoingLight
    sharing: NeighborFilter | None = None

    @property
    def max_rays_per_point(self) -> int:
        """Maximum number of rays of a point."""
        return int(self.gather_hits.shape[1])

    def unshared(self, rows: Shaped[NDArray[np.integer], " m"]) -> GatherRays:
        """Select the rays of some points, without sharing among neighbors."""
        return replace(self, gather_hits=self.gather_hits[rows], sharing=None)

    def list_into(self, listed: ListedRays, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `RayList`."""
        ray_args = self.gather_hits, self.pattern, self.outgoing, start, stop, allocate_scratch(self.max_rays_per_point)
        return int(list_gather_rays(receivers.points, receivers.wo, *ray_args, listed))

    def sum(self, receivers: ShadingPoints, start: int, stop: int) -> Shaped[F32, "m 3"]:
        """Return the irradiance of `receivers` [start, stop) from their cosine rays."""
        total = np.empty((stop - start, 3), np.float32)
        ray_args = self.gather_hits, self.pattern, self.outgoing, start, stop, allocate_scratch(self.max_rays_per_point)
        sum_gather_rays(receivers.points, *ray_args, total)
        return total


@dataclass(frozen=True)
class LocalRays:
    """Rays that carry the light of a local light.

    Attributes:
        light: light of unit emission. strata: its samples, shifted by the points' seeds.
        gain: factor on the light's unit emission.
        visible: sample k of a point in bit k & 7 of byte k >> 3.
    """

    light: LocalLight
    strata: LightStrata
    gain: Shaped[F32, " 3"]
    visible: Shaped[NDArray[np.uint8], "n bytes"]

    @cached_property
    def emitter_parts(self) -> EmitterParts:
        """Hierarchy of parts of the light's surface."""
        return make_emitter_parts(self.light, self.strata)

    @property
    def max_rays_per_point(self) -> int:
        """Maximum number of rays of a point."""
        return len(self.strata.uv)

    def unshared(self, rows: Shaped[NDArray[np.integer], " m"]) -> LocalRays:
        """Select the rays of some points; see `RayList`."""
        return replace(self, visible=self.visible[rows])

    def list_into(self, listed: ListedRays, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `RayList`."""
        ray_args = self.light, self.strata, self.gain, self.visible, start, stop
        return int(list_local_rays(receivers.points, receivers.wo, *ray_args, listed))


@dataclass(frozen=True)
class MirrorRays:
    """Rays that carry light reflected by planar mirrors: one per light.

    Attributes:
        direction: unit, toward the mirror image of each light.
        normal_irradiance: irradiance from each on a surface perpendicular to it.
        visible: light k of a point in bit k & 7 of byte k >> 3.
    """

    direction: Shaped[F32, "K 3"]
    normal_irradiance: Shaped[F32, "K 3"]
    visible: Shaped[NDArray[np.uint8], "n bytes"]

    @property
    def max_rays_per_point(self) -> int:
        """Maximum number of rays of a point."""
        return len(self.direction)

    def unshared(self, rows: Shaped[NDArray[np.integer], " m"]) -> MirrorRays:
        """Select the rays of some points; see `RayList`."""
        return replace(self, visible=self.visible[rows])

    def list_into(self, listed: ListedRays, receivers: ShadingPoints, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `RayList`."""
        ray_args = self.direction, self.normal_irradiance, self.visible, start, stop
        return int(list_mirror_lights(receivers.points, receivers.wo, *ray_args, listed))


def is_area_light(rays: RayList, num_curves: int) -> TypeGuard[LocalRays]:
    """True if rays come from an area light that a term with this number of curves lists as triangles.

    If no curve depends on the light direction, samples of the light are listed as rays.
    """
    return num_curves > 0 and isinstance(rays, LocalRays) and rays.light.kind == SURFACE and bool(rays.light.area > 0)


@dataclass(frozen=True)
class ShadingPoints:
    """Points to shade, each with one view direction.

    Attributes:
        points: the surface points. wo: view directions, unit, world space.
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon.
        rays: light along rays; empty for the environment's triangles alone.
        read_uv: returns `uv`, which only measured textures need.
        level: level of roughness, see `relume.transport.roughness_ranges`; None if all have the same.
    """

    points: SurfacePoints
    wo: Shaped[F32, "n 3"]
    visible: Shaped[NDArray[np.uint8], "n bytes"]
    rays: Sequence[RayList] = ()
    read_uv: Callable[[], Shaped[F32, "n uv"] | None] = lambda: None
    level: Shaped[NDArray[np.uint8], " n"] | None = None

    @cached_property
    def uv(self) -> Shaped[F32, "n uv"] | None:
        """See `relume.raytrace.surface_interaction.SurfaceInteraction`; None if unknown."""
        return self.read_uv()

    @property
    def normal(self) -> Shaped[F32, "n 3"]:
        """Shading normals of the points."""
        return self.points.normal

    @property
    def tangent(self) -> Shaped[F32, "n 3"]:
        """Tangents of the points."""
        return self.points.tangent

    def without_light(self, rows: Shaped[NDArray[np.integer], " m"]) -> ShadingPoints:
        """Select points without their visibility and rays."""
        read_uv = self.read_uv  # not `self`, which would keep its arrays

        def selected_uv() -> Shaped[F32, "m uv"] | None:
            return None if (uv := read_uv()) is None else uv[rows]

        level = None if self.level is None else self.level[rows]
        no_visibility = np.empty((len(rows), 0), np.uint8)
        return ShadingPoints(self.points.rows(rows), self.wo[rows], no_visibility, read_uv=selected_uv, level=level)

    def subset(self, rows: Shaped[NDArray[np.integer], " m"]) -> ShadingPoints:
        """Select points with the visibility and rays of each, not shared among neighbors."""
        rays = tuple(rays.unshared(rows) for rays in self.rays)
        return replace(self.without_light(rows), visible=self.visible[rows], rays=rays)
