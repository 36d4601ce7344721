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

from relume.btf.rings import taps
from relume.moving.bumps import unit
from relume.moving.look_up import Seen
from relume.moving.pixels import blend
from relume.moving.points.surface import Surface
from relume.moving.relief.light import ReliefLight, VertexLight, add_turned, turn_by
from relume.moving.relief.numbers import EMPTY, NUMBERS, WIDTH
from relume.moving.relief.place import dot, place_of, row
from relume.moving.relief.tables import Cover
from relume.parallel import for_shares
from relume.project.texels import texels_about

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
def _list(face, face_material, is_covered, vertex, first, rows, is_asked):  # type: ignore[no-untyped-def]
    """List rays that see covered materials, material after material, and note the vertices about what they see.

    Args:
        is_covered: (materials,). first: place of each material's in `rows`, written. (materials + 1,). rows: (rays,)
    """
    first[:] = 0
    for ray in range(face.shape[0]):
        if face[ray] >= 0:
            first[face_material[face[ray]] + 1] += is_covered[face_material[face[ray]]]
    for material in range(is_covered.shape[0]):
        first[material + 1] += first[material]
    place = first.copy()
    for ray in range(face.shape[0]):
        if face[ray] >= 0 and is_covered[face_material[face[ray]]]:
            material = face_material[face[ray]]
            rows[place[material]] = ray
            place[material] += 1
            for k in range(3):
                is_asked[vertex[ray, k]] = 1


