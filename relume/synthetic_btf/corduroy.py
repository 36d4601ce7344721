"""Corduroy: soft parallel cords with an uneven pile."""

from __future__ import annotations

import numpy as np

from relume.synthetic_btf.tileable_geometry import Tile, height_field

_CORDS = 4  # per period
_HEIGHT, _PILE = 0.09, 0.012
_STEPS = 112  # of the grid, per side
_WAVES = 10  # largest frequency of the pile's unevenness along the cords
_SEED = 3

TERMS = ({"model": "oren_nayar", "color": [0.62, 0.45, 0.22], "params": {"sigma": 0.6, "albedo": 0.6}},)


def corduroy() -> Tile:
    """Return one period as a height field."""
    u, v = np.meshgrid(np.linspace(0, 1, _STEPS + 1), np.linspace(0, 1, _STEPS + 1), indexing="xy")
    rng = np.random.default_rng(_SEED)
    pile = np.zeros_like(u)
    for _ in range(40):
        across, along = rng.integers(1, 3 * _WAVES), rng.integers(-_WAVES, _WAVES)
        pile += np.cos(2 * np.pi * (across * u + along * v) + rng.uniform(0, 2 * np.pi)) / 40**0.5
    round_top = np.abs(np.sin(np.pi * _CORDS * u)) ** 0.7
    height = _HEIGHT * round_top + _PILE * pile * (0.3 + 0.7 * round_top)
    return Tile.with_single_material(*height_field(height), TERMS)
