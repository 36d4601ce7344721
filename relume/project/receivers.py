"""Points that light arrives at, and the rays along which it comes from other surfaces and from local lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import Pattern
from relume.light.local import SURFACE, LocalLight, parts_of
from relume.light.strata import LampParts, Strata
from relume.points import Points
from relume.project.gathered_kernel import list_gathered, sum_gathered
from relume.project.ray_kernel import list_local, list_thrown
from relume.project.sent import Sent
from relume.sharing import Sharing

F32 = NDArray[np.float32]


class Listed(NamedTuple):
    """Memory that rays of a range of points are listed in; see `relume.project.ray_kernel`."""

    first: NDArray[np.int64]
    wi: F32
    wo: F32
    irradiance: F32


class Rays(Protocol):
    """Rays of n points, at most the same number for each."""

    @property
    def rays_a_point(self) -> int:
        """The most rays that any point has."""
        ...

    def alone(self, chosen: NDArray[np.integer]) -> Rays:
        """Choose those of some points, which do not share them."""
        ...

    def list_into(self, listed: Listed, receivers: Receivers, start: int, stop: int) -> int:
        """List the rays of points [start, stop) that bring light; returns their number.

        Args:
            listed: memory for them, written. receivers: all points that the rays belong to.
            start, stop: those whose rays are listed.
        """
        ...


def listed(rays: Rays, receivers: Receivers, start: int, stop: int) -> Listed:
    """List rays in memory of their own.

    Args:
        rays: that are listed. receivers, start, stop: as of `Rays.list_into`.
    """
    most = (stop - start) * rays.rays_a_point
    into = Listed(np.empty(stop - start + 1, np.int64), *(np.empty((3, most), np.float32) for _ in range(3)))
    rays.list_into(into, receivers, start, stop)
    return into


@dataclass(frozen=True)
class GatherRays:
    """Rays that bring the light of cells.

    Attributes:
        links: cell that each hits. (n, rays) uint16. pattern: their directions, shifted by the points' seeds.
        sent: by cells.
        sharing: among the points; None: each alone.
    """

    links: NDArray[np.uint16]
    pattern: Pattern
    sent: Sent
    sharing: Sharing | None = None

    @property
    def rays_a_point(self) -> int:
        """The most rays that any point has."""
        return int(self.links.shape[1])

    def alone(self, chosen: NDArray[np.integer]) -> GatherRays:
        """Choose those of some points, which do not share them."""
        return replace(self, links=self.links[chosen], sharing=None)

    def list_into(self, listed: Listed, receivers: Receivers, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `Rays`."""
        arriving = self.links, self.pattern, self.sent
        return int(list_gathered(receivers.points, receivers.wo, *arriving, start, stop, *listed))

    def sum(self, receivers: Receivers, start: int, stop: int) -> F32:
        """Sum the light of the rays of `receivers` [start, stop), wherever it comes from. (stop - start, 3)"""
        found = np.empty((stop - start, 3), np.float32)
        sum_gathered(receivers.points, receivers.wo, self.links, self.pattern, self.sent, start, stop, found)
        return found


@dataclass(frozen=True)
class LocalRays:
    """Rays that bring a local light.

    Attributes:
        light: of unit emission. strata: its samples, shifted by the points' seeds.
        gain: times the light's unit emission. (3,) float32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, bytes) uint8
    """

    light: LocalLight
    strata: Strata
    gain: F32
    visible: NDArray[np.uint8]

    @cached_property
    def parts(self) -> LampParts:
        """LampParts of that surface."""
        return parts_of(self.light, self.strata)

    @property
    def rays_a_point(self) -> int:
        """The most rays that any point has."""
        return len(self.strata.uv)

    def alone(self, chosen: NDArray[np.integer]) -> LocalRays:
        """Choose those of some points; see `Rays`."""
        return replace(self, visible=self.visible[chosen])

    def list_into(self, listed: Listed, receivers: Receivers, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `Rays`."""
        arriving = self.light, self.strata, self.gain, self.visible
        return int(list_local(receivers.points, receivers.wo, *arriving, start, stop, *listed))


@dataclass(frozen=True)
class ThrownRays:
    """Rays that bring what flat mirrors throw: one from each light that is seen in them.

    Attributes:
        direction: in which each is seen, unit. (K, 3) float32
        across: what each brings to a surface across its way. (K, 3) float32
        visible: light k of a point in bit k & 7 of byte k >> 3. (n, bytes) uint8
    """

    direction: F32
    across: F32
    visible: NDArray[np.uint8]

    @property
    def rays_a_point(self) -> int:
        """The most rays that any point has."""
        return len(self.direction)

    def alone(self, chosen: NDArray[np.integer]) -> ThrownRays:
        """Choose those of some points; see `Rays`."""
        return replace(self, visible=self.visible[chosen])

    def list_into(self, listed: Listed, receivers: Receivers, start: int, stop: int) -> int:
        """List the rays of `receivers` [start, stop) into `listed`; see `Rays`."""
        arriving = self.direction, self.across, self.visible
        return int(list_thrown(receivers.points, receivers.wo, *arriving, start, stop, *listed))


def is_lamp(rays: Rays, num_curves: int) -> TypeGuard[LocalRays]:
    """Whether rays come from a surface of which a term with so many curves lists parts as triangles.

    Where no curve asks where light comes from, its samples are rays as others are.
    """
    return num_curves > 0 and isinstance(rays, LocalRays) and rays.light.kind == SURFACE and bool(rays.light.area > 0)


@dataclass(frozen=True)
class Receivers:
    """Points that light arrives at, each seen from one direction.

    Attributes:
        points: where it arrives. wo: towards the viewer, unit, world space. (n, 3) float32
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon. (n, bytes) uint8
        rays: light that arrives along rays; none where only the environment's triangles are meant.
        uv: where they lie in textures, see `relume.trace.surface.Surface`; None where that is not known.
            (n, 5) float32
        level: of roughness, see `relume.project.levels`; None where all are alike. (n,) uint8
    """

    points: Points
    wo: F32
    visible: NDArray[np.uint8]
    rays: Sequence[Rays] = ()
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

    def places(self, chosen: NDArray[np.integer]) -> Receivers:
        """Choose some of them, without their light."""
        uv = None if self.uv is None else self.uv[chosen]
        level = None if self.level is None else self.level[chosen]
        nothing = np.empty((len(chosen), 0), np.uint8)
        return Receivers(self.points.rows(chosen), self.wo[chosen], nothing, uv=uv, level=level)

    def some(self, chosen: NDArray[np.integer]) -> Receivers:
        """Choose some of them, with the light of each alone."""
        rays = tuple(rays.alone(chosen) for rays in self.rays)
        return replace(self.places(chosen), visible=self.visible[chosen], rays=rays)
