"""Wood grain as a texture: growth rings cut lengthwise, with fine pores, from seeded noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from relume.scene.model import Texture

F64 = NDArray[np.float64]

SIZE = 512
LIGHT = np.array([0.300, 0.128, 0.046])
DARK = np.array([0.085, 0.029, 0.010])


def wood() -> Texture:
    """Return linear RGB reflectance with the grain along u, 512 × 512 texels."""
    rng = np.random.default_rng(1975)
    v = np.linspace(0, 1, SIZE)[:, None]
    wander = 0.16 * _noise(rng, 5, 2) + 0.035 * _noise(rng, 14, 5)
    ring = (v * 9.0 + 2.6 * wander + 0.9 * np.abs(v - 0.45)) % 1.0
    late_wood = ring**2.4 * np.clip((1 - ring) * 14, 0, 1)
    streaks = 0.5 * _noise(rng, 128, 3) + 0.5 * _noise(rng, 256, 10)
    pores = np.clip(_noise(rng, 400, 26) - 0.45, 0, 1)
    darkness = np.clip(0.16 + 0.62 * late_wood + 0.20 * streaks + 0.5 * pores, 0, 1)[..., None]
    pixels = LIGHT + (DARK - LIGHT) * darkness
    return Texture(np.ascontiguousarray(pixels.astype(np.float32)))


def _noise(rng: np.random.Generator, rows: int, columns: int) -> F64:
    """Smooth noise in about [-1, 1] with `rows` features vertically and `columns` horizontally. (SIZE, SIZE)"""
    coarse = rng.uniform(-1, 1, (rows + 1, columns + 1))
    fine = zoom(coarse, (SIZE / (rows + 1), SIZE / (columns + 1)), order=3, grid_mode=True, mode="nearest")
    return np.asarray(fine[:SIZE, :SIZE], np.float64)
