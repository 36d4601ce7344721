"""BTF surfaces of the reference: texels sampled at random positions in the pixel's footprint.

Methods average over texels as wide as a pixel; the reference looks up single texels of the finest level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.outgoing_radiance import outgoing_radiance, sample_btf
from relume.brdf.terms.btf import BtfRef

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NUM_STRATA = 2  # along each side of the footprint
_LEAST_COSINE = 1e-3


@dataclass(frozen=True)
class BtfSurface:
    """Reflection of BTF-textured points.

    Attributes:
        texels: the BTF.
        samples: reflection of each point, from `relume.assets.btf.outgoing_radiance.sample_btf`; zero below the
            horizon.
        axes: axes of the texture, in the points' frames.
    """

    texels: BtfRef
    samples: Shaped[F32, "n L 3"]
    axes: Shaped[F64, "n 2 2"]

    def evaluate(self, point_index: Shaped[NDArray[np.int64], " m"], wi: Shaped[F64, "m 3"]) -> Shaped[F64, "m 3"]:
        """Evaluate BRDF times cos θi, not negative, at some of the points.

        Args:
            point_index: the point of each direction. wi: in the points' frames, z = normal, unit.
        """
        return np.maximum(outgoing_radiance(self.texels.btf, self.samples, self.axes, point_index, wi), 0)


def sample_btf_surface(
    texels: BtfRef, uv: Shaped[F32, "n uv"], wo: Shaped[F64, "n 3"], rng: np.random.Generator
) -> BtfSurface:
    """Look up the BTF at points.

    Args:
        texels: mapping of the BTF. wo: wo in the points' frames, unit.
        uv: see `relume.raytrace.surface_interaction.SurfaceInteraction.uv`. rng: chooses positions in footprints.
    """
    axes = _texture_axes(texels, uv)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    u, up = uv[:, 0].astype(np.float64), -uv[:, 1].astype(np.float64)  # v points down
    center = texels.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up], axis=1)
    towards = np.column_stack([np.einsum("nij,nj->ni", axes, wo[:, :2]), wo[:, 2]])
    positions = center[:, None] + _footprint_offsets(texels.scale * uv[:, 2].astype(np.float64), towards, rng)
    samples = np.zeros((len(wo), texels.btf.grid.num_directions, 3), np.float32)
    above = wo[:, 2] > 0
    size = np.array(texels.btf.size[::-1])
    samples[above] = sample_btf(texels.btf, texels.tables, positions[above] * size - 0.5, towards[above])
    return BtfSurface(texels, samples, axes)


def _texture_axes(texels: BtfRef, uv: F32) -> F64:
    """Axes x and y of a rotated texture in the frames of points. (n, 2, 2)"""
    angle, side = uv[:, 3].astype(np.float64), uv[:, 4].astype(np.float64)
    x = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y = side[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)


def _footprint_offsets(side: F64, wo: F64, rng: np.random.Generator) -> F64:
    """Random offsets in the pixel footprint: a rectangle, longer in the plane of the view direction and the normal.

    Args:
        side: side length of a square with the footprint's area, in repeats. (n,). wo: wo in the texture's frame. (n, 3)
    Returns:
        One per stratum. (n, `_NUM_STRATA`², 2)
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
