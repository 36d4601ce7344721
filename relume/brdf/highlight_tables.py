"""Tables of a highlight's reflection of direct light between patches; the basis blurs a highlight to 30°.

    T(b, s) = ∫_s f(ω_b, ωo) cos θo dωo / ∫_s cos θo dωo

over the outgoing direction bins s of patches (`relume.math.direction_grid`), for light from the centers ω_b of finer
bins; the sum over all s has the exact energy of the term. By isotropy and reflection symmetry, one eighth of the fine
bins suffices.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.quadrature import Quadrature
from relume.brdf.symmetry import is_isotropic, rotational_symmetry
from relume.core.thread_pools import parallel_for_chunks
from relume.math.direction_grid import NUM_DIRECTION_BINS, bin_centers, bin_index, bin_solid_angles, fine_bin_centers

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_RADII, _NUM_AROUND = 48, 48
_CENTER_WEIGHT = 1e-6  # weight of a bin's center, which matters only if the bin has no other sample
_ROTATIONS = [rotational_symmetry(np.pi * (k + 0.5) / 4) for k in range(4)]  # for anisotropic terms


@lru_cache(maxsize=64)
def lobe_table(term: FrozenTerm) -> Shaped[F32, "fine_bins 3 bins"]:
    """Table T of a term, in 1/sr; for an anisotropic term the mean over rotations about the normal.

    Args:
        term: of a complete look, with a white color (`relume.brdf.albedo.white_term`).
    """
    pairs = _pairs()
    values = _values(term.document, pairs.quadrature)
    arrays = pairs.weight, pairs.bin_indices, pairs.total, pairs.area
    table = np.empty((values.shape[1], len(values), NUM_DIRECTION_BINS), np.float32)
    parallel_for_chunks(lambda start, stop: _fill_bins(values, *arrays, start, stop, table), len(table))
    return np.broadcast_to(table, (len(table), 3, NUM_DIRECTION_BINS))  # one channel stands for three equal ones


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _fill_bins(values, weight, bin_indices, total, area, start, stop, table):  # type: ignore[no-untyped-def]
    """Average a term over the outgoing bins, for the incident bins [start, stop), scaled to its energy.

    Args:
        values: f of each pair. (channels, fine bins, n)
        weight, bin_indices, total, area: see `_DirectionPairs`. table: (fine bins, channels, bins)
    """
    mean = np.empty(area.shape[0])
    for b in range(start, stop):
        for channel in range(values.shape[0]):
            mean[:] = 0
            energy = 0.0
            for n in range(weight.shape[1]):
                weighted = values[channel, b, n] * weight[b, n]
                mean[bin_indices[b, n]] += weighted
                energy += weighted
            binned = 0.0
            for s in range(area.shape[0]):
                mean[s] /= max(total[b, s], 1e-30)
                binned += mean[s] * area[s]
            for s in range(area.shape[0]):
                table[b, channel, s] = mean[s] * (energy / binned)


def _values(document: Mapping[str, Any], pairs: Quadrature) -> F64:
    """f at pairs of directions. (1 or 3, bins, n)"""
    if is_isotropic(document):
        return pairs.values(document)
    rotated = [eval_brdf(document, pairs.wi @ rotation.T, pairs.wo @ rotation.T) for rotation in _ROTATIONS]
    return np.moveaxis(np.mean(rotated, axis=0), -1, 0)


class _DirectionPairs:
    """Directions ωo around the mirror direction of each fine bin, and the centers of all bins.

    With θr the angle from the mirror direction, θr = π u³ and dωo = 3π u² sin θr du dφr, dense for narrow highlights.

    Attributes:
        weight: cos θo dωo. (fine bins, n). bin_indices: bin of each ωo. (fine bins, n)
        total: Σ cos θo dωo of each bin. (fine bins, bins). area: ∫ cos θo dωo over each bin. (bins,)
    """

    def __init__(self) -> None:
        wi = fine_bin_centers()
        u = (np.arange(_NUM_RADII) + 0.5) / _NUM_RADII
        theta, phi = np.pi * u**3, 2 * np.pi * (np.arange(_NUM_AROUND) + 0.5) / _NUM_AROUND
        solid_angle = np.repeat(3 * np.pi * u**2 * np.sin(theta), _NUM_AROUND) * (
            2 * np.pi / (_NUM_RADII * _NUM_AROUND)
        )
        local_directions = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi)),
                          np.repeat(np.cos(theta)[:, None], _NUM_AROUND, axis=1)], axis=-1).reshape(-1, 3)  # fmt: skip
        reflected = np.einsum("nj,bji->bni", local_directions, _frames(wi * [-1, -1, 1]))
        centers = np.broadcast_to(bin_centers(), (len(wi), NUM_DIRECTION_BINS, 3))
        wo = np.concatenate([reflected, centers], axis=1)
        above = np.maximum(reflected[..., 2], 0)
        self.area = bin_solid_angles()
        center_weight = np.broadcast_to(_CENTER_WEIGHT * self.area, (len(wi), NUM_DIRECTION_BINS))
        self.weight = np.concatenate([solid_angle * above, center_weight], axis=1)
        at_centers = np.broadcast_to(np.arange(NUM_DIRECTION_BINS), center_weight.shape)
        self.bin_indices = np.concatenate([bin_index(reflected), at_centers], axis=1).astype(np.int16)
        self.total = np.stack(
            [
                np.bincount(bin_indices, weight, NUM_DIRECTION_BINS)
                for bin_indices, weight in zip(self.bin_indices, self.weight, strict=True)
            ]
        )
        self.quadrature = Quadrature(wi[:, None], wo)


@lru_cache(maxsize=1)
def _pairs() -> _DirectionPairs:
    return _DirectionPairs()


def _frames(axis: F64) -> F64:
    """Frames with given z axes; rows are axes. axis: (b, 3). (b, 3, 3)"""
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
