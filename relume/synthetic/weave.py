"""Plain weave: yarns that go over and under each other by turns, warp and weft."""

from __future__ import annotations

import numpy as np

from relume.synthetic.tile import Tile, swept

_YARNS = 16  # a period, in each direction; even
_STEPS, _AROUND = 8, 10  # of a yarn's path a crossing, and of its cross-section
_WIDTH, _FLAT, _LIFT = 0.43, 0.45, 0.42  # radius and lift in shares of the spacing
_UNEVEN = 0.12  # of these
_WAVES = 3  # of a yarn that lies unevenly, a period
_SEED = 5

TERMS = (
    {"model": "lambert", "color": [0.42, 0.13, 0.09]},
    {"model": "blinn_phong", "color": [0.05, 0.045, 0.04], "params": {"exponent": 24.0}},
)


def weave() -> Tile:
    """One period of it."""
    spacing, rng = 1 / _YARNS, np.random.default_rng(_SEED)
    s = np.arange(-1, _YARNS * _STEPS + 2) / (_YARNS * _STEPS)
    parts = []
    for direction in range(2):
        for yarn in range(_YARNS):
            wide, lift = 1 + _UNEVEN * rng.normal(size=2).clip(-1.5, 1.5)
            wave = _UNEVEN * spacing * np.cos(2 * np.pi * (_WAVES * s + rng.random()))
            across = (yarn + 0.5) * spacing + wave
            height = lift * _LIFT * spacing * np.cos(np.pi * (s / spacing - 0.5 + yarn + direction))
            path = np.stack([s, across, height] if direction == 0 else [across, s, height], axis=1)
            parts.append(swept(path, min(wide, 1.12) * _WIDTH * spacing, _AROUND, _FLAT))
    counts = np.cumsum([0, *(len(part[0]) for part in parts)])
    positions, normals = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    faces = np.concatenate([part[2] + start for part, start in zip(parts, counts, strict=False)])
    return Tile.of_one(positions, normals, faces, TERMS)
