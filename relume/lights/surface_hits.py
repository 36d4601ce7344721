"""Hits of rays with the surfaces of lights that only mirrors show."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.light_axes import light_axes
from relume.lights.local_lights import rectangle
from relume.look import LightGeometry

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def has_surface(geometry: LightGeometry) -> bool:
    """True for a light, or lights of a source, with a surface that is no mesh of the scene."""
    return geometry.kind in ("rectangle", "disc", "sphere", "tube", "panels", "directionals") or geometry.angle > 0


def surface_radiance(geometry: LightGeometry) -> float:
    """Radiance of such a light of unit emission: 1, or that of a sun disk of unit irradiance."""
    return 1 / (math.pi * math.sin(math.radians(geometry.angle / 2)) ** 2) if geometry.angle > 0 else 1.0


def surface_distance(
    geometry: LightGeometry, origin: Shaped[F32, "m 3"], direction: Shaped[F32, "m 3"]
) -> Shaped[F64, " m"]:
    """Distance to the emitting side of a single light with a surface, meters; infinite for a miss, 1e30 for a sun disk.

    Args:
        geometry: the light. origin: of the rays, meters. direction: unit vectors.
    """
    offset, along = origin - np.array(geometry.position), direction.astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        match geometry.kind:
            case "rectangle":
                corner, edges = rectangle(geometry)
                distance, hit = _plane(np.cross(*edges), origin - corner, along)
                u, v = (hit @ edge / (edge @ edge) for edge in edges)
                is_hit = (np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5)
            case "disc":
                distance, hit = _plane(light_axes(geometry.direction)[2], offset, along)
                is_hit = (hit**2).sum(axis=1) <= geometry.radius**2
            case "sphere":
                distance = _round(offset, along, geometry.radius)
                is_hit = np.isfinite(distance)
            case "tube":
                axis = light_axes(geometry.direction)[2]
                across, along_across = (vectors - np.outer(vectors @ axis, axis) for vectors in (offset, along))
                distance = _round(across, along_across, geometry.radius)
                is_hit = np.abs((offset + distance[:, None] * along) @ axis) <= geometry.length / 2
            case _:  # a sun disk
                distance = np.full(len(origin), 1e30)
                is_hit = -along @ light_axes(geometry.direction)[2] >= math.cos(math.radians(geometry.angle / 2))
    return np.where(is_hit & (distance > 0), distance, np.inf)


def _plane(normal: F64, offset: F64, direction: F64) -> tuple[F64, F64]:
    """Distance to a plane's front, NaN for its back, and the hits. offset: of ray origins from a point on the plane."""
    cosine = -(direction @ normal)
    distance = np.where(cosine > 0, (offset @ normal) / cosine, np.nan)
    return distance, offset + distance[:, None] * direction


def _round(offset: F64, direction: F64, radius: float) -> F64:
    """Distance to the outside of a sphere, or of a cylinder if the axis is projected out; NaN for a miss."""
    a, b = (direction**2).sum(axis=1), (offset * direction).sum(axis=1)
    c = (offset**2).sum(axis=1) - radius**2
    distance: F64 = (-b - np.sqrt(b**2 - a * c)) / a
    return distance
