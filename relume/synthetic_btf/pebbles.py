"""Pebbles: round stones of different sizes in sand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.synthetic_btf.tileable_geometry import Tile

_STONES = 46
_RADII = 0.05, 0.13
_FLAT = 0.55  # height over width
_RINGS = 10
_TRIES = 4000
_SEED = 8

TERMS = (
    {"model": "lambert", "color": [0.36, 0.34, 0.31]},
    {"model": "ggx", "color": [0.8, 0.8, 0.8], "params": {"roughness": 0.55, "f0": 0.04}},
)
F64 = NDArray[np.float64]


def pebbles() -> Tile:
    """Return one period: ellipsoids, half buried in a plane."""
    centers, radii = _scatter_stones(np.random.default_rng(_SEED))
    theta, phi = np.linspace(0, 0.62 * np.pi, _RINGS + 1), np.arange(2 * _RINGS) * (np.pi / _RINGS)
    t, p = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    unit = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
    ring_size = 2 * _RINGS
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(_RINGS), np.arange(ring_size), indexing="ij"))
    a, b = i * ring_size + j, i * ring_size + (j + 1) % ring_size
    faces = np.concatenate(
        [np.stack([a, a + ring_size, b], axis=1), np.stack([b, a + ring_size, b + ring_size], axis=1)]
    )
    faces = faces[~((faces < ring_size).sum(axis=1) > 1)]  # the first ring is a point at the pole
    shape = np.array([1, 1, _FLAT])
    normal = unit / shape
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    count, base_positions = len(unit), np.column_stack([centers, 0.15 * radii])
    stones = base_positions[:, None] + radii[:, None, None] * shape * unit
    plane = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    numbers, num = np.arange(len(radii)), len(radii)
    return Tile.with_single_material(
        np.concatenate([stones.reshape(-1, 3), plane]),
        np.concatenate([np.tile(normal, (num, 1)), np.tile([0.0, 0, 1], (4, 1))]),
        np.concatenate(
            [(faces + count * numbers[:, None, None]).reshape(-1, 3), np.array([[0, 1, 2], [0, 2, 3]]) + count * num]
        ),
        TERMS,
    )


def _scatter_stones(rng: np.random.Generator) -> tuple[F64, F64]:
    """Positions and radii of stones that hardly touch, the largest first. (n, 2) and (n,)"""
    radii = np.sort(rng.uniform(*_RADII, _STONES))[::-1]
    centers: list[F64] = []
    placed_radii: list[float] = []
    for radius in radii:
        for _ in range(_TRIES // _STONES):
            candidate = rng.random(2)
            offsets = np.array(centers).reshape(-1, 2) - candidate
            offsets -= np.rint(offsets)  # periodic
            if not centers or (np.linalg.norm(offsets, axis=1) > 0.92 * (np.array(placed_radii) + radius)).all():
                centers.append(candidate)
                placed_radii.append(float(radius))
                break
    return np.array(centers), np.array(placed_radii)
