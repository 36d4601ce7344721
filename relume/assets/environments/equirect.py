"""Equirectangular maps: directions and solid angles of texels, and radiance in a direction.

Direction of (u, v), v from the top: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def texel_directions(height: int, width: int) -> Shaped[F32, "height width 3"]:
    """Unit direction of each texel's center: u = atan2(z, x)/2π + ½, v = ½ − asin(y)/π."""
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    return uv_to_direction(*np.meshgrid(u, v)).astype(np.float32)


def texel_solid_angles(height: int, width: int) -> Shaped[F64, " height"]:
    """Exact solid angle of one texel in each row, in steradian; they sum to 4π / width."""
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    return (2 * np.pi / width) * (edges[:-1] - edges[1:])


def uv_to_direction(u: Shaped[F64, "*batch"], v: Shaped[F64, "*batch"]) -> Shaped[F64, "*batch 3"]:
    """Unit direction of (u, v) in [0, 1]², v from the top."""
    phi, elevation = 2 * np.pi * (u - 0.5), np.pi * (0.5 - v)
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(phi), np.sin(elevation), horizontal * np.sin(phi)], -1)


def direction_to_uv(
    w: Shaped[NDArray[np.floating], "*batch 3"],
) -> tuple[Shaped[F64, "*batch"], Shaped[F64, "*batch"]]:
    """(u, v) in [0, 1]² of unit directions, v from the top."""
    direction = np.asarray(w, np.float64)
    u = np.arctan2(direction[..., 2], direction[..., 0]) / (2 * np.pi) + 0.5
    return u, 0.5 - np.arcsin(np.clip(direction[..., 1], -1, 1)) / np.pi


def halve_to_width(radiance: Shaped[F32, "height width 3"], width: int) -> Shaped[F32, "rows columns 3"]:
    """Average 2 × 2 texels of an equirectangular map until its width is at most `width` or a side is odd."""
    while radiance.shape[1] > width and radiance.shape[0] % 2 == radiance.shape[1] % 2 == 0:
        radiance = 0.25 * (radiance[::2, ::2] + radiance[1::2, ::2] + radiance[::2, 1::2] + radiance[1::2, 1::2])
    return radiance


def rotate_about_y(direction: Shaped[F64, "n 3"], degrees: float) -> Shaped[F64, "n 3"]:
    """Rotate directions about +Y, counterclockwise from above."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(direction @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))


def lookup(radiance: Shaped[F32, "height width 3"], directions: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Radiance of an equirectangular map in unit directions, bilinear and periodic in u."""
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
