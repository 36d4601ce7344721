"""What beams are: where their light comes from, and what points would get of it if nothing were in the way."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import turned
from relume.light.suns import NUM_TARGETS, TURNS, Sun
from relume.light.triangles import TriangleLights
from relume.look import LightGeometry
from relume.picture.light import Light, Source
from relume.points import Points
from relume.project.light_vectors import light_vectors

F32 = NDArray[np.float32]

_KINDS = "point", "spot", "directional"  # of lamps that have no extent
_MOST_LAMPS = 4


class Targets(NamedTuple):
    """What shadow rays are sent to.

    Attributes:
        towards: unit directions, or places in metres; each has an equal share of the light. One of `TURNS` sets is a
            pixel's own. (`TURNS`, `NUM_TARGETS`, 3) float32
        is_far: they are directions.
    """

    towards: F32
    is_far: bool


class Beam(NamedTuple):
    """One source.

    Attributes:
        key: of its targets: equal ones cast equal shadows. Of a lamp it is the geometry.
        vectors: of its light at points, nothing in its way, gain 1. (points, 3, K) float32
        gain: of it, in each channel. (3,) float32
    """

    key: Hashable
    targets: Targets
    vectors: F32
    gain: F32

    def spread(self, chosen: NDArray[np.intp], shape: tuple[int, int, int]) -> Beam:
        """The same of as many points as vectors of this shape have, whose light is that of some. chosen: these. (n,)"""
        vectors = np.zeros(shape, np.float32)
        vectors[chosen] = self.vectors
        return self._replace(vectors=vectors)

    @property
    def middle(self) -> F32:
        """Where its light comes from: a direction, not quite unit, or a place. (3,) float32"""
        return np.asarray(self.targets.towards.mean(axis=(0, 1)), np.float32)


def lamps_of(light: Light) -> tuple[Source, ...]:
    """Find the lamps of a light that are beams: all of those without an extent, unless they are many."""
    found = tuple(source for source in light.local if source.geometry.kind in _KINDS and light.paths.direct)
    return found if len(found) <= _MOST_LAMPS else ()


def targets_of_sun(sun: Sun, rotation: float) -> Targets:
    """Aim at a sun of a map that is turned by `rotation` degrees."""
    towards = turned(sun.towards.reshape(-1, 3), rotation).reshape(sun.towards.shape)
    return Targets(np.ascontiguousarray(towards, np.float32), True)


def targets_of_lamp(geometry: LightGeometry) -> Targets:
    """Aim at a lamp without an extent."""
    is_far = geometry.kind == "directional"
    where = np.array(geometry.position, np.float64)
    if is_far:
        where = -np.array(geometry.direction, np.float64)
        where /= np.linalg.norm(where)
    return Targets(np.tile(where, (TURNS, NUM_TARGETS, 1)).astype(np.float32), is_far)


def light_of_sun(sun: Sun, rotation: float, points: Points) -> F32:
    """Find what points get of a sun if nothing hides it.

    Args:
        sun: of a map. rotation: of the map, degrees. points: that are asked about.
    Returns:
        Light vectors. (points, 3, K) float32
    """
    mean = turned(sun.mean[None], rotation)
    length = np.linalg.norm(mean)
    one = TriangleLights(
        np.zeros((3, 6, 1), np.float32),
        (mean / length).astype(np.float32),
        (sun.irradiance[None] * length).astype(np.float32),
    )
    return light_vectors(points, np.full((points.num_points, 1), 1, np.uint8), one, ())
