"""Outgoing radiance of BTFs in plain NumPy, texel by texel: the reference of the kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import interpolation_weights_numpy
from relume.assets.btf.local_pca_btf import F32, LocalPcaBtf
from relume.assets.btf.parallax import _MAX_STEPS, compute_shears

F64 = NDArray[np.float64]

_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


def parallax_intersection_numpy(height: F32, uv: F64, shear: F64) -> float:
    """Reference of `parallax_intersection` in plain NumPy.

    Args:
        height: of the relief. (height, width). uv: u and v, in repeats. (2,). shear: s of the ray. (2,)
    """
    size = np.array(height.shape[::-1])
    low, high = float(height.min()), float(height.max())
    steps = int(np.clip(np.ceil(2 * np.max(np.abs(shear) * size) * (high - low)), 1, _MAX_STEPS))
    z = np.linspace(high, low, steps + 1)
    texel_positions = (uv + z[:, None] * shear * [1, -1]) * size - 0.5
    first = np.floor(texel_positions).astype(int)
    fraction = texel_positions - first
    surface_height = np.zeros(len(z))
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = np.abs(1 - right - fraction[:, 0]) * np.abs(1 - down - fraction[:, 1])
        surface_height += weight * height[(first[:, 1] + down) % size[1], (first[:, 0] + right) % size[0]]
    clearance = z - surface_height
    hits = np.flatnonzero(clearance[1:] <= 0)
    if not len(hits):
        return low
    k = hits[0]
    return float(z[k] + (z[k + 1] - z[k]) * clearance[k] / max(clearance[k] - clearance[k + 1], 1e-9))


def sample_btf_numpy(btf: LocalPcaBtf, texel_positions: F64, wo: F64) -> F64:
    """Mean outgoing radiance over texel positions toward `wo`, for light from each measured direction.

    Args:
        btf: the BTF. wo: view direction in the texture's frame, unit. (3,)
        texel_positions: column and row, in texels of the finest level, from the center of the first. (n, 2)
    Returns:
        (L, 3) float64, including the cosine
    """
    size, shears = np.array(btf.size[::-1]), compute_shears(btf.grid)
    shear = wo[:2] / max(wo[2], np.hypot(wo[0], wo[1]) / np.tan(btf.grid.theta[-1]))
    height = np.array(
        [parallax_intersection_numpy(btf.height, (position + 0.5) / size, shear) for position in texel_positions]
    )
    view, view_weight, _ = interpolation_weights_numpy(btf.grid, wo[None])
    values_by_light = np.zeros((btf.grid.num_directions, 3))
    for side, side_weight in zip(view[0], view_weight[0], strict=True):
        shifted_positions = texel_positions + height[:, None] * (shear - shears[side]) * [1, -1] * size
        first = np.floor(shifted_positions).astype(int)
        corner_weight = np.abs(1 - _CORNERS - (shifted_positions - first)[:, None]).prod(axis=2) / len(texel_positions)
        column, row = np.moveaxis((first[:, None] + _CORNERS) % size, 2, 0)
        values_by_light += side_weight * btf.evaluate(side, (row * size[0] + column).ravel(), corner_weight.ravel())
    return values_by_light


def outgoing_radiance_numpy(btf: LocalPcaBtf, values_by_light: F64, wi: F64) -> F64:
    """Outgoing radiance for light from directions with unit irradiance perpendicular to each.

    Args:
        btf: the BTF. values_by_light: from `sample_btf_numpy`. wi: in the texture's frame, unit. (m, 3)
    Returns:
        (m, 3) float64
    """
    light, light_weight, cosine_ratio = interpolation_weights_numpy(btf.grid, wi)
    return np.asarray(np.einsum("mk,m,mkc->mc", light_weight, cosine_ratio, values_by_light[light]))
