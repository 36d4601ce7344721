"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/method.md, "View samples"): eight
positions are traced in such a pixel and those that see the same thing, turned alike, are merged into the most central
of them: a silhouette has eight levels of coverage for a few samples, and thin chrome several reflections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import lookup
from relume.scene.model import Scene
from relume.trace.cutout_filter import ANYWHERE, EVERYWHERE
from relume.trace.geometry import Geometry
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
        weight: share of the pixel; the shares of a pixel sum to one. (n,) float32
        material: index into the scene's materials, `BACKGROUND` where the ray left the scene. (n,) uint16
        surface: points and textures; for background samples the position is the ray's direction and `diffuse` the
            environment's radiance in it.
        num_rays: how many were traced to find them.
    """

    pixel: NDArray[np.uint32]
    weight: F32
    material: NDArray[np.uint16]
    surface: Surface
    num_rays: int


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


def _merge(
    geometry: Geometry, hits: Hits, directions: F32, num_pixels: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], F32]:
    """Group the eight rays of each edge pixel by what they see.

    Returns:
        Index of the ray that stands for each group, the pixel (of the edge pixels) it belongs to, and its weight.
    """
    mesh = np.where(hits.face >= 0, geometry.face_mesh[np.maximum(hits.face, 0)], -1)
    mesh = mesh.reshape(num_pixels, POSITIONS_A_PIXEL)
    normal = surface_at(geometry, hits, directions).points.normal.reshape(num_pixels, POSITIONS_A_PIXEL, 3)
    distance = hits.distance.reshape(num_pixels, POSITIONS_A_PIXEL)
    rays = directions.reshape(num_pixels, POSITIONS_A_PIXEL, 3)
    group = np.full((num_pixels, POSITIONS_A_PIXEL), -1)
    for candidate in range(POSITIONS_A_PIXEL):
        # rays of the same mesh, turned alike and near the plane of the first that has no group yet
        one = slice(candidate, candidate + 1)
        cosine = np.einsum("pkc,pc->pk", normal, normal[:, candidate])
        off = _is_off_plane(normal[:, one], distance[:, one], rays[:, one], distance, rays)
        same = (group < 0) & (mesh == mesh[:, one]) & (((cosine > _COS_TURN) & ~off) | (mesh < 0))
        same &= (group[:, candidate] < 0)[:, None]
        group[same] = candidate
    pixel, first = np.nonzero(group == np.arange(POSITIONS_A_PIXEL))
    is_in = group[pixel] == first[:, None]
    size = is_in.sum(axis=1)
    return (
        pixel * POSITIONS_A_PIXEL + _most_central(is_in, size),
        pixel,
        (size / POSITIONS_A_PIXEL).astype(np.float32),
    )


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
    hits = trace_from(geometry.embree, origin, directions)
    surface = surface_at(geometry, hits, directions)
    key = np.where(hits.face >= 0, geometry.face_mesh[np.maximum(hits.face, 0)], -1).astype(np.int64)
    shape = (height, width)
    seen = key.reshape(shape)
    differs, cosine = _edges(
        seen, surface.points.normal.reshape(*shape, 3), hits.distance.reshape(shape), directions.reshape(*shape, 3)
    )
    edge = (differs | _turning(differs, cosine, seen)).ravel()
    if geometry.embree.holes is not None:
        edge |= _is_partly_there(geometry, origin, directions)

    edge_pixel = np.nonzero(edge)[0]
    more_x = (x[edge_pixel, None] + _POSITIONS[:, 0]).astype(np.float32).ravel()
    more_y = (y[edge_pixel, None] + _POSITIONS[:, 1]).astype(np.float32).ravel()
    more_directions = camera_directions(camera, size, more_x, more_y)
    more = trace_from(geometry.embree, origin, more_directions, _shared_chances(edge_pixel))
    chosen, owner, share = _merge(geometry, more, more_directions, len(edge_pixel))

    inner = np.nonzero(~edge)[0]
    pixel = np.concatenate([inner, edge_pixel[owner]])
    weight = np.concatenate([np.ones(len(inner), np.float32), share])
    all_hits = Hits(
        np.concatenate([hits.face[inner], more.face[chosen]]),
        np.concatenate([hits.uv[inner], more.uv[chosen]]),
        np.concatenate([hits.distance[inner], more.distance[chosen]]),
    )
    all_directions = np.concatenate([directions[inner], more_directions[chosen]])
    hit = all_hits.face >= 0
    material = np.where(hit, geometry.face_material[np.maximum(all_hits.face, 0)], BACKGROUND).astype(np.uint16)
    order = np.lexsort((_morton(pixel, width), material))
    pixel_angle = camera.yfov / height
    sorted_hits = Hits(all_hits.face[order], all_hits.uv[order], all_hits.distance[order])
    full = surface_at(geometry, sorted_hits, all_directions[order], scene.materials, pixel_angle, origin)
    outside = ~hit[order]
    full.diffuse[outside] = lookup(scene.environment.radiance, all_directions[order][outside])
    return ViewSamples(
        pixel[order].astype(np.uint32), weight[order], material[order], full, len(directions) + len(more_directions)
    )
