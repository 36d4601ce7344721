"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/method.md, "View samples"): eight
positions are traced in such a pixel and those that see the same thing are merged into the most central of them: a
silhouette has eight levels of coverage for two or three samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.light.environment import lookup
from relume.scene.model import Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, camera_directions, trace_from
from relume.trace.surface import Surface, surface_at

F32 = NDArray[np.float32]

BACKGROUND = 65_535

# eight positions that no row or column shares (a rook pattern), pixel units
_POSITIONS = (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8
_COS_EDGE = np.cos(np.radians(20.0))
_DEPTH_EDGE = 0.02


@dataclass(frozen=True)
class ViewSamples:
    """Samples sorted by material, then along a Morton curve: neighbours in memory are neighbours in the picture.

    Attributes:
        pixel: row-major index. (n,) uint32
        weight: share of the pixel; the shares of a pixel sum to one. (n,) float32
        material: index into the scene's materials, `BACKGROUND` where the ray left the scene. (n,) uint16
        surface: position, normals, tangent, textures; for background samples the position is the ray's direction and
            `diffuse` the environment's radiance in it.
    """

    pixel: NDArray[np.uint32]
    weight: F32
    material: NDArray[np.uint16]
    surface: Surface
    num_rays: int


def _edges(face: NDArray[np.int32], key: NDArray[np.int64], normal: F32, distance: F32) -> NDArray[np.bool_]:
    """Pixels that differ from a neighbour. All arguments and the result are (height, width, …)."""
    edge = np.zeros(face.shape, np.bool_)
    for axis in (0, 1):
        here = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        there = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        with np.errstate(invalid="ignore"):  # background is infinitely far: inf - inf
            depth = np.abs(distance[here] - distance[there]) > _DEPTH_EDGE * np.minimum(distance[here], distance[there])
        bent = np.einsum("ijk,ijk->ij", normal[here], normal[there]) < _COS_EDGE
        # a large step in depth along one smooth surface seen at a grazing angle is no edge
        facing_same = (key[here] == key[there]) & ~bent
        differs = (key[here] != key[there]) | bent | (depth & ~facing_same)
        edge[here] |= differs
        edge[there] |= differs
    return edge


def _morton(pixel: NDArray[np.int64], width: int) -> NDArray[np.uint64]:
    """Interleaved bits of x and y: the order of a Z-curve."""
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
    positions_a_pixel = len(_POSITIONS)
    mesh = np.where(hits.face >= 0, geometry.face_mesh[np.maximum(hits.face, 0)], -1)
    mesh = mesh.reshape(num_pixels, positions_a_pixel)
    normal = surface_at(geometry, hits, directions).normal.reshape(num_pixels, positions_a_pixel, 3)
    group = np.full((num_pixels, positions_a_pixel), -1)
    for candidate in range(positions_a_pixel):
        # rays of the same mesh with nearly the same normal as the first that has no group yet
        cosine = np.einsum("pkc,pc->pk", normal, normal[:, candidate])
        same = (group < 0) & (mesh == mesh[:, candidate : candidate + 1]) & ((cosine > _COS_EDGE) | (mesh < 0))
        same &= (group[:, candidate] < 0)[:, None]
        group[same] = candidate
    pixel, first = np.nonzero(group == np.arange(positions_a_pixel))
    is_in = group[pixel] == first[:, None]
    size = is_in.sum(axis=1)
    return (
        pixel * positions_a_pixel + _most_central(is_in, size),
        pixel,
        (size / positions_a_pixel).astype(np.float32),
    )


def _most_central(is_in: NDArray[np.bool_], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of each group the position next to their mean: any other would shift what the group shows to one side.

    Args:
        is_in: which positions are of a group. (groups, 8). size: how many those are. (groups,)
    """
    mean = is_in @ _POSITIONS / size[:, None]
    away = np.sum((_POSITIONS - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_in, away, np.inf).argmin(axis=1), np.int64)


def sample_view(scene: Scene, geometry: Geometry, view: str, size: tuple[int, int]) -> ViewSamples:
    """Find the view samples of one camera.

    Args:
        size: width and height in pixels.
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
    edge = _edges(
        hits.face.reshape(shape), key.reshape(shape), surface.normal.reshape(*shape, 3), hits.distance.reshape(shape)
    ).ravel()

    edge_pixel = np.nonzero(edge)[0]
    more_x = (x[edge_pixel, None] + _POSITIONS[:, 0]).astype(np.float32).ravel()
    more_y = (y[edge_pixel, None] + _POSITIONS[:, 1]).astype(np.float32).ravel()
    more_directions = camera_directions(camera, size, more_x, more_y)
    more = trace_from(geometry.embree, origin, more_directions)
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
