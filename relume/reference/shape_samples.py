"""Stratified points on discs, spheres and tubes, uniform by area, and directions to sun disks; float64."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import ArrayLike, NDArray

from relume.look.model import DirectionalLook, DiscLook, LightLook, SphereLook, TubeLook

F64 = NDArray[np.float64]


class SurfaceSamples(NamedTuple):
    """Points on a surface. position: meters. normal: unit. area: of the surface, m²."""

    position: Shaped[F64, "n m 3"]
    normal: Shaped[F64, "n m 3"]
    area: float


def sample_shape(light: LightLook, num_points: int, num: int, rng: np.random.Generator) -> SurfaceSamples | None:
    """Sample the surface of a light for each of n points; None for a light of another kind.

    Args:
        light: the light. num_points: n. num: number of samples of each. rng: random number generator.
    """
    if isinstance(light, DiscLook):
        offset, normal, area = _disc(light, num_points, num, rng)
    elif isinstance(light, SphereLook):
        u, v = strata(num_points, num, rng)
        height, azimuth = 1 - 2 * u, 2 * np.pi * v
        sine = np.sqrt(1 - height**2)
        normal = np.concatenate([sine * np.cos(azimuth), height, sine * np.sin(azimuth)], axis=2)
        offset, area = light.radius * normal, 4 * np.pi * light.radius**2
    elif isinstance(light, TubeLook):
        offset, normal, area = _tube(light, num_points, num, rng)
    else:
        return None
    return SurfaceSamples(np.array(light.position) + offset, normal, area)


def sample_sun(light: DirectionalLook, num_points: int, num: int, rng: np.random.Generator) -> tuple[F64, float]:
    """Sample directions to a sun disk, uniform by solid angle.

    Args:
        light: the light. num_points: n. num: number of samples of each. rng: random number generator.
    Returns:
        Unit directions (n, m, 3), and the irradiance facing each, of a light of unit irradiance.
    """
    axis, across, up = _axes(light.direction)
    half_angle = np.radians(light.angle / 2)
    u, v = strata(num_points, num, rng)
    cosine, azimuth = 1 - (1 - np.cos(half_angle)) * u, 2 * np.pi * v
    sine = np.sqrt(1 - cosine**2)
    direction = sine * (np.cos(azimuth) * across + np.sin(azimuth) * up) - cosine * axis
    solid_angle = 2 * np.pi * (1 - np.cos(half_angle))
    return direction, float(solid_angle / (np.pi * np.sin(half_angle) ** 2 * direction.shape[1]))


def strata(num_points: int, num: int, rng: np.random.Generator) -> tuple[Shaped[F64, "n m 1"], Shaped[F64, "n m 1"]]:
    """Return a random point of the unit square in each cell of a grid.

    Args:
        num_points: n. num: number of samples of each; m is the nearest square number. rng: generator.
    """
    side = max(1, round(np.sqrt(num)))
    cell = np.stack([*np.divmod(np.arange(side * side), side)])
    u, v = (cell + rng.random((num_points, 2, side * side))).transpose(1, 0, 2)[..., None] / side
    return u, v


def _disc(light: DiscLook, num_points: int, num: int, rng: np.random.Generator) -> tuple[F64, F64, float]:
    axis, across, up = _axes(light.direction)
    u, v = strata(num_points, num, rng)
    radius, azimuth = light.radius * np.sqrt(u), 2 * np.pi * v
    offset = radius * (np.cos(azimuth) * across + np.sin(azimuth) * up)
    return offset, np.broadcast_to(axis, offset.shape), np.pi * light.radius**2


def _tube(light: TubeLook, num_points: int, num: int, rng: np.random.Generator) -> tuple[F64, F64, float]:
    axis, across, up = _axes(light.direction)
    u, v = strata(num_points, num, rng)
    azimuth = 2 * np.pi * v
    normal = np.cos(azimuth) * across + np.sin(azimuth) * up
    along = light.length * (u - 0.5)
    return light.radius * normal + along * axis, normal, 2 * np.pi * light.radius * light.length


def _axes(direction: ArrayLike) -> tuple[F64, F64, F64]:
    """A unit direction and two perpendicular to it."""
    axis = np.asarray(direction, np.float64)
    axis = axis / np.linalg.norm(axis)
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    return axis, across, np.cross(axis, across)
