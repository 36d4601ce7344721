"""Textures that look different from every side, while the eye moves: what a texel sends over what all send on the mean.

    B(pixel) = B̄ · r,   r = ((1 − s) U_x(ωo) + s B_x(ωo, ωD)) / ((1 − s) Ū(ωo) + s B̄(ωo, ωD))

B̄ is what points send by the mean of all texels, under all light with its shadows. The texel itself is seen under light
from all sides, U, and from the one where most of it comes from, ωD, in the share s = sin θ of that: light that comes
evenly, or from right above, leans to no side. At rest each texel is summed over all light (`relume.project.texels`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.brdf.registry import TERMS
from relume.brdf.terms.btf import Texels
from relume.btf.eigen import EigenBtf
from relume.btf.rings import Rings, taps, taps_numpy
from relume.moving.bumps import unit
from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.parallel import for_shares
from relume.project.texels import gather_texels

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST = np.float32(20)  # times the mean
_LEAST = np.float32(1e-6)
_COMPONENTS = 6  # that are enough while the eye moves
_AROUND, _DOWN = 180, 45  # directions that the sky's share of each light direction is summed over


class LightTables(NamedTuple):
    """Of a BTF, with as many components as are enough while the eye moves.

    Attributes:
        weights: of its texels. (texels, C) float32
        by_light: its tables, components and channels innermost. (K, V, L, (1 + C) · 3) float32
        open_sky: the same under light from all sides. (K, V, (1 + C) · 3) float32
        mean: of all texels, from each side in light from each. (V, L, 3) float32
        mean_open: the same under light from all sides. (V, 3) float32
    """

    weights: F32
    by_light: F32
    open_sky: F32
    mean: F32
    mean_open: F32


class Cover(NamedTuple):
    """What covers a material, and how."""

    texels: Texels
    tables: LightTables


def covers_of(materials: Sequence[Sequence[Mapping[str, Any]]]) -> dict[int, Cover]:
    """Find the materials that a BTF covers; of several terms the first counts.

    Args:
        materials: the terms of each, of a complete look.
    """
    found = {}
    for index, terms in enumerate(materials):
        settled = (TERMS[term["model"]].settled(term).texels for term in terms)
        texels = next((one for one in settled if one is not None), None)
        if texels is not None:
            found[index] = Cover(texels, _light_tables(texels.btf))
    return found


@lru_cache(maxsize=3)
def _light_tables(whole: EigenBtf) -> LightTables:
    found, share, average = whole.with_components(_COMPONENTS), _open_sky(whole.rings), whole.average
    tables = found.tables()
    clusters, views, _, _, lights = tables.shape
    by_light = np.ascontiguousarray(tables.transpose(0, 1, 4, 2, 3)).reshape(clusters, views, lights, -1)
    open_sky, mean_open = (tables @ share).reshape(clusters, views, -1), np.einsum("vlc,l->vc", average, share)
    return LightTables(found.weight.astype(np.float32), by_light, open_sky, average, mean_open)


def _open_sky(rings: Rings) -> F32:
    """What of a sky that is bright all over is told by each direction. (L,) steradians"""
    z = (np.arange(_DOWN) + 0.5) / _DOWN
    phi = (np.arange(_AROUND) + 0.5) * (2 * np.pi / _AROUND)
    z, phi = (grid.ravel() for grid in np.meshgrid(z, phi))
    sine = np.sqrt(1 - z**2)
    index, weight, left = taps_numpy(rings, np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1))
    out = np.zeros(rings.num_directions)
    np.add.at(out, index, weight * left[:, None] * (2 * np.pi / len(z)))
    return out.astype(np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _row(array, k):  # type: ignore[no-untyped-def]
    return array[k, 0], array[k, 1], array[k, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _frame(p0, p1, p2, uvs, n):  # type: ignore[no-untyped-def]
    """Find the texture's axes across a normal, and whether it has a place in textures; see `relume.trace.surface`."""
    e1 = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    e2 = p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]
    du1, dv1, du2, dv2 = uvs[1, 0] - uvs[0, 0], uvs[1, 1] - uvs[0, 1], uvs[2, 0] - uvs[0, 0], uvs[2, 1] - uvs[0, 1]
    area = du1 * dv2 - du2 * dv1
    sign = np.float32(1) if area > 0 else np.float32(-1)
    u = (
        sign * (e1[0] * dv2 - e2[0] * dv1),
        sign * (e1[1] * dv2 - e2[1] * dv1),
        sign * (e1[2] * dv2 - e2[2] * dv1),
    )
    v = (
        sign * (e2[0] * du1 - e1[0] * du2),
        sign * (e2[1] * du1 - e1[1] * du2),
        sign * (e2[2] * du1 - e1[2] * du2),
    )
    along = _dot(u, n)
    x = unit((u[0] - along * n[0], u[1] - along * n[1], u[2] - along * n[2]))
    y = _cross(n, x)
    side = np.float32(1) if _dot(_cross(n, u), v) < 0 else np.float32(-1)  # v runs down
    return x, (side * y[0], side * y[1], side * y[2]), area != 0


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _projected(face_normal):  # type: ignore[no-untyped-def]
    """Find the axes of a texture that is projected along the axis of the world that a face looks along most."""
    a, b, c = abs(face_normal[0]), abs(face_normal[1]), abs(face_normal[2])
    zero, one = np.float32(0), np.float32(1)
    if a >= b and a >= c:
        sign = one if face_normal[0] > 0 else -one
        across, axis = (zero, zero, -sign), (sign, zero, zero)
    elif b >= c:
        sign = one if face_normal[1] > 0 else -one
        across, axis = (one, zero, zero), (zero, sign, zero)
    else:
        sign = one if face_normal[2] > 0 else -one
        across, axis = (sign, zero, zero), (zero, zero, sign)
    return across, _cross(axis, across)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _multiply(  # type: ignore[no-untyped-def]
    rings, by_light, open_sky, mean, mean_open, texels, scale, turn, pixel_angle, surface, hits, directions,
    vertex, weight, towards, rows, emission, eye, start, stop, out,
):  # fmt: skip
    """Multiply what rays rows[start:stop] see. out: (rays, 3)"""
    levels, cluster, weights = texels
    positions, uvs, faces, face_normal, normals, uv_scale = surface
    face, uv, distance = hits
    view, of_view = np.empty(4, np.int32), np.empty(4, np.float32)
    light, of_light = np.empty(4, np.int32), np.empty(4, np.float32)
    found, sums = np.empty(8, np.int32), np.empty((8, by_light.shape[3] // 3), np.float32)
    summed = np.empty(by_light.shape[3], np.float32)
    of_texel, of_mean = np.empty(3, np.float32), np.empty(3, np.float32)
    corner_uvs = np.empty((3, 2), np.float32)
    for index in range(start, stop):
        ray = rows[index]
        f = face[ray]
        d = _row(directions, ray)
        nx = ny = nz = lx = ly = lz = np.float32(0)
        for q in range(3):
            w, v = weight[ray, q], vertex[ray, q]
            nx, ny, nz = nx + w * normals[v, 0], ny + w * normals[v, 1], nz + w * normals[v, 2]
            lx, ly, lz = lx + w * towards[v, 0], ly + w * towards[v, 1], lz + w * towards[v, 2]
        n = unit((nx, ny, nz))
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for q in range(2):
            corner_uvs[0, q], corner_uvs[1, q], corner_uvs[2, q] = uvs[a, q], uvs[b, q], uvs[c, q]
        x, y, has_place = _frame(_row(positions, a), _row(positions, b), _row(positions, c), corner_uvs, n)
        outward = _row(face_normal, f)
        along = _dot(outward, d)
        if has_place:
            w0, w1, w2 = np.float32(1) - uv[ray, 0] - uv[ray, 1], uv[ray, 0], uv[ray, 1]
            u = w0 * uvs[a, 0] + w1 * uvs[b, 0] + w2 * uvs[c, 0]
            up = -(w0 * uvs[a, 1] + w1 * uvs[b, 1] + w2 * uvs[c, 1])
            metre = uv_scale[f]
        else:
            away = np.float32(-1) if along > 0 else np.float32(1)
            x, y = _projected((away * outward[0], away * outward[1], away * outward[2]))
            place = eye[0] + distance[ray] * d[0], eye[1] + distance[ray] * d[1], eye[2] + distance[ray] * d[2]
            u, up, metre = _dot(place, x), _dot(place, y), np.float32(1)
        side = distance[ray] * pixel_angle * metre / math.sqrt(max(abs(along), np.float32(0.05)))
        x, y = (
            (turn[0] * x[0] + turn[1] * y[0], turn[0] * x[1] + turn[1] * y[1], turn[0] * x[2] + turn[1] * y[2]),
            (turn[0] * y[0] - turn[1] * x[0], turn[0] * y[1] - turn[1] * x[1], turn[0] * y[2] - turn[1] * x[2]),
        )
        u, up = turn[0] * u + turn[1] * up, turn[0] * up - turn[1] * u
        num = gather_texels(levels, cluster, weights, scale * u, -scale * up, scale * side, found, sums)
        taps(rings, -_dot(d, x), -_dot(d, y), -_dot(d, n), view, of_view)
        to_light = unit((lx, ly, lz))
        high = max(_dot(to_light, n), np.float32(0))
        left = taps(rings, _dot(to_light, x), _dot(to_light, y), high, light, of_light)
        leaning = math.sqrt(max(np.float32(1) - high * high, np.float32(0)))
        of_texel[:] = 0
        of_mean[:] = 0
        for tap in range(4):
            even, one = of_view[tap] * (np.float32(1) - leaning), of_view[tap] * leaning * left
            at = view[tap]
            for channel in range(3):
                of_mean[channel] += even * mean_open[at, channel]
                for q in range(4):
                    of_mean[channel] += one * of_light[q] * mean[at, light[q], channel]
            for slot in range(num):
                k = found[slot]
                for j in range(summed.shape[0]):
                    summed[j] = even * open_sky[k, at, j]
                for q in range(4):
                    share = one * of_light[q]
                    for j in range(summed.shape[0]):
                        summed[j] += share * by_light[k, at, light[q], j]
                for j in range(sums.shape[1]):
                    for channel in range(3):
                        of_texel[channel] += sums[slot, j] * summed[3 * j + channel]
        for channel in range(3):
            ratio = min(max(of_texel[channel], np.float32(0)) / max(of_mean[channel], _LEAST), _MOST)
            out[ray, channel] = emission[channel] + ratio * (out[ray, channel] - emission[channel])


def show_texels(
    covers: Mapping[int, Cover],
    surface: Surface,
    positions: F32,
    seen: Seen,
    eye: F32,
    pixel_angle: float,
    towards_light: F32,
    emission: F32,
    out: F32,
) -> None:
    """Turn what rays see of the mean of texels into what each texel shows.

    Args:
        covers: of materials. surface: that is seen. positions: of its corners, metres. (corners, 3) float32
        seen: by the rays. eye: where it is. (3,) float32. pixel_angle: angle that a pixel spans, radians.
        towards_light: of vertices, from `relume.moving.bumps`. (vertices, 3) float32
        emission: radiance of each material's own. (materials, 3) float32
        out: radiance along the rays, written. (rays, 3) float32
    """
    face = seen.hits.face
    material = np.where(face >= 0, surface.face_material[np.maximum(face, 0)], -1)
    of_surface = (
        positions, surface.uvs, surface.faces, surface.face_normal, surface.vertices.normal, surface.uv_scale,
    )  # fmt: skip
    hits = (face, seen.hits.uv, seen.hits.distance)
    for index, cover in covers.items():
        (texels, tables), rows = cover, np.flatnonzero(material == index)
        turn = np.array([math.cos(texels.rotation), math.sin(texels.rotation)], np.float32)
        of_texels = (texels.btf.levels, texels.btf.cluster, tables.weights)
        args: tuple[Any, ...] = (
            texels.btf.rings, tables.by_light, tables.open_sky, tables.mean, tables.mean_open, of_texels,
            np.float32(texels.scale), turn, np.float32(pixel_angle), of_surface, hits, seen.directions,
            seen.vertex, seen.weight, towards_light, rows, emission[index], eye,
        )  # fmt: skip
        for_shares(lambda start, stop, args=args: _multiply(*args, start, stop, out), len(rows))  # type: ignore[misc, call-arg]