# Helpers are inlined, and get arrays, not what holds them: a call, or an attribute, would count references to arrays,
# which threads share; that was three quarters of the kernel.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_texels(weight, step, view, of_view, texel, share, first, out):  # type: ignore[no-untyped-def]
    """Add the numbers of four texels between four sides, in one line: sums stay in registers. out: (24,)"""
    a, b, c, d = texel[first], texel[first + 1], texel[first + 2], texel[first + 3]
    e, f, g, h = share[first], share[first + 1], share[first + 2], share[first + 3]
    p, q, r, s = view[0], view[1], view[2], view[3]
    of_p, of_q, of_r, of_s = of_view[0], of_view[1], of_view[2], of_view[3]
    for i in range(NUMBERS):
        one = e * F(weight[p, a, i]) + f * F(weight[p, b, i]) + g * F(weight[p, c, i]) + h * F(weight[p, d, i])
        two = e * F(weight[q, a, i]) + f * F(weight[q, b, i]) + g * F(weight[q, c, i]) + h * F(weight[q, d, i])
        three = e * F(weight[r, a, i]) + f * F(weight[r, b, i]) + g * F(weight[r, c, i]) + h * F(weight[r, d, i])
        four = e * F(weight[s, a, i]) + f * F(weight[s, b, i]) + g * F(weight[s, c, i]) + h * F(weight[s, d, i])
        out[i] += (
            of_p * step[p, i] * one + of_q * step[q, i] * two + of_r * step[r, i] * three + of_s * step[s, i] * four
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _under(numbers, axes, light, channel):  # type: ignore[no-untyped-def]
    """Sum numbers with the light of a channel: what `AXIS_OF` and `LANE_OF` say, the first axis in one loop."""
    low = channel * WIDTH
    first = np.float32(0)
    for i in range(WIDTH):
        first += numbers[i] * light[low + i]  # where a lane is empty its light is nothing
    l0, l1, l2, l8 = light[low], light[low + 1], light[low + 2], light[low + 8]
    second = numbers[16] * l0 + numbers[17] * l1 + numbers[18] * l2 + numbers[19] * light[low + 3]
    second += numbers[20] * l8 + numbers[21] * light[low + 9]
    third = numbers[22] * l0 + numbers[23] * l8 + numbers[EMPTY] * l2
    return axes[channel, 0] * first + axes[channel, 1] * second + axes[channel, 2] * third


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _show(  # type: ignore[no-untyped-def]
    rings, tables, scale, turned, color, pixel_angle, surface, normals, hits, directions, vertex, weight, light, eye,
    rows, start, stop, out,
):  # fmt: skip
    """Show what rays rows[start:stop] see. out: (rays, 3)"""
    face, uv, distance = hits
    levels, weights, step, axes = tables
    tangents, vectors = light
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, share_of = np.empty(8, np.int32), np.empty(8, np.float32)
    blended, arriving = np.empty(3 * WIDTH, np.float32), np.empty(3 * WIDTH, np.float32)
    numbers = np.empty(NUMBERS, np.float32)
    for index in range(start, stop):
        ray = rows[index]
        about = vertex[ray, 0], vertex[ray, 1], vertex[ray, 2]
        shares = weight[ray, 0], weight[ray, 1], weight[ray, 2]
        d, n = row(directions, ray), unit(blend(normals, about, shares))
        at = uv[ray, 0], uv[ray, 1]
        x, y, side, u, v, footprint = place_of(surface, face[ray], at, distance[ray], d, eye, n, pixel_angle, turned)
        num = texels_about(levels, scale * u, scale * v, scale * footprint, texel, share_of)
        taps(rings, -dot(d, x), -dot(d, y), -dot(d, n), view, of_view)
        for i in range(3 * WIDTH):
            arriving[i] = F(0)
        a, b, c = about
        t = row(tangents, a)
        is_alike = min(dot(t, row(tangents, b)), dot(t, row(tangents, c))) > _ALIKE
        for q in range(1 if is_alike else 3):  # each turned by itself where frames differ
            t = row(tangents, about[q])
            of_a = shares[0] if is_alike or q == 0 else F(0)
            of_b = shares[1] if is_alike or q == 1 else F(0)
            of_c = shares[2] if is_alike or q == 2 else F(0)
            for i in range(3 * WIDTH):
                blended[i] = of_a * vectors[a, i] + of_b * vectors[b, i] + of_c * vectors[c, i]
            add_turned(blended, turn_by(dot(t, x), dot(t, y)), side, F(1), arriving)
        for i in range(NUMBERS):
            numbers[i] = F(0)
        for first in range(0, num, 4):
            _add_texels(weights, step, view, of_view, texel, share_of, first, numbers)
        for channel in range(3):
            more = color[channel] * _under(numbers, axes, arriving, channel)
            out[ray, channel] = max(out[ray, channel] + more, F(0))


def show_texels(
    covers: Sequence[Cover], surface: Surface, positions: F32, sight: Sight, arriving: Arrived, out: F32
) -> None:
    """Turn what rays see of the mean of texels into what each texel shows.

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
    is_asked = np.zeros(len(seen.is_seen), np.uint8)
    _list(face, surface.face_material, is_covered, seen.vertex, first, rows, is_asked)
    light = arriving.light.about(surface, arriving.vectors, is_asked)
    spans = [
        (int(first[cover.material]), int(first[cover.material + 1]), _args_of(cover, surface, positions, sight, light))
        for cover in covers
    ]

    def show(start: int, stop: int) -> None:
        for begin, end, args in spans:
            if max(start, begin) < min(stop, end):
                _show(*args, rows, max(start, begin), min(stop, end), out)  # type: ignore[call-arg]

    for_shares(show, int(first[-1]), _SHARES)


def _args_of(cover: Cover, surface: Surface, positions: F32, sight: Sight, light: VertexLight) -> tuple[Any, ...]:
    texels, seen = cover.texels, sight.seen
    of_surface = (positions, surface.uvs, surface.faces, surface.face_normal, surface.uv_scale)
    turned = (np.float32(math.cos(texels.rotation)), np.float32(math.sin(texels.rotation)))
    return (
        texels.btf.rings, cover.tables, np.float32(texels.scale), turned, cover.color, np.float32(sight.pixel_angle),
        of_surface, surface.vertices.normal, (seen.hits.face, seen.hits.uv, seen.hits.distance), seen.directions,
        seen.vertex, seen.weight, light, sight.eye,
    )  # fmt: skip
