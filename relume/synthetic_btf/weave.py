"""Plain weave: warp and weft yarns that alternate over and under each other."""

from __future__ import annotations

import numpy as np

from relume.synthetic_btf.tileable_geometry import Tile, extruded

_YARNS = 16  # per period, in each direction; even
_STEPS, _AROUND = 8, 10  # segments of a yarn between crossings, and corners of its cross-section
_WIDTH, _FLAT, _LIFT = 0.43, 0.45, 0.42  # radius and amplitude as fractions of the spacing
_UNEVENNESS = 0.12  # of radius and amplitude
_WAVES = 3  # of a yarn's sideways wave, per period
_SEED = 5

TERMS = (
    {"model": "lambert", "color": [0.42, 0.13, 0.09]},
    {"model": "blinn_phong", "color": [0.05, 0.045, 0.04], "params": {"exponent": 24.0}},
)


def weave() -> Tile:
    """Return one period."""
    spacing, rng = 1 / _YARNS, np.random.default_rng(_SEED)
    s = np.arange(-1, _YARNS * _STEPS + 2) / (_YARNS * _STEPS)
    yarn_meshes = []
    for direction in range(2):
        for yarn in range(_YARNS):
            width_scale, lift = 1 + _UNEVENNESS * rng.normal(size=2).clip(-1.5, 1.5)
            wave = _UNEVENNESS * spacing * np.cos(2 * np.pi * (_WAVES * s + rng.random()))
            across = (yarn + 0.5) * spacing + wave
            height = lift * _LIFT * spacing * np.cos(np.pi * (s / spacing - 0.5 + yarn + direction))
            path = np.stack([s, across, height] if direction == 0 else [across, s, height], axis=1)
            yarn_meshes.append(extruded(path, min(width_scale, 1.12) * _WIDTH * spacing, _AROUND, _FLAT))
    counts = np.cumsum([0, *(len(yarn_mesh[0]) for yarn_mesh in yarn_meshes)])
    positions, normals = (np.concatenate([yarn_mesh[k] for yarn_mesh in yarn_meshes]) for k in (0, 1))
    faces = np.concatenate([yarn_mesh[2] + start for yarn_mesh, start in zip(yarn_meshes, counts, strict=False)])
    return Tile.with_single_material(positions, normals, faces, TERMS)
