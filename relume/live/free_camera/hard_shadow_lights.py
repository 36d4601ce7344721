"""Hard-shadow lights: their targets, and their unoccluded incident light at probes."""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y
from relume.lights.spherical_triangles import TriangleLights
from relume.lights.sun_disks import NUM_TARGET_SETS, NUM_TARGETS, SunDisk
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.look import LightGeometry
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.incident_coefficients import incident_coefficients

F32 = NDArray[np.float32]

_DELTA_LIGHT_KINDS = "point", "spot", "directional"  # of lights without extent
_MAX_LOCAL_LIGHTS = 4


class ShadowTargets(NamedTuple):
    """Targets of shadow rays.

    Attributes:
        towards: unit directions, or positions in meters, with an equal fraction of the light each. Each pixel uses one
            of
            `NUM_TARGET_SETS` sets.
        is_far: they are directions.
    """

    towards: Shaped[F32, "sets targets 3"]
    is_far: bool


class HardShadowLight(NamedTuple):
    """One hard-shadow light.

    Attributes:
        key: equal keys cast equal shadows. For a local light it is the geometry.
        vectors: its unoccluded incident coefficients at probes that it lights, gain 1.
        gain: per channel.
        casters: the triangles that cast its shadows.
    """

    key: Hashable
    targets: ShadowTargets
    vectors: Shaped[F32, "probes 3 K"]
    gain: Shaped[F32, " 3"]
    casters: EmbreeScene

    def scatter(self, rows: Shaped[NDArray[np.intp], " n"], shape: tuple[int, int, int]) -> HardShadowLight:
        """Return the same light with coefficients of all probes, zero except in `rows`. shape: shape of all
        coefficients.
        """
        vectors = np.zeros(shape, np.float32)
        vectors[rows] = self.vectors
        return self._replace(vectors=vectors)

    @property
    def center(self) -> Shaped[F32, " 3"]:
        """Mean target: a direction, not quite unit, or a position."""
        return np.asarray(self.targets.towards.mean(axis=(0, 1)), np.float32)


def hard_shadow_lights(light: Illumination) -> tuple[LightSource, ...]:
    """Return the local lights with hard shadows: all lights without extent, unless there are too many."""
    sources = tuple(
        source for source in light.local if source.geometry.kind in _DELTA_LIGHT_KINDS and light.paths.direct
    )
    return sources if len(sources) <= _MAX_LOCAL_LIGHTS else ()


def sun_shadow_targets(sun_disk: SunDisk, rotation: float) -> ShadowTargets:
    """Return the targets of a sun disk in a map rotated by `rotation` degrees."""
    towards = rotate_about_y(sun_disk.directions.reshape(-1, 3), rotation).reshape(sun_disk.directions.shape)
    return ShadowTargets(np.ascontiguousarray(towards, np.float32), True)


def local_shadow_targets(geometry: LightGeometry) -> ShadowTargets:
    """Return the targets of a local light without extent."""
    is_far = geometry.kind == "directional"
    location = np.array(geometry.position, np.float64)
    if is_far:
        location = -np.array(geometry.direction, np.float64)
        location /= np.linalg.norm(location)
    return ShadowTargets(np.tile(location, (NUM_TARGET_SETS, NUM_TARGETS, 1)).astype(np.float32), is_far)


def unoccluded_sun_vectors(sun_disk: SunDisk, rotation: float, probes: SurfacePoints) -> Shaped[F32, "probes 3 K"]:
    """Return the unoccluded incident coefficients of a sun disk at probes.

    Args:
        sun_disk: sun disk of a map. rotation: rotation of the map, degrees. probes: the probes.
    """
    mean = rotate_about_y(sun_disk.mean[None], rotation)
    length = np.linalg.norm(mean)
    lights = TriangleLights(
        np.zeros((3, 6, 1), np.float32),
        (mean / length).astype(np.float32),
        (sun_disk.irradiance[None] * length).astype(np.float32),
    )
    return incident_coefficients(probes, np.full((probes.num_points, 1), 1, np.uint8), lights, ())
