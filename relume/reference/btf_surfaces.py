"""Surfaces that are covered with a BTF, as brute force sees them: places drawn within what a pixel covers.

Methods sum means over texels that are as wide as a pixel; here single texels are looked up, of the finest level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.outgoing_radiance import outgoing_radiance, sample_btf
from relume.brdf.terms.btf import BtfRef

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_STRATA = 2  # strata along each side of what a pixel covers
_LEAST_COSINE = 1e-3


@dataclass(frozen=True)
class BtfSurface:
    """What some points send that are covered.

    Attributes:
        texels: by which. samples: of each point, from `relume.assets.btf.outgoing_radiance.sample_btf`; nothing below
            the horizon. (n, L, 3)
        axes: of the texture, in the points' frames. (n, 2, 2)
    """

    texels: BtfRef
    samples: F32
    axes: F64

    def evaluate(self, point_index: NDArray[np.int64], wi: F64) -> F64:
        """BRDF times cos θi of some of the points.

        Args:
            point_index: which, for each direction. (m,). wi: in the frames of these, z = normal, unit. (m, 3)
        Returns:
            (m, 3), not negative
        """
        return np.maximum(outgoing_radiance(self.texels.btf, self.samples, self.axes, point_index, wi), 0)


def sample_btf_surface(texels: BtfRef, uv: F32, wo: F64, rng: np.random.Generator) -> BtfSurface:
    """Look up what points send.

    Args:
        texels: how they are covered. wo: to the eye, in the points' frames, unit. (n, 3)
        uv: as `relume.raytrace.surface_interaction.SurfaceInteraction.uv` has them. (n, 5). rng: draws places within
            what pixels cover.
    """
    axes = _texture_axes(texels, uv)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    u, up = uv[:, 0].astype(np.float64), -uv[:, 1].astype(np.float64)  # up in a texture is down in its numbers
    center = texels.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up], axis=1)
    towards = np.column_stack([np.einsum("nij,nj->ni", axes, wo[:, :2]), wo[:, 2]])
    positions = center[:, None] + _footprint_offsets(texels.scale * uv[:, 2].astype(np.float64), towards, rng)
    samples = np.zeros((len(wo), texels.btf.grid.num_directions, 3), np.float32)
    above = wo[:, 2] > 0
    size = np.array(texels.btf.size[::-1])
    samples[above] = sample_btf(texels.btf, texels.tables, positions[above] * size - 0.5, towards[above])
    return BtfSurface(texels, samples, axes)


def _texture_axes(texels: BtfRef, uv: F32) -> F64:
    """The x and y axes of a turned texture in the frames of points. (n, 2, 2)"""
    angle, side = uv[:, 3].astype(np.float64), uv[:, 4].astype(np.float64)
    x = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y = side[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)


def _footprint_offsets(side: F64, wo: F64, rng: np.random.Generator) -> F64:
    """Places from the middle of what a pixel covers: a rectangle, longer in the plane of the eye and the normal.

    Args:
        side: of the square of its area, in repeats. (n,). wo: to the eye, in the texture's frame. (n, 3)
    Returns:
        One in each of its strata. (n, `_NUM_STRATA`², 2)
    """
    slanted = np.sqrt(np.maximum(wo[:, 2], _LEAST_COSINE))[:, None, None]
    horizontal_length = np.hypot(wo[:, 0], wo[:, 1])[:, None]
    along = np.where(horizontal_length > 0, wo[:, :2] * [1, -1] / np.maximum(horizontal_length, 1e-300), [1.0, 0.0])[
        :, None
    ]
    stratum = np.stack(np.meshgrid(*[np.arange(_NUM_STRATA)] * 2), axis=-1).reshape(-1, 2)
    stratum_offset = (stratum + rng.random((len(wo), *stratum.shape))) / _NUM_STRATA - 0.5
    perpendicular = along[..., ::-1] * [-1, 1]
    return np.asarray(
        side[:, None, None]
        * (stratum_offset[..., :1] / slanted * along + stratum_offset[..., 1:] * slanted * perpendicular)
    )
