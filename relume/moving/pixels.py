"""From points to pixels: what is sent is interpolated; textures, slopes and mirrored light are found for each pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.color import LUMINANCE
from relume.moving.basis.lobes import NUM_GROUPS, Lobes
from relume.moving.bumps import leaning, shading_ratio, unit
from relume.moving.highlights.looking import SkyLight, add_sky_in_lobe, along_both, along_lobe
from relume.moving.look_up import Seen
from relume.moving.points.surface import EMISSION, NORMAL_MAP, Surface
from relume.moving.points.texels import sample_texture
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_LEAST_SLANT = np.float32(0.05)  # cosine, below which footprints grow no more
_SHARES = 4  # for each thread: a ray that sees a highlight costs five times as much as others
_MOST_TAKEN = np.float32(0.5)  # by points, of what a pixel's lobe shows: more is an error of theirs, a black patch
_MOST_TURNED = np.float32(0.125)  # of what a pixel shows, that turning its lobe may take or add
_RED, _GREEN, _BLUE = (np.float32(share) for share in LUMINANCE)
_ALL_ABOVE = np.float32(10)  # widths of a lobe, from which on all of it is above: a share of 4e-8 is missing


class Mirrored(NamedTuple):
    """What lobes send.

    Attributes:
        lobes: of all materials. sky: that they show where points see it.
        glances: of vertices along their lobes, from `relume.moving.highlights.glances`. (vertices, 3) float32
        turning: of vertices, from `relume.moving.highlights.turning`. (vertices, 4) float32
        is_fine: two lobes stand for each highlight, as at points, not for those alone that ask for it.
    """

    lobes: Lobes
    sky: SkyLight
    glances: F32
    turning: F32
    is_fine: bool


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def blend(values, vertex, weight):  # type: ignore[no-untyped-def]
    """Interpolate vectors between the three vertices about a pixel.

    Args:
        values: of all vertices. (vertices, 3). vertex: the three, a tuple. weight: of each, a tuple.
    """
    x = y = z = np.float32(0)
    for k in range(3):
        v, w = vertex[k], weight[k]
        x, y, z = x + w * values[v, 0], y + w * values[v, 1], z + w * values[v, 2]
    return x, y, z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _beyond(x):  # type: ignore[no-untyped-def]
    """Approximate b, with 1 / (1 + b) the share of a normal distribution above −x."""
    if x > _ALL_ABOVE:
        return np.float32(0)
    return math.exp(np.float32(-1.702) * max(x, np.float32(-20)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _mirror(mirrored, vertex, weight, direction, outward, lobe, n, light):  # type: ignore[no-untyped-def]
    """Find what the lobe of a pixel sees.

    Args:
        mirrored, vertex, weight, direction, lobe: see `combine`; of the pixel.
        outward: of its face, where it is not the way that `n`, its normal, leans.
        light: written, radiance. (3,)
    Returns:
        A row of the lobe's table and the share of the next, for its albedo.
    """
    seen = blend(mirrored.glances, vertex, weight)
    row, share, ray, sigma = along_lobe(mirrored.lobes, lobe, n, direction)
    along = direction[0] * outward[0] + direction[1] * outward[1] + direction[2] * outward[2]
    away = (ray[0] * outward[0] + ray[1] * outward[1] + ray[2] * outward[2]) * (
        np.float32(-1) if along > 0 else np.float32(1)
    )
    # points know what hides the sky from a lobe about their own normal; one that leans may look into its own surface
    per = np.float32(1) / sigma
    hidden, facing = _beyond(per * away), _beyond(per * abs(along))
    above = min((np.float32(1) + facing) / (np.float32(1) + hidden), np.float32(1))
    light[0] = light[1] = light[2] = 0
    one, other, first, sigma_2 = ray, ray, np.float32(1), sigma
    if mirrored.is_fine or mirrored.lobes.is_two[lobe]:
        row, share, one, other, first, sigma, sigma_2 = along_both(mirrored.lobes, lobe, n, direction)
    for k in range(2):
        part = first if k == 0 else np.float32(1) - first
        if part > 0:
            towards, width = (one, sigma) if k == 0 else (other, sigma_2)
            add_sky_in_lobe(mirrored.sky, seen, towards, width, above * part, light)
    for channel in range(3):
        light[channel] *= mirrored.sky.gain[channel]
    return row, share


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _albedo(lobes, lobe, row, share, group):  # type: ignore[no-untyped-def]
    """The albedo of a lobe in a group of terms, three numbers; row, share: see `_mirror`."""
    near, far = lobes.albedo[lobe, row, group], lobes.albedo[lobe, row + 1, group]
    return (
        near[0] + share * (far[0] - near[0]),
        near[1] + share * (far[1] - near[1]),
        near[2] + share * (far[2] - near[2]),
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _turned(turning, vertex, weight, direction, n):  # type: ignore[no-untyped-def]
    """Find how much more other light a lobe sees than is interpolated: luminance, for an albedo of one.

    Args:
        turning: of all vertices. (vertices, 4). vertex, weight, direction: of the pixel, see `combine`.
        n: its normal, before a normal map bends it, which points know nothing of.
    """
    x, y, z = blend(turning, vertex, weight)
    of_points = np.float32(0)
    for k in range(3):
        of_points += weight[k] * turning[vertex[k], 3]
    twice = np.float32(2) * (direction[0] * n[0] + direction[1] * n[1] + direction[2] * n[2])
    rx, ry, rz = direction[0] - twice * n[0], direction[1] - twice * n[1], direction[2] - twice * n[2]
    return np.float32(0.5) * (x * rx + y * ry + z * rz - of_points)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def in_texture(uvs, corners, uv):  # type: ignore[no-untyped-def]
    """Find the place in textures of a place in a triangle.

    Args:
        uvs: of all corners. (corners, 2). corners: the triangle's three, a tuple. uv: the place in it, of two of them.
    """
    a, b, c = corners
    w0, w1, w2 = np.float32(1) - uv[0] - uv[1], uv[0], uv[1]
    return w0 * uvs[a, 0] + w1 * uvs[b, 0] + w2 * uvs[c, 0], w0 * uvs[a, 1] + w1 * uvs[b, 1] + w2 * uvs[c, 1]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def footprint_of(distance, pixel_angle, metre, along):  # type: ignore[no-untyped-def]
    """Find the side of what a pixel sees of a texture.

    Args:
        distance: from the eye, metres. pixel_angle: that a pixel spans, radians.
        metre: side in the texture of a metre of the surface. along: cosine of the slant, of either sign.
    """
    return distance * pixel_angle * metre / math.sqrt(max(abs(along), _LEAST_SLANT))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _lean(textures, texture, place, footprint, tangents, corners, uv, n, outward, is_behind, scratch):  # type: ignore[no-untyped-def]
    """Look up where the normal n of a pixel leans. outward: of the face. is_behind: its other side is seen."""
    a, b, c = corners
    w0, w1, w2 = np.float32(1) - uv[0] - uv[1], uv[0], uv[1]
    side = np.float32(-1) if is_behind else np.float32(1)
    t = (
        w0 * tangents[a, 0] + w1 * tangents[b, 0] + w2 * tangents[c, 0],
        w0 * tangents[a, 1] + w1 * tangents[b, 1] + w2 * tangents[c, 1],
        w0 * tangents[a, 2] + w1 * tangents[b, 2] + w2 * tangents[c, 2],
    )
    out = side * outward[0], side * outward[1], side * outward[2]
    return leaning(textures, texture, place, footprint, n, t, tangents[a, 3], out, scratch)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _combine(  # type: ignore[no-untyped-def]
    surface, pixel_angle, hits, directions, vertex, weight, sent, sends, towards_light, emission, mirrored, rows,
    start, stop, out,
):  # fmt: skip
    """Sum what vertices and lobes send along the rays that are [start, stop) of rows, and what surfaces emit."""
    textures, uvs, tangents, faces, uv_faces, face_material, face_normal, uv_scale, normals = surface
    face, uv, distance = hits
    lobes = mirrored.lobes
    texture_value, light, shown = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    for r in range(start, stop):
        p = rows[r]
        f = face[p]
        if f < 0:
            out[p, 0] = out[p, 1] = out[p, 2] = 0
            continue
        material = face_material[f]
        # tuples, and helpers that are inlined: arrays handed over would be counted as references, several times a ray
        outward = face_normal[f, 0], face_normal[f, 1], face_normal[f, 2]
        corners = faces[f, 0], faces[f, 1], faces[f, 2]
        about, shares = (vertex[p, 0], vertex[p, 1], vertex[p, 2]), (weight[p, 0], weight[p, 1], weight[p, 2])
        at = uv[p, 0], uv[p, 1]
        lobe, row, share, ratio = lobes.of[material], 0, np.float32(0), np.float32(1)
        d = directions[p, 0], directions[p, 1], directions[p, 2]
        along = outward[0] * d[0] + outward[1] * d[1] + outward[2] * d[2]
        footprint = footprint_of(distance[p], pixel_angle, uv_scale[f], along)
        place = in_texture(uvs, (uv_faces[f, 0], uv_faces[f, 1], uv_faces[f, 2]), at)
        is_mapped = textures.of_material[material, NORMAL_MAP] >= 0
        n, more = d, np.float32(0)
        if is_mapped or lobe >= 0:
            n = unit(blend(normals, about, shares))
        if lobe >= 0:
            more = _turned(mirrored.turning, about, shares, d, n)
        if is_mapped:
            leant = _lean(
                textures, textures.of_material[material, NORMAL_MAP], place, footprint, tangents, corners, at,
                n, outward, along > 0, texture_value,
            )  # fmt: skip
            ratio = shading_ratio(blend(towards_light, about, shares), n, leant)
            n = leant
        if lobe >= 0:
            row, share = _mirror(mirrored, about, shares, d, outward, lobe, n, light)
        # by element: assigning a slice is a call
        texture_value[0] = texture_value[1] = texture_value[2] = 1
        if textures.of_material[material, EMISSION] >= 0:
            image = textures.of_material[material, EMISSION]
            sample_texture(textures, image, place[0], place[1], footprint, texture_value)
        for channel in range(3):
            out[p, channel] = emission[material, channel] * texture_value[channel]
        for group in range(NUM_GROUPS):
            if not sends[material, group]:
                continue
            texture_value[0] = texture_value[1] = texture_value[2] = 1
            texture = textures.of_material[material, group - 1] if group else -1
            if texture >= 0:
                sample_texture(textures, texture, place[0], place[1], footprint, texture_value)
            albedo = np.float32(0), np.float32(0), np.float32(0)
            if lobe >= 0:
                albedo = _albedo(lobes, lobe, row, share, group)
            for channel in range(3):
                total = np.float32(0)
                for k in range(3):
                    total += shares[k] * sent[about[k], group, channel]
                total *= ratio
                if lobe >= 0:
                    of_lobe = albedo[channel] * light[channel]
                    total = max(total, -_MOST_TAKEN * of_lobe) + of_lobe
                shown[channel] = max(total, np.float32(0))
            gain = np.float32(1)
            if more != 0:
                whole = _RED * shown[0] + _GREEN * shown[1] + _BLUE * shown[2]
                part = more * (_RED * albedo[0] + _GREEN * albedo[1] + _BLUE * albedo[2])
                part = min(max(part, -_MOST_TURNED * whole), _MOST_TURNED * whole)
                gain += part / max(whole, np.float32(1e-20))
            for channel in range(3):
                out[p, channel] += texture_value[channel] * gain * shown[channel]


class FromVertices(NamedTuple):
    """What vertices send to an eye, and what leaning pixels about them make of it.

    Attributes:
        broad: radiance, untextured, then by each of `TEXTURES`. (vertices, groups, 3) float32
        sends: whether a material sends anything of a group at all, by lobes too. (materials, groups) bool
        towards_light: from `relume.moving.bumps`; empty where no material has a normal map. (vertices, 3) float32
    """

    broad: F32
    sends: NDArray[np.bool_]
    towards_light: F32


def combine(
    surface: Surface,
    seen: Seen,
    pixel_angle: float,
    sent: FromVertices,
    emission: F32,
    mirrored: Mirrored,
    rows: NDArray[np.int32] | None = None,
    out: F32 | None = None,
) -> F32:
    """Find the radiance along rays that see a surface; the others are black.

    Args:
        surface: that is seen. seen: what rays see of it.
        pixel_angle: angle that a pixel spans, radians.
        sent: by every vertex. mirrored: what lobes send besides.
        emission: radiance of each material's own, the mean over its surfaces. (materials, 3) float32
        rows: rays that are asked; None: all. (n,) int32. out: written there; None: new.
    Returns:
        (rays, 3) float32
    """
    found = np.empty((len(seen.directions), 3), np.float32) if out is None else out
    asked = np.arange(len(found), dtype=np.int32) if rows is None else rows
    hits = (seen.hits.face, seen.hits.uv, seen.hits.distance)
    of_surface = (
        surface.textures, surface.uvs, surface.tangents, surface.faces, surface.uv_faces, surface.face_material,
        surface.face_normal, surface.uv_scale, surface.vertices.normal,
    )  # fmt: skip
    args = (
        of_surface, np.float32(pixel_angle), hits, seen.directions, seen.vertex, seen.weight,
        *sent, emission, mirrored, asked,
    )  # fmt: skip
    for_shares(lambda start, stop: _combine(*args, start, stop, found), len(asked), _SHARES)
    return found
