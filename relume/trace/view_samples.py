"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/method.md, "View samples"): eight
positions are traced in such a pixel and those that see the same thing, turned alike, are merged into the most central
of them: a silhouette has eight levels of coverage for a few samples, and thin chrome several reflections.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import lookup
from relume.scene.model import Scene
from relume.trace.cutout_filter import ANYWHERE, EVERYWHERE
from relume.trace.geometry import Geometry
from relume.trace.glass import Layer, has_glass, layers_of
from relume.trace.primary import Hits, camera_directions, trace_from
from relume.trace.surface import Surface, surface_at

F32 = NDArray[np.float32]

BACKGROUND = 65_535

# eight positions that no row or column shares (a rook pattern), pixel units
_POSITIONS = (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8
POSITIONS_A_PIXEL = len(_POSITIONS)
_COS_EDGE = np.cos(np.radians(20.0))  # a crease
_COS_TURN = np.cos(np.radians(4.0))  # one sample would show a sharp reflection from one side only
_DEPTH_EDGE = 0.02  # of the distance, off the plane of the surface beside
_GOLDEN = (5**0.5 - 1) / 2
_MOST_TURNING = 1 / 6  # of all pixels; where more turn, as on coarse bumps, those that turn most


@dataclass(frozen=True)
class ViewSamples:
    """Samples sorted by material, then along a Morton curve: neighbours in memory are neighbours in the picture.

    Attributes:
        pixel: row-major index. (n,) uint32
        weight: share of the pixel; the shares of a pixel sum to one, but for what lies behind glass. (n,) float32
        material: index into the scene's materials, `BACKGROUND` where the ray left the scene. (n,) uint16
        surface: points and textures; for background samples the position is the ray's direction and `diffuse` the
            environment's radiance in it.
        num_rays: how many were traced to find them.
        through: what glass before a sample lets through; None where there is none. Samples on glass and those behind
            it have the same shares of a pixel. (n, 3) float32
    """

    pixel: NDArray[np.uint32]
    weight: F32
    material: NDArray[np.uint16]
    surface: Surface
    num_rays: int
    through: F32 | None = None

    @property
    def gains(self) -> F32:
        """What the radiance of each sample is multiplied by for its pixel. (n, 1) float32, or (n, 3) behind glass"""
        return self.weight[:, None] if self.through is None else self.weight[:, None] * self.through


def _edges(key: NDArray[np.int64], normal: F32, distance: F32, directions: F32) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that differ from a neighbour, and the least cosine between the normals of each and its neighbours.

    Args:
        key: what is hit. normal, distance: of the hits. directions: of the rays. All are (height, width, …).
    Returns:
        (height, width) both
    """
    edge, cosine = np.zeros(key.shape, np.bool_), np.ones(key.shape, np.float32)
    for axis in (0, 1):
        here = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        there = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        between = np.einsum("ijk,ijk->ij", normal[here], normal[there])
        off = [
            _is_off_plane(normal[one], distance[one], directions[one], distance[other], directions[other])
            for one, other in ((here, there), (there, here))
        ]
        # off both planes: of one alone may be a surface that is seen along itself
        differs = (key[here] != key[there]) | (between < _COS_EDGE) | (off[0] & off[1])
        for side in (here, there):
            edge[side] |= differs
            cosine[side] = np.minimum(cosine[side], between)
    return edge, cosine


def _is_off_plane(normal: F32, distance: F32, direction: F32, other_distance: F32, other: F32) -> NDArray[np.bool_]:
    """Tell whether what another ray of an eye hits is off the plane of a hit by more than a small share of the way."""
    with np.errstate(invalid="ignore", divide="ignore"):  # background is infinitely far
        slope = np.sum(direction * normal, axis=-1) / np.sum(other * normal, axis=-1)
        nearer = np.minimum(distance, other_distance)
        return np.asarray(np.abs(other_distance - distance * slope) > _DEPTH_EDGE * nearer)


def _turning(edge: NDArray[np.bool_], cosine: F32, key: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Find pixels that are no edges, but whose normals turn enough for reflections to alias. (height, width)"""
    turning = ~edge & (cosine < _COS_TURN) & (key >= 0)
    most = int(_MOST_TURNING * edge.size)
    if np.count_nonzero(turning) > most:
        turning &= cosine < np.partition(cosine[turning], most)[most]
    return np.asarray(turning)


def _morton(pixel: NDArray[np.int64], width: int) -> NDArray[np.uint64]:
    """Interleave the bits of x and y: the order of a Z-curve. (n,) uint64"""
    code = np.zeros(len(pixel), np.uint64)
    x, y = (pixel % width).astype(np.uint64), (pixel // width).astype(np.uint64)
    for bit in range(14):
        one = np.uint64(1)
        code |= ((x >> np.uint64(bit)) & one) << np.uint64(2 * bit)
        code |= ((y >> np.uint64(bit)) & one) << np.uint64(2 * bit + 1)
    return code


class _Chosen(NamedTuple):
    """Rays that samples are made of.

    Attributes:
        pixel: that each is of. (n,) int64. weight: share of it. (n,) float32
        hits, directions, through: see `relume.trace.glass.Layer`.
    """

    pixel: NDArray[np.int64]
    weight: F32
    hits: Hits
    directions: F32
    through: F32


def _merge(geometry: Geometry, layer: Layer, pixels: NDArray[np.int64]) -> _Chosen:
    """Group the rays of a layer by what they see, of the eight rays of each of some pixels.

    Of each group the ray next to its middle is kept, for as many eighths of the pixel as the group has rays.
    """
    shape = len(pixels), POSITIONS_A_PIXEL
    row = layer.ray[layer.is_shown]
    hits, directions = _hits_at(layer.hits, layer.is_shown), layer.directions[layer.is_shown]
    mesh, normal = np.full(shape, -2), np.zeros((*shape, 3), np.float32)
    distance, rays, through = np.ones(shape, np.float32), np.ones((*shape, 3), np.float32), np.ones((*shape, 3))
    mesh.flat[row] = np.where(hits.face >= 0, geometry.face_mesh[np.maximum(hits.face, 0)], -1)
    distance.flat[row] = hits.distance
    for out, values in (
        (normal, surface_at(geometry, hits, directions).points.normal),
        (rays, directions),
        (through, layer.through[layer.is_shown]),
    ):
        out.reshape(-1, 3)[row] = values
    group = np.where(mesh == -2, -2, -1)
    for candidate in range(POSITIONS_A_PIXEL):
        # rays of the same mesh, turned alike and near the plane of the first that has no group yet
        one = slice(candidate, candidate + 1)
        cosine = np.einsum("pkc,pc->pk", normal, normal[:, candidate])
        off = _is_off_plane(normal[:, one], distance[:, one], rays[:, one], distance, rays)
        same = (group == -1) & (mesh == mesh[:, one]) & (((cosine > _COS_TURN) & ~off) | (mesh < 0))
        same &= (group[:, candidate] == -1)[:, None]
        group[same] = candidate
    pixel, first = np.nonzero(group == np.arange(POSITIONS_A_PIXEL))
    is_in = group[pixel] == first[:, None]
    size = is_in.sum(axis=1)
    kept = pixel * POSITIONS_A_PIXEL + _most_central(is_in, size)
    place = np.searchsorted(row, kept)
    mean = np.einsum("gk,gkc->gc", is_in, through[pixel]) / size[:, None]
    weight = (size / POSITIONS_A_PIXEL).astype(np.float32)
    return _Chosen(pixels[pixel], weight, _hits_at(hits, place), directions[place], mean.astype(np.float32))


def _hits_at(hits: Hits, rows: NDArray[Any]) -> Hits:
    return Hits(hits.face[rows], hits.uv[rows], hits.distance[rows])


def _alone(layer: Layer, is_edge: NDArray[np.bool_]) -> _Chosen:
    """The rays of a layer through the middles of pixels that are no edges."""
    rows = np.flatnonzero(layer.is_shown & ~is_edge[layer.ray])
    weight = np.ones(len(rows), np.float32)
    return _Chosen(layer.ray[rows], weight, _hits_at(layer.hits, rows), layer.directions[rows], layer.through[rows])


def _joined(parts: Sequence[_Chosen]) -> _Chosen:
    hits = Hits(*(np.concatenate([getattr(part.hits, f.name) for part in parts]) for f in fields(Hits)))
    pixel, weight, directions, through = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("pixel", "weight", "directions", "through")
    )
    return _Chosen(pixel, weight, hits, directions, through)


def _edges_of(geometry: Geometry, layer: Layer, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Find pixels that want more rays by what a layer shows. (pixels,)"""
    width, height = size
    surface = surface_at(geometry, layer.hits, layer.directions)
    key, normal = np.full(width * height, -2), np.zeros((width * height, 3), np.float32)
    distance, directions = np.full(width * height, np.inf, np.float32), np.ones((width * height, 3), np.float32)
    key[layer.ray] = np.where(layer.hits.face >= 0, geometry.face_mesh[np.maximum(layer.hits.face, 0)], -1)
    normal[layer.ray], distance[layer.ray] = surface.points.normal, layer.hits.distance
    directions[layer.ray] = layer.directions
    shape = (height, width)
    seen = key.reshape(shape)
    differs, cosine = _edges(seen, normal.reshape(*shape, 3), distance.reshape(shape), directions.reshape(*shape, 3))
    return np.asarray((differs | _turning(differs, cosine, seen)).ravel())


def _is_partly_there(geometry: Geometry, origin: F32, directions: F32) -> NDArray[np.bool_]:
    """Find rays that meet a surface that blends. origin: (3,). directions: (n, 3). (n,)"""
    at_least, wholly = (
        trace_from(geometry.embree, origin, directions, np.full(1, chance)).face for chance in (ANYWHERE, EVERYWHERE)
    )
    return np.asarray(at_least != wholly)


def _shared_chances(pixel: NDArray[np.int64]) -> F32:
    """Chances of the eight rays of pixels, an eighth apart: a surface that blends has its share of them. (8n,)"""
    places = np.array([0, 5, 2, 7, 4, 1, 6, 3])  # not in the order of the rows that the positions lie in
    offset = (pixel[:, None] * _GOLDEN) % 1  # eighths alone would be seen as steps
    return np.asarray((places + offset) / POSITIONS_A_PIXEL + 1e-6, np.float32).ravel()


def _most_central(is_in: NDArray[np.bool_], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Choose of each group the position next to their mean: any other would shift what it shows to one side.

    Args:
        is_in: which positions are of a group. (groups, 8). size: how many those are. (groups,)
    """
    mean = is_in @ _POSITIONS / size[:, None]
    away = np.sum((_POSITIONS - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_in, away, np.inf).argmin(axis=1), np.int64)


def sample_view(scene: Scene, geometry: Geometry, view: str, size: tuple[int, int]) -> ViewSamples:
    """Find the view samples of one camera.

    Args:
        scene: what is seen. geometry: its triangles.
        view: name of the camera. size: width and height in pixels.
    """
    width, height = size
    camera = next(camera for camera in scene.cameras if camera.name == view)
    origin = camera.to_world[:3, 3].astype(np.float32)
    y, x = np.divmod(np.arange(width * height), width)
    directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    layers = layers_of(geometry, scene.materials, origin, directions, np.full(1, EVERYWHERE))
    is_edge = np.any([_edges_of(geometry, layer, size) for layer in layers], axis=0)
    if geometry.embree.holes is not None:
        is_edge |= _is_partly_there(geometry, origin, directions)

    edge_pixel = np.nonzero(is_edge)[0]
    more_x = (x[edge_pixel, None] + _POSITIONS[:, 0]).astype(np.float32).ravel()
    more_y = (y[edge_pixel, None] + _POSITIONS[:, 1]).astype(np.float32).ravel()
    more_directions = camera_directions(camera, size, more_x, more_y)
    more = layers_of(geometry, scene.materials, origin, more_directions, _shared_chances(edge_pixel))
    chosen = _joined(
        [
            *(_alone(layer, is_edge) for layer in layers),
            *(_merge(geometry, layer, edge_pixel) for layer in more),
        ]
    )
    hit = chosen.hits.face >= 0
    material = np.where(hit, geometry.face_material[np.maximum(chosen.hits.face, 0)], BACKGROUND).astype(np.uint16)
    order = np.lexsort((_morton(chosen.pixel, width), material))
    pixel_angle = camera.yfov / height
    towards = chosen.directions[order]
    full = surface_at(geometry, _hits_at(chosen.hits, order), towards, scene.materials, pixel_angle, origin)
    outside = ~hit[order]
    full.diffuse[outside] = lookup(scene.environment.radiance, towards[outside])
    return ViewSamples(
        chosen.pixel[order].astype(np.uint32),
        chosen.weight[order],
        material[order],
        full,
        len(directions) + len(more_directions),
        chosen.through[order] if has_glass(scene.materials) else None,
    )
