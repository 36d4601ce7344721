"""Surfaces that are covered with a BTF, as brute force sees them: places drawn within what a pixel covers.

Methods sum means over texels that are as wide as a pixel; here single texels are looked up, of the finest level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.brdf.terms.btf import Texels
from relume.btf.sent import seen_numpy, sent_numpy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_PLACES = 2  # strata along each side of what a pixel covers
_LEAST_COSINE = 1e-3


@dataclass(frozen=True)
class Cover:
    """What some points send that are covered.

    Attributes:
        texels: by which. seen: of each point, from `relume.btf.sent.seen_numpy`. (n, L, 3)
        axes: of the texture, in the points' frames. (n, 2, 2)
    """

    texels: Texels
    seen: F64
    axes: F64

    def sent(self, point: int, wi: F64) -> F64:
        """BRDF times cos θi of one of the points.

        Args:
            point: which. wi: in its frame, z = normal, unit. (m, 3)
        Returns:
            (m, 3), not negative
        """
        turned = np.column_stack([wi[:, :2] @ self.axes[point].T, wi[:, 2]])
        return np.maximum(sent_numpy(self.texels.btf, self.seen[point], turned), 0)


def cover(texels: Texels, places: F32, wo: F64, rng: np.random.Generator) -> Cover:
    """Look up what points send.

    Args:
        texels: how they are covered. wo: to the eye, in the points' frames, unit. (n, 3)
        places: as `relume.trace.surface.Surface.uv` has them. (n, 5). rng: draws places within what pixels cover.
    """
    axes = _axes_of(texels, places)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    u, up = places[:, 0].astype(np.float64), -places[:, 1].astype(np.float64)  # up in a texture is down in its numbers
    middle = texels.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up], axis=1)
    seen = np.zeros((len(wo), texels.btf.rings.num_directions, 3))
    size = np.array(texels.btf.size[::-1])
    for k in np.flatnonzero(wo[:, 2] > 0):
        towards = np.append(axes[k] @ wo[k, :2], wo[k, 2])
        drawn = middle[k] + _within(texels.scale * float(places[k, 2]), towards, rng)
        seen[k] = seen_numpy(texels.btf, drawn * size - 0.5, towards)
    return Cover(texels, seen, axes)


def _axes_of(texels: Texels, places: F32) -> F64:
    """The x and y axes of a turned texture in the frames of points. (n, 2, 2)"""
    angle, side = places[:, 3].astype(np.float64), places[:, 4].astype(np.float64)
    x = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y = side[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    cosine, sine = math.cos(texels.rotation), math.sin(texels.rotation)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)


def _within(side: float, wo: F64, rng: np.random.Generator) -> F64:
    """Places from the middle of what a pixel covers: a rectangle, longer in the plane of the eye and the normal.

    Args:
        side: of the square of its area, in repeats. wo: to the eye, in the texture's frame. (3,)
    Returns:
        One in each of its strata. (`_PLACES`², 2)
    """
    slanted = math.sqrt(max(wo[2], _LEAST_COSINE))
    across = math.hypot(wo[0], wo[1])
    along = np.array([wo[0], -wo[1]]) / across if across > 0 else np.array([1.0, 0.0])
    corner = np.stack(np.meshgrid(*[np.arange(_PLACES)] * 2), axis=-1).reshape(-1, 2)
    share = (corner + rng.random(corner.shape)) / _PLACES - 0.5
    return np.asarray(side * (share[:, :1] / slanted * along + share[:, 1:] * slanted * [-along[1], along[0]]))
