"""Points that light arrives at, and the rays along which it comes from other surfaces and from local lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.light.local import LocalLight
from relume.trace.gather_rays import Pattern
from relume.transfer.ray_kernel import list_gathered, list_local

F32 = NDArray[np.float32]


class Listed(NamedTuple):
    """Memory that rays of a range of points are listed in; see `relume.transfer.ray_kernel`."""

    first: NDArray[np.int64]
    wi: F32
    wo: F32
    power: F32


class Rays(Protocol):
    """Rays of n points, one point after another the same number at most."""

    @property
    def rays_a_point(self) -> int:
        """The most of any point."""
        ...

    def times(self, factor: F32) -> Rays:
        """Light of every channel multiplied. factor: (3,) float32"""
        ...

    def list_into(self, listed: Listed, points: Receivers, start: int, stop: int) -> int:
        """List the rays of points [start, stop) that bring light; returns their number."""
        ...


@dataclass(frozen=True)
class GatherRays:
    """Rays that bring the light of cells.

    Attributes:
        links: cell that each hits. (n, rays) uint16
        numbers: of the points among all that share the pattern. (n,) uint32
        radiance: of cells, from `CellLight.radiance`. (NO_CELL + 1, 3) float32
        sharing: weights of the points for each other, from `relume.transfer.sharing`, (n, n) sparse; None: each alone.
    """

    links: NDArray[np.uint16]
    pattern: Pattern
    numbers: NDArray[np.uint32]
    radiance: F32
    sharing: Any = None

    @property
    def rays_a_point(self) -> int:
        """The most of any point."""
        return int(self.links.shape[1])

    def times(self, factor: F32) -> GatherRays:
        """Light of every channel multiplied."""
        return replace(self, radiance=self.radiance * factor)

    def alone(self, chosen: NDArray[np.integer]) -> GatherRays:
        """Those of some points, which do not share them."""
        return replace(self, links=self.links[chosen], numbers=self.numbers[chosen], sharing=None)

    def list_into(self, listed: Listed, points: Receivers, start: int, stop: int) -> int:
        """See `Rays`."""
        p = points
        args = (p.normal, p.tangent, p.wo, self.links, self.pattern, self.numbers, self.radiance, start, stop)
        return int(list_gathered(*args, *listed))


@dataclass(frozen=True)
class LocalRays:
    """Rays that bring a local light.

    Attributes:
        gain: times the light's unit emission. (3,) float32
        position: of the points. (n, 3) float32. numbers: of them among all that share the pattern. (n,) uint32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, bytes) uint8
    """

    light: LocalLight
    pattern: Pattern
    gain: F32
    position: F32
    numbers: NDArray[np.uint32]
    visible: NDArray[np.uint8]

    @property
    def rays_a_point(self) -> int:
        """The most of any point."""
        return len(self.pattern.uv)

    def times(self, factor: F32) -> LocalRays:
        """Light of every channel multiplied."""
        return replace(self, gain=self.gain * factor)

    def list_into(self, listed: Listed, points: Receivers, start: int, stop: int) -> int:
        """See `Rays`."""
        p = points
        of_light = (self.light, self.pattern, self.gain, self.position, self.numbers, self.visible)
        return int(list_local(p.normal, p.tangent, p.wo, *of_light, start, stop, *listed))


@dataclass(frozen=True)
class Receivers:
    """Points that light arrives at, seen from one direction each; a pixel or a vertex may own them.

    Attributes:
        normal, tangent: shading frame. wo: towards the viewer. (n, 3) float32, unit
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon. (n, bytes) uint8
        rays: light that arrives along rays; none where only the environment's triangles are meant.
    """

    normal: F32
    tangent: F32
    wo: F32
    visible: NDArray[np.uint8]
    rays: Sequence[Rays] = ()

    def places(self, chosen: NDArray[np.integer]) -> Receivers:
        """Some of them, without their light."""
        return replace(
            self,
            normal=self.normal[chosen],
            tangent=self.tangent[chosen],
            wo=self.wo[chosen],
            visible=np.empty((len(chosen), 0), np.uint8),
            rays=(),
        )
