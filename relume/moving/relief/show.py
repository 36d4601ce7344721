"""From the mean of all texels to each: what one sends more than all do on the mean, in the light that arrives there.

    B(pixel) = B̄ + C Σ_k (p_k(ωo, x) − p̄_k(ωo)) t_k

B̄ is what surfaces send by the mean of texels, by all that is known of light; C the term's colour and gain. At rest,
each texel is summed over all light (`relume.project.texels`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.btf.rings import taps_at
from relume.moving.edges import differ
from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.moving.relief.lanes import add_texels, few_of, under_light
from relume.moving.relief.light import ReliefLight, VertexLight, turned_by
from relume.moving.relief.numbers import NUMBERS
from relume.moving.relief.place import (
    AT_ONCE,
    LEVEL,
    NUM_COLUMNS,
    SIDE,
    THETA,
    TURN,
    U,
    V,
    X,
    Y,
    dot,
    gather,
    lay,
    row,
    three,
)
from relume.moving.relief.tables import Cover
from relume.parallel import for_shares
from relume.project.texels import texels_at
from relume.uncounted import UNCOUNTED
from relume.vector_code import call_for

F32 = NDArray[np.float32]

F = np.float32
_SHARES = 4  # for each thread: rays that see fine texels cost more


class Sight(NamedTuple):
    """Whose picture it is.

    Attributes:
        eye: where it is. (3,) float32. pixel_angle: that a pixel spans, radians.
        seen: by the rays.
    """

    eye: F32
    pixel_angle: float
    seen: Seen


class Arrived(NamedTuple):
    """What arrives at points, and what has been made of it.

    Attributes:
        vectors: light vectors. (points, 3, K) float32. light: about vertices, kept from frame to frame.
    """

    vectors: F32
    light: ReliefLight


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _list(face, face_material, is_covered, is_alike, vertex, first, rows, is_asked):  # type: ignore[no-untyped-def]
    """List rays that see covered materials, material after material, and note the vertices about what they see.

    Args:
        is_covered: (materials,). is_alike: of rays, which are left out where it is 1.
        first: place of each material's in `rows`, written. (materials + 1,). rows: (rays,)
    """
    first[:] = 0
    for ray in range(face.shape[0]):
        if face[ray] >= 0 and not is_alike[ray]:
            first[face_material[face[ray]] + 1] += is_covered[face_material[face[ray]]]
    for material in range(is_covered.shape[0]):
        first[material + 1] += first[material]
    place = first.copy()
    for ray in range(face.shape[0]):
        if face[ray] >= 0 and not is_alike[ray] and is_covered[face_material[face[ray]]]:
            material = face_material[face[ray]]
            rows[place[material]] = ray
            place[material] += 1
            for k in range(3):
                is_asked[vertex[ray, k]] = 1


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _part(owner, num_pixels, is_covered, face_material, face_normal, face, distance, directions, is_alike, out):  # type: ignore[no-untyped-def]
    """Find rays across edges that see the texture of their pixel's middle, and take from them what that shows.

    Args:
        owner: pixels of the rays. is_alike: of all rays, written. out: what they show of the mean, written. (rays, 3)
    """
    for k in range(owner.shape[0]):
        ray, p = num_pixels + k, owner[k]
        f = face[ray]
        if f < 0 or not is_covered[face_material[f]]:
            continue
        if not differ(face_material, face_normal, face, distance, directions, p, ray):
            is_alike[ray] = 1
            for channel in range(3):
                out[ray, channel] -= out[p, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _join(owner, num_pixels, is_alike, out):  # type: ignore[no-untyped-def]
    """Give rays that `_part` found what their pixels' middles show by now."""
    for k in range(owner.shape[0]):
        if is_alike[num_pixels + k]:
            for channel in range(3):
                out[num_pixels + k, channel] = max(out[num_pixels + k, channel] + out[owner[k], channel], F(0))


