"""Glass while the eye moves: its own highlights are laid over what is straight behind it; nothing is bent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.moving.points.surface import Surface
from relume.trace.cutout_filter import EVERYWHERE
from relume.trace.cutouts import PASSES
from relume.trace.embree import EmbreeScene
from relume.trace.primary import Hits, trace_from

F32 = NDArray[np.float32]


class Panes(NamedTuple):
    """The glass before rays of an eye, nearest first.

    Attributes:
        ray: that each is before. (g,) int64
        through: share of what is behind it that comes to the eye. (g, 3) float32
    """

    ray: NDArray[np.int64]
    through: F32


def find_glass(embree: EmbreeScene, eye: F32, directions: F32) -> Hits | None:
    """Find what rays of an eye meet first, glass included; None where a scene has none.

    Args:
        embree: the triangles. eye: (3,) float32. directions: of the rays, unit. (n, 3) float32
    """
    holes = embree.holes
    if holes is None or not (holes.cutouts.rules[:, 0] == PASSES).any():
        return None
    return trace_from(embree, eye, directions, EVERYWHERE)


def panes_of(embree: EmbreeScene, surface: Surface, first: Hits, directions: F32) -> Panes:
    """Tell which rays glass is before.

    Args:
        embree: the triangles. surface: of the scene. first: from `find_glass`. directions: of the rays. (n, 3) float32
    """
    assert embree.holes is not None
    cutouts = embree.holes.cutouts
    row = np.where(first.face >= 0, cutouts.of_material[surface.face_material[np.maximum(first.face, 0)]], -1)
    ray = np.flatnonzero((row >= 0) & (cutouts.rules[row, 0] == PASSES))
    rules, normal = cutouts.rules[row[ray]].astype(np.float64), surface.face_normal[first.face[ray]]
    cosine = np.abs(np.einsum("nc,nc->n", normal, directions[ray])).astype(np.float64)
    f0, sides = rules[:, 4], rules[:, 5]
    passed = (1 - schlick(cosine, f0))[:, None] * rules[:, 1:4]
    return Panes(ray, (passed ** sides[:, None]).astype(np.float32))


def lay_over_glass(panes: Panes, values: F32) -> F32:
    """Add the radiance of glass to what comes through it.

    Args:
        panes: before some of the rays. values: of the rays, then of the panes. (rays + g, …) float32
    Returns:
        Of the rays. (rays, …) float32
    """
    num = len(values) - len(panes.ray)
    out = values[:num]
    out[panes.ray] = out[panes.ray] * panes.through + values[num:]
    return out


def hide_less(panes: Panes, hides: F32) -> F32:
    """How much rays hide of what is behind all, glass included. hides: of the rays, then of the panes. (rays,)"""
    out = hides[: len(hides) - len(panes.ray)]
    out[panes.ray] = 1 - (1 - out[panes.ray]) * panes.through.mean(axis=1)
    return out
