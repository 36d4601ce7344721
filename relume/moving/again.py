"""A frame after an edit of materials, its eye and its light as they were: only what shows them is found anew.

What an eye meets, the light at points and all other materials stay. Of points those are evaluated whose own material
was edited, of vertices those that take from such points, of rays those that show either.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED
from relume.views.resolve import pack_rgb9e5

F32 = NDArray[np.float32]


class Part(NamedTuple):
    """What of a picture shows some materials.

    Attributes:
        points: that send by them. (points,) uint8. vertices: that take from those. (vertices,) uint8
        rays: that show them; None: all. (n,) int32
    """

    points: NDArray[np.uint8]
    vertices: NDArray[np.uint8]
    rays: NDArray[np.int32] | None


class Shown(NamedTuple):
    """A part of a picture, and its pixels.

    Attributes:
        pixels: that have any of its rays. (m,) int32
        first: of each, where its other rays begin among those that go through no middle. (m,) int64
    """

    part: Part
    pixels: NDArray[np.int32]
    first: NDArray[np.intp]


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _mark_vertices(vertices, is_seen, points, out):  # type: ignore[no-untyped-def]
    for v in range(is_seen.shape[0]):
        if is_seen[v]:
            for k in range(vertices.point.shape[1]):
                if vertices.weight[v, k] > 0 and points[vertices.point[v, k]]:
                    out[v] = 1


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _mark_rays(material, is_changed, vertices, face, vertex, weight, owner, out, pixels):  # type: ignore[no-untyped-def]
    num_pixels = pixels.shape[0]
    for r in range(face.shape[0]):
        if face[r] < 0:
            continue
        shows = is_changed[material[face[r]]]
        for k in range(3):
            shows |= weight[r, k] != 0 and vertices[vertex[r, k]] != 0
        if shows:
            out[r] = 1
            pixels[r if r < num_pixels else owner[r - num_pixels]] = 1


def shown_of(surface: Surface, seen: Seen, is_changed: NDArray[np.bool_], num_pixels: int) -> Shown:
    """Find what of a picture shows some materials.

    Args:
        surface: that is seen. seen: by the rays of the picture, no glass among it.
        is_changed: whether a material is one of them. (materials,) bool. num_pixels: of the picture.
    """
    points = (seen.is_needed & is_changed[surface.material]).astype(np.uint8)
    vertices, rays = np.zeros_like(seen.is_seen), np.zeros(len(seen.directions), np.bool_)
    _mark_vertices(surface.vertices, seen.is_seen, points, vertices)
    pixels, of_rays = np.zeros(num_pixels, np.bool_), (seen.hits.face, seen.vertex, seen.weight, seen.owner)
    _mark_rays(surface.face_material, is_changed, vertices, *of_rays, rays, pixels)
    part = Part(points, vertices, np.flatnonzero(rays).astype(np.int32))
    chosen = np.flatnonzero(pixels).astype(np.int32)
    return Shown(part, chosen, np.searchsorted(seen.owner, chosen))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _resolve_some(radiance, owner, first, pixels, start, stop, out, words):  # type: ignore[no-untyped-def]
    """Resolve the pixels that are [start, stop) of pixels."""
    num_pixels = out.shape[0]
    for i in range(start, stop):
        p, r, num = pixels[i], first[i], np.float32(1)
        red, green, blue = radiance[p, 0], radiance[p, 1], radiance[p, 2]
        while r < owner.shape[0] and owner[r] == p:
            red += radiance[num_pixels + r, 0]
            green += radiance[num_pixels + r, 1]
            blue += radiance[num_pixels + r, 2]
            num += 1
            r += 1
        out[p, 0], out[p, 1], out[p, 2] = red / num, green / num, blue / num
        words[p] = pack_rgb9e5(out[p, 0], out[p, 1], out[p, 2])


def resolve_some(radiance: F32, owner: NDArray[np.int32], shown: Shown, out: F32, words: NDArray[np.uint32]) -> None:
    """Take the mean of all rays of some pixels; see `relume.moving.edges.resolve`, which does so of all.

    Args:
        radiance: of the rays through the middles of all pixels, then of the others. (rays, 3) float32
        owner: pixels of the others, rising. (m,) int32. shown: with the pixels that are asked.
        out: written there. (num_pixels, 3) float32. words: the same, packed. (num_pixels,) uint32
    """
    args = radiance, owner, shown.first, shown.pixels
    for_shares(lambda start, stop: _resolve_some(*args, start, stop, out, words), len(shown.pixels))
