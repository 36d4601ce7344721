"""Pebbles: round stones of many sizes in sand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.synthetic.tile import Tile

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
    """One period of it: ellipsoids, half in a plane."""
    centres, radii = _strewn(np.random.default_rng(_SEED))
    theta, phi = np.linspace(0, 0.62 * np.pi, _RINGS + 1), np.arange(2 * _RINGS) * (np.pi / _RINGS)
    t, p = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    unit = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
    around = 2 * _RINGS
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(_RINGS), np.arange(around), indexing="ij"))
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, a + around, b], axis=1), np.stack([b, a + around, b + around], axis=1)])
    faces = faces[~((faces < around).sum(axis=1) > 1)]  # at the pole a ring is a point
    shape = np.array([1, 1, _FLAT])
    normal = unit / shape
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    count, place = len(unit), np.column_stack([centres, 0.15 * radii])
    stones = place[:, None] + radii[:, None, None] * shape * unit
    plane = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    numbers, num = np.arange(len(radii)), len(radii)
    return Tile.of_one(
        np.concatenate([stones.reshape(-1, 3), plane]),
        np.concatenate([np.tile(normal, (num, 1)), np.tile([0.0, 0, 1], (4, 1))]),
        np.concatenate(
            [(faces + count * numbers[:, None, None]).reshape(-1, 3), np.array([[0, 1, 2], [0, 2, 3]]) + count * num]
        ),
        TERMS,
    )


def _strewn(rng: np.random.Generator) -> tuple[F64, F64]:
    """Places and radii of stones that hardly touch, the largest first. (n, 2) and (n,)"""
    radii = np.sort(rng.uniform(*_RADII, _STONES))[::-1]
    places: list[F64] = []
    kept: list[float] = []
    for radius in radii:
        for _ in range(_TRIES // _STONES):
            place = rng.random(2)
            apart = np.array(places).reshape(-1, 2) - place
            apart -= np.rint(apart)  # beside the square is the next
            if not places or (np.linalg.norm(apart, axis=1) > 0.92 * (np.array(kept) + radius)).all():
                places.append(place)
                kept.append(float(radius))
                break
    return np.array(places), np.array(kept)
