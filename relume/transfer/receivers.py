"""Points that light arrives at, and the rays that bring them light from other surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.trace.gather_rays import Pattern

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class GatherRays:
    """Rays of n points.

    Attributes:
        links: cell that each hits. (n, rays) uint16
        numbers: of the points among all that share the pattern. (n,) uint32
        radiance: of cells, from `CellLight.radiance`. (NO_CELL + 1, 3) float32
    """

    links: NDArray[np.uint16]
    pattern: Pattern
    numbers: NDArray[np.uint32]
    radiance: F32


@dataclass(frozen=True)
class Receivers:
    """Points that light arrives at, seen from one direction each; a pixel or a vertex may own them.

    Attributes:
        normal, tangent: shading frame. wo: towards the viewer. (n, 3) float32, unit
        visible: light m of a point in bit m & 7 of byte m >> 3; set only above the horizon. (n, bytes) uint8
        rays: light that arrives by reflection; None where only the lights themselves are meant.
    """

    normal: F32
    tangent: F32
    wo: F32
    visible: NDArray[np.uint8]
    rays: GatherRays | None = None
