"""The demo's environment: a dim room with a tall window as key light, a strip as rim light and a small light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions

F64 = NDArray[np.float64]

HEIGHT, WIDTH = 256, 512
CEILING = np.array([0.10, 0.115, 0.15])
HORIZON = np.array([0.15, 0.13, 0.115])
FLOOR = np.array([0.05, 0.04, 0.03])


def studio() -> Environment:
    """Return an equirectangular map of 512×256 texels; +Z is toward the camera."""
    w = texel_directions(HEIGHT, WIDTH).astype(np.float64)
    radiance = _room(w)
    radiance += _window(w)[..., None] * np.array([13.0, 12.7, 12.3])
    strip = _panel(w, azimuth=-38.0, elevation=38.0, half_width=5.0, half_height=26.0, softness=1.5)
    radiance += strip[..., None] * np.array([10.0, 11.5, 14.0])
    fill = _panel(w, azimuth=12.0, elevation=12.0, half_width=24.0, half_height=20.0, softness=14.0)
    radiance += fill[..., None] * np.array([0.70, 0.62, 0.53])
    small_light = _panel(w, azimuth=158.0, elevation=37.0, half_width=1.8, half_height=1.8, softness=0.5)
    radiance += small_light[..., None] * np.array([1600.0, 1220.0, 830.0])
    return Environment("studio", radiance.astype(np.float32))


def _room(w: F64) -> F64:
    """Ceiling, walls and floor as one smooth gradient over elevation, brighter toward the window."""
    y = w[..., 1:2]
    upper = HORIZON + (CEILING - HORIZON) * np.clip(y, 0, 1) ** 0.6
    lower = HORIZON + (FLOOR - HORIZON) * np.clip(-y, 0, 1) ** 0.4
    toward_window = 0.75 + 0.35 * (w @ _direction(186.0, 20.0))[..., None]
    return np.asarray(np.where(y >= 0, upper, lower) * toward_window)


def _window(w: F64) -> F64:
    """Key light: a window with two by three sections, which show in reflections."""
    window = np.zeros(w.shape[:2])
    for column in (-1, 1):
        for row in (-1, 0, 1):
            right, up = 10.4 * column, 14.4 * row
            window += _panel(w, 186.0, 36.0, half_width=9.4, half_height=6.5, softness=0.8, right=right, up=up)
    return window * (0.85 + 0.3 * np.clip(w[..., 1], 0, 1))


def _direction(azimuth: float, elevation: float) -> F64:
    """Direction from azimuth, from +X toward +Z (the camera), and elevation, in degrees."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(a) * np.cos(e), np.sin(e), np.sin(a) * np.cos(e)])


def _panel(
    w: F64,
    azimuth: float,
    elevation: float,
    half_width: float,
    half_height: float,
    softness: float,
    right: float = 0.0,
    up: float = 0.0,
) -> F64:
    """1 inside a rectangle on the tangent plane at a direction, 0 outside, with a smooth edge; sizes in degrees."""
    center = _direction(azimuth, elevation)
    across = np.cross([0.0, 1.0, 0.0], center)
    across /= np.linalg.norm(across)
    forward = w @ center
    distance = np.where(forward > 1e-3, forward, np.inf)
    x = np.degrees(w @ across / distance) - right
    y = np.degrees(w @ np.cross(center, across) / distance) - up
    inside = np.minimum(half_width - np.abs(x), half_height - np.abs(y)) / softness
    t = np.clip(0.5 + inside / 2, 0, 1) * (forward > 1e-3)
    return np.asarray(t * t * (3 - 2 * t))
