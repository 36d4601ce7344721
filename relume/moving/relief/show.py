"""From the mean of all texels to each: what one sends over what all do on the mean, in the light that arrives there.

    B(pixel) = B̄ · r,   r = Σ_k p_k(ωo, x) t_k / Σ_k p̄_k(ωo) t_k

B̄ is what surfaces send by the mean of texels; shadows' edges and catchers are found for each pixel, and stay. Of
a material with other terms, r counts for the share that the BTF has. At rest, each texel is summed over all light
(`relume.project.texels`).
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
from relume.moving.relief.light import ReliefLight, VertexLight, add_turned, turns
from relume.moving.relief.numbers import EMPTY, HALF, NUMBERS, WIDTH
from relume.moving.relief.place import dot, place_of, row
from relume.moving.relief.tables import Cover
from relume.parallel import for_shares
from relume.project.texels import texels_about

F32 = NDArray[np.float32]

F = np.float32  # bytes are not floats by themselves: products would be doubles
_MOST = np.float32(20)  # times the mean
_LEAST = np.float32(1e-6)
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
def _list(face, face_material, cover_of, vertex, first, rows, is_asked):  # type: ignore[no-untyped-def]
    """List rays that see covered materials, cover after cover. rows: (rays,). first: (covers + 1,). All written."""
    first[:] = 0
    for ray in range(face.shape[0]):
        if face[ray] >= 0:
            cover = cover_of[face_material[face[ray]]]
            if cover >= 0:
                first[cover + 1] += 1
    for cover in range(first.shape[0] - 1):
        first[cover + 1] += first[cover]
    place = first.copy()
    for ray in range(face.shape[0]):
        if face[ray] >= 0:
            cover = cover_of[face_material[face[ray]]]
            if cover >= 0:
                rows[place[cover]] = ray
                place[cover] += 1
                for k in range(3):
                    is_asked[vertex[ray, k]] = 1


# Helpers are inlined, and get arrays, not what holds them: a call, or an attribute, would count references to arrays,
# which threads share; that was three quarters of the kernel.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _light_in(tangents, vectors, about, shares, x, y, side, turn, blended, out):  # type: ignore[no-untyped-def]
    """Interpolate the light vectors of three vertices, in a texture's frame. turn, blended: scratch. out: (3 F,)"""
    for i in range(3 * WIDTH):
        out[i] = 0
    a, b, c = about
    t = row(tangents, a)
    if min(dot(t, row(tangents, b)), dot(t, row(tangents, c))) > _ALIKE:
        for i in range(3 * WIDTH):
            blended[i] = shares[0] * vectors[a, i] + shares[1] * vectors[b, i] + shares[2] * vectors[c, i]
        turns(dot(t, x), dot(t, y), side, np.float32(1), turn)
        add_turned(blended, turn, out)
    else:
        for q in range(3):
            t = row(tangents, about[q])
            turns(dot(t, x), dot(t, y), side, shares[q], turn)
            for i in range(3 * WIDTH):
                blended[i] = vectors[about[q], i]
            add_turned(blended, turn, out)


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
    rings, tables, scale, turned, color, is_alone, pixel_angle, surface, normals, hits, directions, vertex, weight,
    light, emission, eye, rows, start, stop, out,
):  # fmt: skip
    """Show what rays rows[start:stop] see. out: (rays, 3)"""
    face, uv, distance = hits
    levels, weights, step, means, axes = tables
    tangents, vectors = light
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, share_of = np.empty(8, np.int32), np.empty(8, np.float32)
    turn, blended = np.empty((4, HALF), np.float32), np.empty(3 * WIDTH, np.float32)
    arriving, mean = np.empty(3 * WIDTH, np.float32), np.empty(NUMBERS, np.float32)
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
        _light_in(tangents, vectors, about, shares, x, y, side, turn, blended, arriving)
        p, q, r, s = view[0], view[1], view[2], view[3]
        for i in range(NUMBERS):
            numbers[i] = np.float32(0)
            mean[i] = (
                of_view[0] * means[p, i]
                + of_view[1] * means[q, i]
                + of_view[2] * means[r, i]
                + of_view[3] * means[s, i]
            )
        for first in range(0, num, 4):
            _add_texels(weights, step, view, of_view, texel, share_of, first, numbers)
        for channel in range(3):
            of_mean = _under(mean, axes, arriving, channel)
            ratio = (of_mean + _under(numbers, axes, arriving, channel)) / max(of_mean, _LEAST)
            ratio = min(max(ratio, np.float32(0)), _MOST)
            whole = max(out[ray, channel] - emission[channel], np.float32(0))
            share = np.float32(1)
            if not is_alone:
                share = min(max(color[channel] * of_mean, np.float32(0)) / max(whole, _LEAST), np.float32(1))
            out[ray, channel] += share * (ratio - np.float32(1)) * whole


def show_texels(
    covers: Sequence[Cover],
    surface: Surface,
    positions: F32,
    sight: Sight,
    arriving: Arrived,
    emission: F32,
    out: F32,
) -> None:
    """Turn what rays see of the mean of texels into what each texel shows.

    Args:
        covers: what covers materials. surface: that is seen. positions: of its corners, metres. (corners, 3) float32
        sight: of the eye. arriving: at its points.
        emission: radiance of each material's own. (materials, 3) float32
        out: radiance along the rays, written. (rays, 3) float32
    """
    if not covers:
        return
    seen, face = sight.seen, sight.seen.hits.face
    cover_of = np.full(len(emission), -1, np.int32)
    cover_of[[cover.material for cover in covers]] = np.arange(len(covers))
    first, rows = np.empty(len(covers) + 1, np.int64), np.empty(len(face), np.int32)
    is_asked = np.zeros(len(seen.is_seen), np.uint8)
    _list(face, surface.face_material, cover_of, seen.vertex, first, rows, is_asked)
    light = arriving.light.about(surface, arriving.vectors, is_asked)
    args = [_args_of(cover, surface, positions, sight, light, emission[cover.material]) for cover in covers]

    def show(start: int, stop: int) -> None:
        for k, of_cover in enumerate(args):
            begin, end = max(start, int(first[k])), min(stop, int(first[k + 1]))
            if begin < end:
                _show(*of_cover, rows, begin, end, out)  # type: ignore[call-arg]

    for_shares(show, int(first[-1]), _SHARES)


def _args_of(
    cover: Cover, surface: Surface, positions: F32, sight: Sight, light: VertexLight, emission: F32
) -> tuple[Any, ...]:
    texels, seen = cover.texels, sight.seen
    of_surface = (positions, surface.uvs, surface.faces, surface.face_normal, surface.uv_scale)
    turned = (np.float32(math.cos(texels.rotation)), np.float32(math.sin(texels.rotation)))
    return (
        texels.btf.rings, cover.tables, np.float32(texels.scale), turned, cover.color, cover.is_alone,
        np.float32(sight.pixel_angle), of_surface, surface.vertices.normal,
        (seen.hits.face, seen.hits.uv, seen.hits.distance), seen.directions, seen.vertex, seen.weight, light,
        emission, sight.eye,
    )  # fmt: skip
