"""Equirectangular maps: the direction of a texel, its solid angle, and the radiance in a direction.

The direction of (u, v), v from the top: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def texel_directions(height: int, width: int) -> F32:
    """Unit direction of each texel's centre: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π. (height, width, 3)"""
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    return uv_to_direction(*np.meshgrid(u, v)).astype(np.float32)


def texel_solid_angles(height: int, width: int) -> F64:
    """Solid angle of the texels of each row, exact, in steradian; they sum to 4π / width. (height,)"""
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    return (2 * np.pi / width) * (edges[:-1] - edges[1:])


def uv_to_direction(u: F64, v: F64) -> F64:
    """Unit direction of (u, v) in [0, 1]², v from the top. (..., 3)"""
    phi, elevation = 2 * np.pi * (u - 0.5), np.pi * (0.5 - v)
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(phi), np.sin(elevation), horizontal * np.sin(phi)], -1)


def direction_to_uv(w: NDArray[np.floating]) -> tuple[F64, F64]:
    """(u, v) in [0, 1]² of unit directions (..., 3), v from the top."""
    direction = np.asarray(w, np.float64)
    u = np.arctan2(direction[..., 2], direction[..., 0]) / (2 * np.pi) + 0.5
    return u, 0.5 - np.arcsin(np.clip(direction[..., 1], -1, 1)) / np.pi


def halve_to_width(radiance: F32, width: int) -> F32:
    """An equirectangular map halved, by means of 2 × 2 texels, until it is at most so wide or has an odd side."""
    while radiance.shape[1] > width and radiance.shape[0] % 2 == radiance.shape[1] % 2 == 0:
        radiance = 0.25 * (radiance[::2, ::2] + radiance[1::2, ::2] + radiance[::2, 1::2] + radiance[1::2, 1::2])
    return radiance


def rotate_about_y(direction: F64, degrees: float) -> F64:
    """Directions turned about +Y, counter-clockwise seen from above. (n, 3)"""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(direction @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))


def lookup(radiance: F32, directions: F32) -> F32:
    """Radiance of an equirectangular map in unit directions (n, 3), bilinear, round about in u. (n, 3) float32"""
    height, width, _ = radiance.shape
    u, v = direction_to_uv(directions)
    x, y = u * width - 0.5, np.clip(v * height - 0.5, 0, height - 1)
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    left, right = x0.astype(np.intp) % width, (x0.astype(np.intp) + 1) % width
    upper = y0.astype(np.intp)
    lower = np.minimum(upper + 1, height - 1)
    top = radiance[upper, left] * (1 - fx) + radiance[upper, right] * fx
    bottom = radiance[lower, left] * (1 - fx) + radiance[lower, right] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, np.float32)
