"""From what an eye sees to the points about it: which three, with which weights."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.edges import POSITIONS, find_edges, rays_an_edge
from relume.moving.panes import Panes, find_glass, panes_of
from relume.moving.points.grids import nodes_about
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.scene.model import Camera
from relume.trace.cutout_filter import EVERYWHERE, PAST_GLASS
from relume.trace.embree import EmbreeScene
from relume.trace.primary import Hits, trace_from
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_NOTHING = np.empty((0, 3), np.float32)
_MIDDLE = np.array([[0.5, 0.5]], np.float32)


class Seen(NamedTuple):
    """What the eye's rays see: one through the middle of each pixel, row after row, then more across edges.

    Attributes:
        hits: of the rays. directions: of these, unit. (n, 3) float32
        owner: pixels that those beyond one for each belong to. (m,) int32
        vertex: the three about each hit. (n, 3) uint32. weight: of each; all zero where there are none. (n, 3) float32
        panes: glass before rays, whose own hits come after those of all others.
        is_seen: whether any ray meets the surface about a vertex. (vertices,) uint8
        is_needed: whether one that is shown follows from a point. (points,) uint8
    """

    hits: Hits
    directions: F32
    owner: NDArray[np.int32]
    vertex: NDArray[np.uint32]
    weight: F32
    panes: Panes
    is_seen: NDArray[np.uint8]
    is_needed: NDArray[np.uint8]

    def middles(self, num_pixels: int) -> Seen:
        """Those through the middles of pixels alone, of what is behind glass. num_pixels: of the picture"""
        rows = slice(0, num_pixels)
        return self._replace(
            hits=self.hits.rows(rows), directions=self.directions[rows], owner=self.owner[:0],
            vertex=self.vertex[rows], weight=self.weight[rows], panes=Panes(np.empty(0, np.int64), _NOTHING),
        )  # fmt: skip

    def first_row(self, pixel: int) -> int:
        """Which row tells what is met first through the middle of a pixel, glass included."""
        panes = self.panes.ray
        place = int(np.searchsorted(panes, pixel))
        has_glass = place < len(panes) and panes[place] == pixel
        return len(self.directions) - len(panes) + place if has_glass else pixel


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _aim(rotation, half_width, half_height, width, height, pixels, places, start, stop, out):  # type: ignore[no-untyped-def]
    """Direct rays through places in pixels [start, stop), those of one pixel in a row."""
    for i in range(start, stop):
        y = pixels[i] // width
        x = pixels[i] - y * width
        for place in range(places.shape[0]):
            r = i * places.shape[0] + place
            a = (np.float32(2) * (x + places[place, 0]) / width - np.float32(1)) * half_width
            b = (np.float32(1) - np.float32(2) * (y + places[place, 1]) / height) * half_height
            scale = np.float32(1) / math.sqrt(a * a + b * b + np.float32(1))
            for axis in range(3):
                out[r, axis] = scale * (rotation[axis, 0] * a + rotation[axis, 1] * b - rotation[axis, 2])


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _find(lattice, face_normal, face, uv, directions, start, stop, vertex, weight, is_seen):  # type: ignore[no-untyped-def]
    """Find the vertices about hits [start, stop); of a side without any, those of the other."""
    for p in range(start, stop):
        f = face[p]
        weight[p, 0] = weight[p, 1] = weight[p, 2] = 0
        if f < 0:
            continue
        along = (
            face_normal[f, 0] * directions[p, 0]
            + face_normal[f, 1] * directions[p, 1]
            + face_normal[f, 2] * directions[p, 2]
        )
        side = 1 if along > 0 else 0
        if lattice.num_rows[f, side] == 0:
            side = 1 - side
        if lattice.num_rows[f, side] == 0:
            continue
        n0, n1, n2, w0, w1, w2 = nodes_about(lattice, f, side, uv[p, 0], uv[p, 1])
        vertex[p, 0], vertex[p, 1], vertex[p, 2] = lattice.node[n0], lattice.node[n1], lattice.node[n2]
        weight[p, 0], weight[p, 1], weight[p, 2] = w0, w1, w2
        for k in range(3):
            is_seen[vertex[p, k]] = 1


def look(surface: Surface, embree: EmbreeScene, camera: Camera, size: tuple[int, int]) -> Seen:
    """Find what every pixel of a picture sees.

    Args:
        surface: that is seen. embree: its triangles. camera: the eye. size: width and height in pixels.
    """
    num, eye = size[0] * size[1], camera.to_world[:3, 3].astype(np.float32)
    directions = _directions(camera, size, np.arange(num, dtype=np.int32), _MIDDLE)
    hits, first = trace_from(embree, eye, directions, PAST_GLASS), find_glass(embree, eye, directions)
    edges = find_edges(surface, hits, directions, size)
    if first is not None:
        edges = np.union1d(edges, find_edges(surface, first, directions, size)).astype(np.int32)
    more = rays_an_edge(len(edges), num)
    owner = np.repeat(edges, more)
    if len(owner):
        towards = _directions(camera, size, edges, POSITIONS[:more])
        hits = Hits.joined([hits, trace_from(embree, eye, towards, PAST_GLASS)])
        directions = np.concatenate([directions, towards])
    if first is not None:
        first = Hits.joined([first, trace_from(embree, eye, directions[num:], EVERYWHERE)])
    return _seen_along(surface, embree, directions, hits, first, owner)


def look_through(
    surface: Surface,
    embree: EmbreeScene,
    camera: Camera,
    size: tuple[int, int],
    pixels: NDArray[np.int32],
    places: F32,
) -> Seen:
    """Find what more rays through some pixels see, and none through the middles of others.

    Args:
        surface, embree, camera, size: as of `look`.
        pixels: that are looked through. (n,) int32. places: in each of them, pixel units. (k, 2) float32
    Returns:
        Of k rays for each pixel in a row, as if each were a pixel by itself.
    """
    eye, directions = camera.to_world[:3, 3].astype(np.float32), _directions(camera, size, pixels, places)
    hits, first = trace_from(embree, eye, directions, PAST_GLASS), find_glass(embree, eye, directions)
    return _seen_along(surface, embree, directions, hits, first, np.empty(0, np.int32))


def _seen_along(
    surface: Surface, embree: EmbreeScene, directions: F32, hits: Hits, first: Hits | None, owner: NDArray[np.int32]
) -> Seen:
    """Find what is about the hits of rays, and of the glass before them. first: hits of that, None: there is none."""
    panes = Panes(np.empty(0, np.int64), _NOTHING)
    if first is not None:
        panes = panes_of(embree, surface, first, directions)
        hits = Hits.joined([hits, first.rows(panes.ray)])
        directions = np.concatenate([directions, directions[panes.ray]])
    num_rays = len(directions)
    vertex, weight = np.zeros((num_rays, 3), np.uint32), np.empty((num_rays, 3), np.float32)
    is_seen = np.zeros(len(surface.vertices.normal), np.uint8)
    args = (surface.lattice, surface.face_normal, hits.face, hits.uv, directions)
    for_shares(lambda start, stop: _find(*args, start, stop, vertex, weight, is_seen), num_rays)
    is_needed = np.zeros(surface.points.num_points, np.uint8)
    need_points(surface.vertices, is_seen, is_needed)
    return Seen(hits, directions, owner, vertex, weight, panes, is_seen, is_needed)


def _directions(camera: Camera, size: tuple[int, int], pixels: NDArray[np.int32], places: F32) -> F32:
    """Aim rays through places in pixels, those of one pixel in a row. places: pixel units. (k, 2) float32"""
    width, height = size
    half_height = np.float32(math.tan(camera.yfov / 2))
    rotation = np.ascontiguousarray(camera.to_world[:3, :3], np.float32)
    directions = np.empty((len(pixels) * len(places), 3), np.float32)
    aim = (rotation, np.float32(half_height * width / height), half_height, width, height, pixels, places)
    for_shares(lambda start, stop: _aim(*aim, start, stop, directions), len(pixels))
    return directions


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def need_points(vertices, is_seen, is_needed):  # type: ignore[no-untyped-def]
    """Note the points that vertices follow from.

    Args:
        vertices: all. is_seen: those that are asked about. (vertices,) uint8. is_needed: written. (points,) uint8
    """
    for v in range(is_seen.shape[0]):
        if is_seen[v]:
            for k in range(vertices.point.shape[1]):
                if vertices.weight[v, k] > 0:
                    is_needed[vertices.point[v, k]] = 1


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
def _spread(vertices, rows, values, start, stop, out):  # type: ignore[no-untyped-def]
    """Find what the vertices that are [start, stop) of rows take from points."""
    for v in rows[start:stop]:
        out[v] = 0
        for k in range(vertices.point.shape[1]):
            w, point = vertices.weight[v, k], vertices.point[v, k]
            if w > 0:
                for c in range(values.shape[1]):
                    out[v, c] += w * values[point, c]


def at_vertices(surface: Surface, is_seen: NDArray[np.uint8], values: F32, out: F32 | None = None) -> F32:
    """Find what vertices take from the points that they follow from.

    Args:
        surface: with both. is_seen: vertices that are asked about. (vertices,) uint8
        values: of points. (points, …) float32. out: written where asked; None: the others get nothing.
    Returns:
        (vertices, …) float32
    """
    flat = values.reshape(len(values), -1)
    found = np.zeros((len(is_seen), *values.shape[1:]), np.float32) if out is None else out
    rows, flat_found = np.flatnonzero(is_seen.view(np.bool_)), found.reshape(len(found), -1)
    for_shares(lambda start, stop: _spread(surface.vertices, rows, flat, start, stop, flat_found), len(rows))
    return found
