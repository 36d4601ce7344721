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

from relume.basis.zernike import ladder
from relume.btf.rings import taps
from relume.moving.bumps import unit
from relume.moving.look_up import Seen
from relume.moving.pixels import blend
from relume.moving.points.surface import Surface
from relume.moving.relief.light import VertexLight, add_turned, light_about
from relume.moving.relief.place import dot, place_of, row
from relume.moving.relief.tables import COMPONENTS, DEGREE, WIDTH, Cover
from relume.parallel import for_shares
from relume.project.texels import sum_weights, texels_about

F32 = NDArray[np.float32]

_MOST = np.float32(20)  # times the mean
_LEAST = np.float32(1e-6)
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


# Helpers are inlined: a call would count references to arrays, which threads share; that was half of the kernel.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _light_in(rungs, light, about, shares, x, y, side, blended, out):  # type: ignore[no-untyped-def]
    """Interpolate the light vectors of three vertices, in the frame of a texture. blended: (1, 3, F). out: (3, F)"""
    out[:] = 0
    a, b, c = about
    t = row(light.tangent, a)
    if min(dot(t, row(light.tangent, b)), dot(t, row(light.tangent, c))) > _ALIKE:
        for channel in range(3):
            for k in range(WIDTH):
                blended[0, channel, k] = (
                    shares[0] * light.vectors[a, channel, k]
                    + shares[1] * light.vectors[b, channel, k]
                    + shares[2] * light.vectors[c, channel, k]
                )
        add_turned(rungs, blended, 0, dot(t, x), dot(t, y), side, np.float32(1), out)
        return
    for q in range(3):
        t = row(light.tangent, about[q])
        add_turned(rungs, light.vectors, about[q], dot(t, x), dot(t, y), side, shares[q], out)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_factors(factors, view, cluster, share, sums, slot, out):  # type: ignore[no-untyped-def]
    """Add the out-factors of a cluster from one side, all its components at once. out: (3 F,)"""
    s0, s1, s2 = share * sums[slot, 0], share * sums[slot, 1], share * sums[slot, 2]
    s3, s4, s5 = share * sums[slot, 3], share * sums[slot, 4], share * sums[slot, 5]
    for i in range(3 * WIDTH):
        out[i] += (
            s0 * factors[view, cluster, 0, i]
            + s1 * factors[view, cluster, 1, i]
            + s2 * factors[view, cluster, 2, i]
            + s3 * factors[view, cluster, 3, i]
            + s4 * factors[view, cluster, 4, i]
            + s5 * factors[view, cluster, 5, i]
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _mean_factors(mean, view, of_view, out):  # type: ignore[no-untyped-def]
    """Sum the out-factors of the mean of all texels between four sides. out: (3 F,)"""
    v0, v1, v2, v3 = view[0], view[1], view[2], view[3]
    w0, w1, w2, w3 = of_view[0], of_view[1], of_view[2], of_view[3]
    for i in range(3 * WIDTH):
        out[i] = w0 * mean[v0, i] + w1 * mean[v1, i] + w2 * mean[v2, i] + w3 * mean[v3, i]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _show(  # type: ignore[no-untyped-def]
    rungs, rings, tables, texels, scale, turn, color, is_alone, pixel_angle, surface, normals, hits, directions,
    vertex, weight, light, rows, emission, eye, start, stop, out,
):  # fmt: skip
    """Show what rays rows[start:stop] see. out: (rays, 3)"""
    levels, cluster, weights = texels
    face, uv, distance = hits
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, share_of = np.empty(8, np.int32), np.empty(8, np.float32)
    found, sums = np.empty(8, np.int32), np.empty((8, 1 + COMPONENTS), np.float32)
    blended, arriving = np.empty((1, 3, WIDTH), np.float32), np.empty((3, WIDTH), np.float32)
    of_texel, of_mean = np.empty(3 * WIDTH, np.float32), np.empty(3 * WIDTH, np.float32)
    for index in range(start, stop):
        ray = rows[index]
        about = vertex[ray, 0], vertex[ray, 1], vertex[ray, 2]
        shares = weight[ray, 0], weight[ray, 1], weight[ray, 2]
        d, n = row(directions, ray), unit(blend(normals, about, shares))
        at = uv[ray, 0], uv[ray, 1]
        x, y, side, u, v, footprint = place_of(surface, face[ray], at, distance[ray], d, eye, n, pixel_angle, turn)
        num = texels_about(levels, scale * u, scale * v, scale * footprint, texel, share_of)
        taps(rings, -dot(d, x), -dot(d, y), -dot(d, n), view, of_view)
        _light_in(rungs, light, about, shares, x, y, side, blended, arriving)
        of_texel[:] = 0
        for tap in range(4):
            num_found = sum_weights(cluster, weights, view[tap], texel, share_of, num, found, sums)
            for slot in range(num_found):
                _add_factors(tables.factors, view[tap], found[slot], of_view[tap], sums, slot, of_texel)
        _mean_factors(tables.mean, view, of_view, of_mean)
        for channel in range(3):
            one = mean = np.float32(0)
            for k in range(WIDTH):
                one += of_texel[channel * WIDTH + k] * arriving[channel, k]
                mean += of_mean[channel * WIDTH + k] * arriving[channel, k]
            ratio = min(max(one, np.float32(0)) / max(mean, _LEAST), _MOST)
            whole = max(out[ray, channel] - emission[channel], np.float32(0))
            share = np.float32(1)
            if not is_alone:
                share = min(max(color[channel] * mean, np.float32(0)) / max(whole, _LEAST), np.float32(1))
            out[ray, channel] += share * (ratio - np.float32(1)) * whole


def show_texels(
    covers: Sequence[Cover],
    surface: Surface,
    positions: F32,
    sight: Sight,
    vectors: F32,
    emission: F32,
    out: F32,
) -> None:
    """Turn what rays see of the mean of texels into what each texel shows.

    Args:
        covers: what covers materials. surface: that is seen. positions: of its corners, metres. (corners, 3) float32
        sight: of the eye. vectors: light vectors of the points. (points, 3, K) float32
        emission: radiance of each material's own. (materials, 3) float32
        out: radiance along the rays, written. (rays, 3) float32
    """
    seen, face = sight.seen, sight.seen.hits.face
    if not covers:
        return
    material = np.where(face >= 0, surface.face_material[np.maximum(face, 0)], -1)
    rows_of = [np.flatnonzero(material == cover.material) for cover in covers]
    is_asked = np.zeros(len(seen.is_seen), np.uint8)
    for rows in rows_of:
        is_asked[seen.vertex[rows]] = 1
    light = light_about(surface, vectors, is_asked)
    for cover, rows in zip(covers, rows_of, strict=True):
        _show_cover(cover, rows, light, surface, positions, sight, emission[cover.material], out)


def _show_cover(
    cover: Cover,
    rows: NDArray[np.intp],
    light: VertexLight,
    surface: Surface,
    positions: F32,
    sight: Sight,
    emission: F32,
    out: F32,
) -> None:
    texels, seen = cover.texels, sight.seen
    of_surface = (positions, surface.uvs, surface.faces, surface.face_normal, surface.uv_scale)
    turn = (np.float32(math.cos(texels.rotation)), np.float32(math.sin(texels.rotation)))
    args: tuple[Any, ...] = (
        ladder(DEGREE), texels.btf.rings, cover.tables, (texels.btf.levels, texels.btf.cluster, texels.btf.weight),
        np.float32(texels.scale), turn, cover.color, cover.is_alone, np.float32(sight.pixel_angle), of_surface,
        surface.vertices.normal, (seen.hits.face, seen.hits.uv, seen.hits.distance), seen.directions, seen.vertex,
        seen.weight, light, rows, emission, sight.eye,
    )  # fmt: skip
    for_shares(lambda start, stop: _show(*args, start, stop, out), len(rows))  # type: ignore[call-arg]
