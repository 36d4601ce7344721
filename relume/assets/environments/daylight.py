"""Daylight environments of 512 × 256 texels over a dull ground, with the sun in front to the right, as bright as the
studio.

Luminance is that of the CIE's sky models (Moon and Spencer 1942; Kittler 1967); colors and the ratio of sunlight are
chosen for their appearance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.core.color import luminance

F64 = NDArray[np.float64]

HEIGHT, WIDTH = 256, 512
MEAN_LUMINANCE = 1.04  # over the sphere, as in the studio, so that all environments need the same exposure
SUN_AZIMUTH = 55.0
SUN_SPREAD = 2e-4  # 1 − cos γ at which the sun's glow falls to 1/e: γ = 1.1°, a texel and a half
GROUND = np.array([0.16, 0.15, 0.13])


def clear_day() -> Environment:
    """Return a high sun with luminance (0.91 + 10 e^(−3γ) + 0.45 cos² γ)(1 − e^(−0.32 / sin θ)) (Kittler 1967)."""
    return _clear("clear sky", 48.0, np.array([0.30, 0.52, 1.0]), np.array([0.62, 0.78, 1.0]), (1.0, 0.94, 0.82), 4.0)


def sunset() -> Environment:
    """Return a low sun with the same luminance: dark blue above, warm at the horizon."""
    return _clear("sunset", 5.0, np.array([0.22, 0.32, 0.62]), np.array([1.0, 0.46, 0.22]), (1.0, 0.44, 0.13), 1.5)


def overcast() -> Environment:
    """Return an environment without sun, with luminance (1 + 2 sin θ) / 3 of the zenith's (Moon and Spencer 1942)."""
    y = texel_directions(HEIGHT, WIDTH)[..., 1:2].astype(np.float64)
    above = (1 + 2 * np.clip(y, 0, 1)) / 3 * np.array([0.93, 0.97, 1.0])
    return _with_ground("overcast", y, above, ground_light=0.8)


def _clear(
    name: str, elevation: float, zenith: F64, horizon: F64, sun_color: tuple[float, ...], sun_ratio: float
) -> Environment:
    """A clear day: Kittler's luminance with colors, a sun and a ground.

    Args:
        elevation: elevation of the sun, degrees. zenith, horizon: colors. (3,) each
        sun_color: color of the sun.
        sun_ratio: the sun's irradiance perpendicular to its direction, over the diffuse irradiance of the ground.
    """
    w = texel_directions(HEIGHT, WIDTH).astype(np.float64)
    a, e = np.radians(SUN_AZIMUTH), np.radians(elevation)
    cosine = (w @ [np.cos(a) * np.cos(e), np.sin(e), np.sin(a) * np.cos(e)])[..., None]
    y = w[..., 1:2]
    sine = np.clip(y, 0.02, 1)  # Kittler's formula has a pole at the horizon
    gamma = np.arccos(np.clip(cosine, -1, 1))
    law = (0.91 + 10 * np.exp(-3 * gamma) + 0.45 * cosine**2) * (1 - np.exp(-0.32 / sine))
    color = horizon + (zenith - horizon) * sine**0.5
    above = law * (color + (np.array(sun_color) - color) * np.exp(-3 * gamma))
    irradiance = _integral(_luminance(above) * np.clip(y, 0, 1))
    glow = np.exp((cosine - 1) / SUN_SPREAD) * (y > 0)
    glow *= sun_ratio * irradiance / _integral(glow)
    ground_light = (1 + sun_ratio * np.sin(e)) * irradiance / np.pi
    return _with_ground(name, y, above + glow * np.array(sun_color), ground_light)


def _with_ground(name: str, y: F64, above: F64, ground_light: float) -> Environment:
    """Add a dull ground below the horizon, and scale to the common mean luminance."""
    radiance = np.where(y > 0, above, ground_light * GROUND)
    mean = _integral(_luminance(radiance)) / (4 * np.pi)
    return Environment(name, (radiance * (MEAN_LUMINANCE / mean)).astype(np.float32))


def _luminance(radiance: F64) -> F64:
    return luminance(radiance.astype(np.float32))[..., None].astype(np.float64)


def _integral(values: F64) -> float:
    """Integral over the sphere. values: (height, width, 1)"""
    return float((values[..., 0] * texel_solid_angles(HEIGHT, WIDTH)[:, None]).sum())
