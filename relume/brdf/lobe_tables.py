"""What a highlight sends of light that comes straight to a surface, tabulated: few functions make it 30° wide.

    T(b, s) = ∫_s f(ω_b, ωo) cos θo dωo / ∫_s cos θo dωo

over squares s of the grid by which gather cells send (`relume.basis.lobe_grid`), for light from the middles ω_b of
finer bins; all squares together send what the term does. A term that looks the same from all around and in a mirror is
known from one eighth of all bins.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import NUM_SQUARES, bin_middles, square_areas, square_middles, squares_of
from relume.brdf.evaluate import eval_brdf
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import about_normal, is_isotropic

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_RADII, _NUM_AROUND = 48, 48
_LITTLE = 1e-6  # weight of the middle of a square, which counts where nothing else lies in it
_TURNS = [about_normal(np.pi * (k + 0.5) / 4) for k in range(4)]  # of a term that looks different from there


@lru_cache(maxsize=64)
def lobe_table(term_text: str) -> F32:
    """T of a term: the mean over turns about the normal where it looks different from there.

    Args:
        term_text: one term of a complete look, as JSON, its colour white (`relume.brdf.albedo.white_text`).
    Returns:
        1/sr. (bins, 3 channels, `NUM_SQUARES`) float32
    """
    document, pairs = json.loads(term_text), _pairs()
    value = _values(document, pairs.quadrature)
    found = np.empty((len(value[0]), 3, NUM_SQUARES), np.float32)
    for channel in range(3):
        of = value[channel % len(value)] * pairs.weight
        for b, square in enumerate(pairs.square):
            mean = np.bincount(square, of[b], NUM_SQUARES) / np.maximum(pairs.total[b], 1e-30)
            found[b, channel] = mean * (of[b].sum() / (mean @ pairs.area))
    return found


def _values(document: Mapping[str, Any], pairs: Quadrature) -> F64:
    """f at pairs of directions. (1 or 3, bins, n)"""
    if is_isotropic(document):
        return pairs.values(document)
    turned = [eval_brdf(document, pairs.wi @ turn.T, pairs.wo @ turn.T) for turn in _TURNS]
    return np.moveaxis(np.mean(turned, axis=0), -1, 0)


class _Pairs:
    """Directions ωo about where light from each bin is mirrored to, and the middles of all squares.

    With θr the angle from the mirror direction, θr = π u³ and dωo = 3π u² sin θr du dφr, as narrow highlights want it.

    Attributes:
        weight: cos θo dωo. (bins, n). square: that each ωo is in. (bins, n)
        total: Σ cos θo dωo of each square. (bins, squares). area: ∫ cos θo dωo over it. (squares,)
    """

    def __init__(self) -> None:
        wi = bin_middles()
        u = (np.arange(_NUM_RADII) + 0.5) / _NUM_RADII
        theta, phi = np.pi * u**3, 2 * np.pi * (np.arange(_NUM_AROUND) + 0.5) / _NUM_AROUND
        solid = np.repeat(3 * np.pi * u**2 * np.sin(theta), _NUM_AROUND) * (2 * np.pi / (_NUM_RADII * _NUM_AROUND))
        about = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi)),
                          np.repeat(np.cos(theta)[:, None], _NUM_AROUND, axis=1)], axis=-1).reshape(-1, 3)  # fmt: skip
        mirrored = np.einsum("nj,bji->bni", about, _frames(wi * [-1, -1, 1]))
        middles = np.broadcast_to(square_middles(), (len(wi), NUM_SQUARES, 3))
        wo = np.concatenate([mirrored, middles], axis=1)
        above = np.maximum(mirrored[..., 2], 0)
        self.area = square_areas()
        little = np.broadcast_to(_LITTLE * self.area, (len(wi), NUM_SQUARES))
        self.weight = np.concatenate([solid * above, little], axis=1)
        at_middles = np.broadcast_to(np.arange(NUM_SQUARES), little.shape)
        self.square = np.concatenate([squares_of(mirrored), at_middles], axis=1)
        self.total = np.stack(
            [np.bincount(square, weight, NUM_SQUARES) for square, weight in zip(self.square, self.weight, strict=True)]
        )
        self.quadrature = Quadrature(wi[:, None], wo)


@lru_cache(maxsize=1)
def _pairs() -> _Pairs:
    return _Pairs()


def _frames(axis: F64) -> F64:
    """Frames whose z axes are given directions, their rows the axes. axis: (b, 3). (b, 3, 3)"""
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