# Helpers are inlined, and get arrays, not what holds them: a call, or an attribute, would count references to arrays,
# which threads share; that was three quarters of the kernel.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _ask(levels, rings, weights, columns, num_rays, of_one, asked, counts):  # type: ignore[no-untyped-def]
    """Find the texels and the sides that rays show, and call for their numbers: they arrive while others are summed.

    Args:
        of_one: room for what is found of one ray. asked: the same of all: texels, 8 a ray; shares of each, 8 a ray;
            sides, 4 a ray; shares of each, 4 a ray; written. counts: texels of each, written.
    """
    texel, share, view, of_view = of_one
    texels, shares, views, of_views = asked
    for j in range(num_rays):
        counts[j] = texels_at(levels, columns[U + j], columns[V + j], columns[LEVEL + j], texel, share)
        taps_at(rings, columns[THETA + j], columns[TURN + j], view, of_view)
        for k in range(8):
            texels[8 * j + k], shares[8 * j + k] = texel[k], share[k]
        for k in range(4):
            views[4 * j + k], of_views[4 * j + k] = view[k], of_view[k]
            for first in range(0, counts[j], 2):  # two beside each other are two lines of the cache at most
                call_for(weights, (view[k], texel[first], 0))
                call_for(weights, (view[k], texel[first + 1], NUMBERS - 1))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _arriving(numbers, axes, few_axes, tangents, vectors, about, shares, x, y, side):  # type: ignore[no-untyped-def]
    """Sum numbers with the light between three vertices, of each channel.

    Args:
        numbers, axes, few_axes, vectors, about, shares, side: of `under_light`. tangents: of vertices.
        x, y: axes of the texture, tuples.
    """
    t, u, v = row(tangents, about[0]), row(tangents, about[1]), row(tangents, about[2])
    of_t, of_u, of_v = (
        turned_by(dot(t, x), dot(t, y)),
        turned_by(dot(u, x), dot(u, y)),
        turned_by(dot(v, x), dot(v, y)),
    )
    turns = of_t[0], of_t[1], of_u[0], of_u[1], of_v[0], of_v[1]
    return under_light(numbers, axes, few_axes, vectors, about, shares, turns, side)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _show(  # type: ignore[no-untyped-def]
    rings, tables, few_axes, scale, turned, color, pixel_angle, places, normals, hits, directions, vertex, weight,
    light, eye, rows, start, stop, out,
):  # fmt: skip
    """Show what rays rows[start:stop] see. out: (rays, 3)"""
    face, uv, distance = hits
    levels, weights, step, axes = tables
    tangents, vectors = light
    of_one = np.empty(8, np.int32), np.empty(8, np.float32), np.empty(4, np.int32), np.empty(4, np.float32)
    texels, shares_of = np.empty(8 * AT_ONCE, np.int32), np.empty(8 * AT_ONCE, np.float32)
    views, of_views = np.empty(4 * AT_ONCE, np.int32), np.empty(4 * AT_ONCE, np.float32)
    counts, numbers = np.empty(AT_ONCE, np.int64), np.empty(NUMBERS, np.float32)
    columns = np.zeros(NUM_COLUMNS * AT_ONCE, np.float32)
    finest = np.float32(max(levels[0, 1], levels[0, 2]))
    for begin in range(start, stop, AT_ONCE):
        num_rays = min(AT_ONCE, stop - begin)
        gather(places, normals, face, uv, distance, directions, vertex, weight, rows, begin, num_rays, columns)
        lay(columns, num_rays, eye, pixel_angle, turned, scale, finest)
        _ask(levels, rings, weights, columns, num_rays, of_one, (texels, shares_of, views, of_views), counts)
        for j in range(num_rays):
            ray = rows[begin + j]
            for first in range(0, counts[j], 4):
                add_texels(weights, step, views, of_views, 4 * j, texels, shares_of, 8 * j + first, first > 0, numbers)
            about = vertex[ray, 0], vertex[ray, 1], vertex[ray, 2]
            shares = weight[ray, 0], weight[ray, 1], weight[ray, 2]
            x, y, side = three(columns, X, j), three(columns, Y, j), columns[SIDE + j]
            more = _arriving(numbers, axes, few_axes, tangents, vectors, about, shares, x, y, side)
            out[ray, 0] = max(out[ray, 0] + color[0] * more[0], F(0))
            out[ray, 1] = max(out[ray, 1] + color[1] * more[1], F(0))
            out[ray, 2] = max(out[ray, 2] + color[2] * more[2], F(0))


def show_texels(
    covers: Sequence[Cover], surface: Surface, positions: F32, sight: Sight, arriving: Arrived, out: F32
) -> None:
    """Turn what rays see of the mean of texels into what each texel shows.

    Rays of one pixel that see the same surface show it more than the mean by as much: texels are as wide as its side.

    Args:
        covers: what covers materials. surface: that is seen. positions: of its corners, metres. (corners, 3) float32
        sight: of the eye. arriving: at its points.
        out: radiance along the rays, written. (rays, 3) float32
    """
    if not covers:
        return
    seen, face = sight.seen, sight.seen.hits.face
    is_covered = np.zeros(1 + max(int(surface.face_material.max()), *(cover.material for cover in covers)), np.uint8)
    is_covered[[cover.material for cover in covers]] = 1
    first, rows = np.empty(len(is_covered) + 1, np.int64), np.empty(len(face), np.int32)
    is_asked, is_alike = np.zeros(len(seen.is_seen), np.uint8), np.zeros(len(face), np.uint8)
    of_pixels = seen.owner, len(face) - len(seen.owner) - len(seen.panes.ray)
    of_surface = is_covered, surface.face_material, surface.face_normal
    _part(*of_pixels, *of_surface, face, seen.hits.distance, seen.directions, is_alike, out)
    _list(face, surface.face_material, is_covered, is_alike, seen.vertex, first, rows, is_asked)
    light = arriving.light.about(surface, arriving.vectors, is_asked)
    places = arriving.light.places(surface, positions)
    spans = [
        (int(first[cover.material]), int(first[cover.material + 1]), _args_of(cover, surface, places, sight, light))
        for cover in covers
    ]

    def show(start: int, stop: int) -> None:
        for begin, end, args in spans:
            if max(start, begin) < min(stop, end):
                _show(*args, rows, max(start, begin), min(stop, end), out)  # type: ignore[call-arg]

    for_shares(show, int(first[-1]), _SHARES)
    _join(*of_pixels, is_alike, out)


def _args_of(cover: Cover, surface: Surface, places: F32, sight: Sight, light: VertexLight) -> tuple[Any, ...]:
    texels, seen = cover.texels, sight.seen
    turned = (np.float32(math.cos(texels.rotation)), np.float32(math.sin(texels.rotation)))
    return (
        texels.btf.rings, cover.tables, few_of(cover.tables.axes), np.float32(texels.scale), turned, cover.color,
        np.float32(sight.pixel_angle), places, surface.vertices.normal,
        (seen.hits.face, seen.hits.uv, seen.hits.distance), seen.directions, seen.vertex, seen.weight, light, sight.eye,
    )  # fmt: skip
