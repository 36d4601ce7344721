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
from relume.moving.relief.light import ReliefLight, VertexLight, add_turned, turn_by
from relume.moving.relief.numbers import EMPTY, HALF, NUMBERS, PAIRS, WIDTH
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

F32 = NDArray[np.float32]

F = np.float32  # bytes by themselves would make doubles of products
_SHARES = 4  # for each thread: rays that see fine texels cost more
_ALIKE = np.float32(0.999)  # cosine of tangents that azimuths about a ray may be counted from together


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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _join(owner, num_pixels, is_alike, out):  # type: ignore[no-untyped-def]
    """Give rays that `_part` found what their pixels' middles show by now."""
    for k in range(owner.shape[0]):
        if is_alike[num_pixels + k]:
            for channel in range(3):
                out[num_pixels + k, channel] = max(out[num_pixels + k, channel] + out[owner[k], channel], F(0))


# Helpers are inlined, and get arrays, not what holds them: a call, or an attribute, would count references to arrays,
# which threads share; that was three quarters of the kernel.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_texels(weight, step, view, of_view, texel, share, first, out):  # type: ignore[no-untyped-def]
    """Sum the numbers of four texels between four sides, in one line: sums stay in registers.

    Args:
        first: of the four; where it is not 0 they are added. out: (24,)
    """
    a, b, c, d = texel[first], texel[first + 1], texel[first + 2], texel[first + 3]
    e, f, g, h = share[first], share[first + 1], share[first + 2], share[first + 3]
    p, q, r, s = view[0], view[1], view[2], view[3]
    of_p, of_q, of_r, of_s = of_view[0], of_view[1], of_view[2], of_view[3]
    for i in range(NUMBERS):
        one = e * F(weight[p, a, i]) + f * F(weight[p, b, i]) + g * F(weight[p, c, i]) + h * F(weight[p, d, i])
        two = e * F(weight[q, a, i]) + f * F(weight[q, b, i]) + g * F(weight[q, c, i]) + h * F(weight[q, d, i])
        three = e * F(weight[r, a, i]) + f * F(weight[r, b, i]) + g * F(weight[r, c, i]) + h * F(weight[r, d, i])
        four = e * F(weight[s, a, i]) + f * F(weight[s, b, i]) + g * F(weight[s, c, i]) + h * F(weight[s, d, i])
        before = out[i] if first else F(0)
        out[i] = (
            before
            + of_p * step[p, i] * one
            + of_q * step[q, i] * two
            + of_r * step[r, i] * three
            + of_s * step[s, i] * four
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _under(numbers, axes, light, channel):  # type: ignore[no-untyped-def]
    """Sum numbers with the light of a channel: what `AXIS_OF` and `LANE_OF` say, the first axis in one loop."""
    low, high = channel * HALF, PAIRS + channel * HALF
    first = np.float32(0)
    for i in range(HALF):
        # where a lane is empty its light is nothing
        first += numbers[i] * light[low + i] + numbers[HALF + i] * light[high + i]
    l0, l1, l2, l8 = light[low], light[low + 1], light[low + 2], light[high]
    second = numbers[16] * l0 + numbers[17] * l1 + numbers[18] * l2 + numbers[19] * light[low + 3]
    second += numbers[20] * l8 + numbers[21] * light[high + 1]
    third = numbers[22] * l0 + numbers[23] * l8 + numbers[EMPTY] * l2
    return axes[channel, 0] * first + axes[channel, 1] * second + axes[channel, 2] * third


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _show(  # type: ignore[no-untyped-def]
    rings, tables, scale, turned, color, pixel_angle, places, normals, hits, directions, vertex, weight, light, eye,
    rows, start, stop, out,
):  # fmt: skip
    """Show what rays rows[start:stop] see. out: (rays, 3)"""
    face, uv, distance = hits
    levels, weights, step, axes = tables
    tangents, vectors = light
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, share_of = np.empty(8, np.int32), np.empty(8, np.float32)
    blended, arriving = np.empty(3 * WIDTH, np.float32), np.empty(3 * WIDTH, np.float32)
    numbers, columns = np.empty(NUMBERS, np.float32), np.zeros(NUM_COLUMNS * AT_ONCE, np.float32)
    finest = np.float32(max(levels[0, 1], levels[0, 2]))
    for begin in range(start, stop, AT_ONCE):
        num_rays = min(AT_ONCE, stop - begin)
        gather(places, normals, face, uv, distance, directions, vertex, weight, rows, begin, num_rays, columns)
        lay(columns, num_rays, eye, pixel_angle, turned, scale, finest)
        for j in range(num_rays):
            ray = rows[begin + j]
            num = texels_at(levels, columns[U + j], columns[V + j], columns[LEVEL + j], texel, share_of)
            taps_at(rings, columns[THETA + j], columns[TURN + j], view, of_view)
            a, b, c = about = vertex[ray, 0], vertex[ray, 1], vertex[ray, 2]
            shares = weight[ray, 0], weight[ray, 1], weight[ray, 2]
            x, y, t = three(columns, X, j), three(columns, Y, j), row(tangents, a)
            is_alike = min(dot(t, row(tangents, b)), dot(t, row(tangents, c))) > _ALIKE
            for q in range(1 if is_alike else 3):  # each turned by itself where frames differ
                t = row(tangents, about[q])
                of_a = shares[0] if is_alike or q == 0 else F(0)
                of_b = shares[1] if is_alike or q == 1 else F(0)
                of_c = shares[2] if is_alike or q == 2 else F(0)
                for i in range(3 * WIDTH):
                    blended[i] = of_a * vectors[a, i] + of_b * vectors[b, i] + of_c * vectors[c, i]
                add_turned(blended, turn_by(dot(t, x), dot(t, y)), columns[SIDE + j], F(1), q > 0, arriving)
            for first in range(0, num, 4):
                _add_texels(weights, step, view, of_view, texel, share_of, first, numbers)
            for channel in range(3):
                more = color[channel] * _under(numbers, axes, arriving, channel)
                out[ray, channel] = max(out[ray, channel] + more, F(0))


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
        texels.btf.rings, cover.tables, np.float32(texels.scale), turned, cover.color, np.float32(sight.pixel_angle),
        places, surface.vertices.normal, (seen.hits.face, seen.hits.uv, seen.hits.distance), seen.directions,
        seen.vertex, seen.weight, light, sight.eye,
    )  # fmt: skip
