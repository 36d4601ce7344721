"""What beams are: where their light comes from, and what points would get of it if nothing were in the way."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y
from relume.lights.spherical_triangles import TriangleLights
from relume.lights.sun_disks import NUM_TARGET_SETS, NUM_TARGETS, SunDisk
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.look import LightGeometry
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.incident_coefficients import incident_coefficients

F32 = NDArray[np.float32]

_DELTA_LIGHT_KINDS = "point", "spot", "directional"  # of lamps that have no extent
_MAX_LOCAL_LIGHTS = 4


class ShadowTargets(NamedTuple):
    """What shadow rays are sent to.

    Attributes:
        towards: unit directions, or places in metres; each has an equal share of the light. One of `NUM_TARGET_SETS`
            sets is a pixel's own. (`NUM_TARGET_SETS`, `NUM_TARGETS`, 3) float32
        is_far: they are directions.
    """

    towards: F32
    is_far: bool


class HardShadowLight(NamedTuple):
    """One source.

    Attributes:
        key: of its targets: equal ones cast equal shadows. Of a lamp it is the geometry.
        vectors: of its light at points, nothing in its way, gain 1. (points, 3, K) float32
        gain: of it, in each channel. (3,) float32
    """

    key: Hashable
    targets: ShadowTargets
    vectors: F32
    gain: F32

    def scatter(self, rows: NDArray[np.intp], shape: tuple[int, int, int]) -> HardShadowLight:
        """The same of as many points as vectors of this shape have, whose light is that of some. chosen: these. (n,)"""
        vectors = np.zeros(shape, np.float32)
        vectors[rows] = self.vectors
        return self._replace(vectors=vectors)

    @property
    def center(self) -> F32:
        """Where its light comes from: a direction, not quite unit, or a place. (3,) float32"""
        return np.asarray(self.targets.towards.mean(axis=(0, 1)), np.float32)


def hard_shadow_lights(light: Illumination) -> tuple[LightSource, ...]:
    """Find the lamps of a light that are beams: all of those without an extent, unless they are many."""
    sources = tuple(
        source for source in light.local if source.geometry.kind in _DELTA_LIGHT_KINDS and light.paths.direct
    )
    return sources if len(sources) <= _MAX_LOCAL_LIGHTS else ()


def sun_shadow_targets(sun_disk: SunDisk, rotation: float) -> ShadowTargets:
    """Aim at a sun of a map that is turned by `rotation` degrees."""
    towards = rotate_about_y(sun_disk.directions.reshape(-1, 3), rotation).reshape(sun_disk.directions.shape)
    return ShadowTargets(np.ascontiguousarray(towards, np.float32), True)


def local_shadow_targets(geometry: LightGeometry) -> ShadowTargets:
    """Aim at a lamp without an extent."""
    is_far = geometry.kind == "directional"
    location = np.array(geometry.position, np.float64)
    if is_far:
        location = -np.array(geometry.direction, np.float64)
        location /= np.linalg.norm(location)
    return ShadowTargets(np.tile(location, (NUM_TARGET_SETS, NUM_TARGETS, 1)).astype(np.float32), is_far)


def unoccluded_sun_vectors(sun_disk: SunDisk, rotation: float, probes: SurfacePoints) -> F32:
    """Find what points get of a sun if nothing hides it.

    Args:
        sun_disk: of a map. rotation: of the map, degrees. probes: that are asked about.
    Returns:
        Light vectors. (points, 3, K) float32
    """
    mean = rotate_about_y(sun_disk.mean[None], rotation)
    length = np.linalg.norm(mean)
    lights = TriangleLights(
        np.zeros((3, 6, 1), np.float32),
        (mean / length).astype(np.float32),
        (sun_disk.irradiance[None] * length).astype(np.float32),
    )
    return incident_coefficients(probes, np.full((probes.num_points, 1), 1, np.uint8), lights, ())
