"""Flat materials for benchmarks, from images of heights and colors like those of `relume material make-btf`.

Images have as many pixels a side as the BTF has texels.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import KDTree

from relume.synthetic_btf.from_images import ReliefTile
from relume.synthetic_btf.tileable_geometry import Tile

F64 = NDArray[np.float64]


def felt(side: int) -> Tile:
    """Gray and green fibers, pressed flat: fine unevenness, almost matte."""
    fibers, tufts = _noise(side, 1, 24.0), _noise(side, 2, 8.0)
    shade = 0.5 + 0.16 * fibers + 0.06 * tufts
    return _tile(fibers, shade[..., None] * np.array([0.66, 0.84, 0.6]), relief=0.012, roughness=1.0)


def leather(side: int) -> Tile:
    """Brown cells between creases, half glossy."""
    points = np.random.default_rng(3).random((220, 2))
    nearest, _ = KDTree(points, boxsize=1).query(_centers(side), k=2)
    cells = np.clip((nearest[..., 1] - nearest[..., 0]) / 0.03, 0, 1) ** 0.7
    shade = 0.55 + 0.25 * cells + 0.04 * _noise(side, 4, 16.0)
    return _tile(cells, shade[..., None] * np.array([0.75, 0.45, 0.3]), relief=0.012, roughness=0.4)


def print_on_paper(side: int) -> Tile:
    """Smooth paper with colored stripes, dots and shades."""
    u, v = np.moveaxis(_centers(side), -1, 0)
    dots = (np.hypot((8 * u) % 1 - 0.5, (8 * v) % 1 - 0.5) < 0.3).astype(float)
    colors = 0.5 + 0.4 * np.cos(2 * np.pi * np.stack([u + v, 2 * u - v, 3 * v], axis=-1))
    colors = np.where(dots[..., None] > 0, colors[..., ::-1], colors)
    stripes = (np.abs(v % 0.25 - 0.02) < 0.015)[..., None]
    return _tile(None, np.where(stripes, 0.08, colors), relief=0.01, roughness=0.5)


FLAT_MATERIALS: dict[str, Callable[[int], Tile]] = {"felt": felt, "leather": leather, "print": print_on_paper}


def _centers(side: int) -> F64:
    """u and v of the centers of pixels. (side, side, 2)"""
    v, u = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2, indexing="ij")
    return np.stack([u, v], axis=-1)


def _noise(side: int, seed: int, frequency: float) -> F64:
    """Periodic Gaussian noise of variance one around a frequency per period. (side, side)"""
    frequencies = np.fft.fftfreq(side, 1 / side)
    radius = np.hypot(frequencies[:, None], frequencies)
    spectrum = np.exp(-(((radius - frequency) / frequency) ** 2))
    spectrum[0, 0] = 0
    noise = np.fft.ifft2(np.fft.fft2(np.random.default_rng(seed).normal(size=(side, side))) * spectrum).real
    return np.asarray(noise / noise.std())


def _tile(height: F64 | None, colors: F64, relief: float, roughness: float) -> Tile:
    """Write the images as a user would, and read them."""
    with tempfile.TemporaryDirectory() as folder:
        height_path, color_path = Path(folder) / "height.png", Path(folder) / "color.png"
        if height is not None:
            unit = (height - height.min()) / np.ptp(height)
            Image.fromarray(np.rint(65535 * unit).astype(np.uint16)).save(height_path)
        Image.fromarray(np.rint(255 * colors.clip(0, 1)).astype(np.uint8)).save(color_path)
        return ReliefTile(None if height is None else height_path, color_path, relief, roughness).read()
