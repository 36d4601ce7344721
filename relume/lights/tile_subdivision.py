"""Tiles of the sphere, chosen for an environment: small where much light is.

Ben-Artzi 2006, section 5.2: the triangle for which the metric of structured importance sampling (Agarwal 2003,
L · ΔΩ^b) is largest is split into four at its edges' midpoints.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.core.color import luminance
from relume.core.errors import PlanError
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.light_moments import LightTexels
from relume.lights.sphere_tiles import MAX_DEPTH, Tiles, child_at, children_of, middle_edges

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MIN_LIGHTS, MAX_LIGHTS = 8, 65_536

# Agarwal 2003 uses ΔΩ^(1/4) against errors of shadows; highlights show the map itself, so that the size has more weight
# here, and a small term of plain solid angle is added, weighted by the mean radiance
# (docs/direct-light.md#environment-triangles).
SOLID_ANGLE_EXPONENT = 0.4
UNIFORM_FRACTION = 1e-2
# With light at any azimuth, a larger fraction of tiles is dim until a bright region is rotated there
# (docs/direct-light.md#environment-triangles).
_RELIGHTABLE_UNIFORM_FRACTION = 0.1

_SLACK = 0.999  # of a metric, which depends on the order of sums

_OCTANTS = Tiles(np.arange(8, 16, dtype=np.uint64))


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _find_children(texels, directions, edges, child_index):  # type: ignore[no-untyped-def]
    for k in range(texels.shape[0]):
        child_index[k] = child_at(directions[texels[k]], edges)


class _Subdivision:
    """The growing hierarchy: a heap of leaves by metric.

    Args:
        tiles: the first leaves. texels: light in them. uniform_fraction: weight of plain solid angle.
        metric: leaves of smaller ones are not divided, as a fraction of all light.
    """

    def __init__(self, tiles: Tiles, texels: LightTexels, uniform_fraction: float, metric: float = 0.0) -> None:
        self.texels, self.all_light = texels, float(texels.luminous.sum())
        self.uniform = uniform_fraction * self.all_light / (4 * np.pi)
        self.metric = metric
        self.heap: list[tuple[float, int, int, F64, NDArray[np.int64]]] = []
        self.count = len(tiles.codes)
        light, extent = (texels.sums(values, self.count) for values in (texels.luminous, texels.solid_angles))
        is_large = self._metric(light, extent) >= _SLACK * metric * self.all_light
        self.small = [(k, int(tiles.codes[k])) for k in np.flatnonzero(~is_large)]
        order = np.argsort(texels.tile, kind="stable")
        first = np.searchsorted(texels.tile[order], np.arange(self.count + 1))
        for k in np.flatnonzero(is_large):
            self._push(int(k), int(tiles.codes[k]), tiles.corners[k], order[first[k] : first[k + 1]])

    def _metric(self, light: F64, extent: F64) -> F64:
        """Return the metric of leaves, times all light. light, extent: in each, and its solid angle"""
        return np.asarray(light * np.maximum(extent, 1e-12) ** SOLID_ANGLE_EXPONENT + self.uniform * extent)

    def _push(self, index: int, code: int, corners: F64, texels: NDArray[np.int64]) -> None:
        light, extent = self.texels.luminous[texels].sum(), self.texels.solid_angles[texels].sum()
        # leaves with fewer than two texels have no more detail: last in the queue
        can_split = len(texels) > 1 and code.bit_length() < 4 + 2 * MAX_DEPTH
        heapq.heappush(
            self.heap, (-float(self._metric(light, extent)) if can_split else 0.0, index, code, corners, texels)
        )

    @property
    def largest_metric(self) -> float:
        """Largest metric of a leaf that can be split, as a fraction of all light; zero if there is none."""
        return -self.heap[0][0] / max(self.all_light, 1e-30) if self.heap else 0.0

    def split_until(self, num_leaves: int) -> Tiles:
        """Split the leaves of largest metric.

        Args:
            num_leaves: maximum number of leaves.
        Returns:
            The leaves, in the order of their creation.
        """
        while len(self.heap) + len(self.small) + 3 <= num_leaves and self.largest_metric > self.metric:
            self._split_largest()
        leaves = sorted([*self.small, *(leaf[1:3] for leaf in self.heap)])  # keeps neighbors together
        return Tiles(np.array([code for _, code in leaves], np.uint64))

    def _split_largest(self) -> None:
        """Replace the leaf of largest metric by its four children."""
        _, _, code, corners, texels = heapq.heappop(self.heap)
        child_index = np.empty(len(texels), np.int8)
        _find_children(texels, self.texels.directions, middle_edges(corners[None])[0], child_index)
        for child, child_corners in enumerate(children_of(corners[None])[0]):
            self._push(self.count, 4 * code + child, child_corners, texels[child_index == child])
            self.count += 1


def choose_tiles(radiance: Shaped[F32, "height width 3"], num_lights: int, relightable: bool = False) -> Tiles:
    """Divide the sphere into about `num_lights` triangles (the next count of the form 8 + 3k, or fewer).

    O(texels · depth) time.

    Args:
        radiance: equirectangular, top row first. num_lights: in [8, 65536].
        relightable: the environment will be rotated or exchanged: divide rings about +Y uniformly, by their mean.
    Raises:
        PlanError: `num_lights` outside [8, 65536].
    """
    if not MIN_LIGHTS <= num_lights <= MAX_LIGHTS:
        raise PlanError(f"{num_lights} lights were asked for; give {MIN_LIGHTS} to {MAX_LIGHTS}")
    height, width, _ = radiance.shape
    if relightable:
        ring = radiance.mean(axis=1, keepdims=True, dtype=np.float64).astype(np.float32)
        radiance = np.broadcast_to(ring, radiance.shape)
    directions = texel_directions(height, width).reshape(-1, 3).astype(np.float64)
    solid_angles = np.repeat(texel_solid_angles(height, width), width)
    luminous = luminance(radiance.reshape(-1, 3)).astype(np.float64) * solid_angles
    texels = LightTexels(_OCTANTS.locate(directions), luminous, directions, solid_angles)
    fraction = _RELIGHTABLE_UNIFORM_FRACTION if relightable else UNIFORM_FRACTION
    return _Subdivision(_OCTANTS, texels, fraction).split_until(num_lights)


class RefinedTiles(NamedTuple):
    """Tiles for an environment, most of which were chosen for another one.

    Attributes:
        tiles: M or more tiles; those of the M that were not divided have kept their index.
        new: indices of all others, ascending.
    """

    tiles: Tiles
    new: Shaped[NDArray[np.intp], " K"]


def largest_metric(tiles: Tiles, texels: LightTexels) -> float:
    """Return the metric of the tile that would be split next, as a fraction of all light. texels: light in the tiles"""
    return _Subdivision(tiles, texels, UNIFORM_FRACTION).largest_metric


def refine_tiles(tiles: Tiles, texels: LightTexels, metric: float, num_more: int) -> RefinedTiles:
    """Divide the tiles in which an environment, for which they were not chosen, has much light.

    O(texels · depth) time.

    Args:
        tiles: M tiles. texels: light in them. metric: that no tile exceeds then, as a fraction of all light.
        num_more: maximum number of tiles by which M grows.
    """
    codes = _Subdivision(tiles, texels, UNIFORM_FRACTION, metric).split_until(len(tiles.codes) + num_more).codes
    is_divided, is_new = ~np.isin(tiles.codes, codes), ~np.isin(codes, tiles.codes)
    new = np.concatenate([np.flatnonzero(is_divided), np.arange(len(tiles.codes), len(codes))])
    refined = np.concatenate([tiles.codes, codes[: len(codes) - len(tiles.codes)]])
    refined[new] = codes[is_new]
    return RefinedTiles(Tiles(refined), new)
