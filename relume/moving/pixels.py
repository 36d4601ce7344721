"""From points to pixels: what is sent is interpolated, textures and mirrored light are found for each pixel."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import NUM_GROUPS, Lobes
from relume.moving.glints import LEAST_COSINE, row_of
from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.moving.points.texels import sample_texture
from relume.moving.sky import Sky, sky_about
from relume.parallel import for_shares

F32 = NDArray[np.float32]

_LEAST_SLANT = np.float32(0.05)  # cosine, below which footprints grow no more


class Mirrored(NamedTuple):
    """What lobes send.

    Attributes:
        lobes: of all materials. sky: that they show where points see it. turn: of it, from `turn_of`.
        gain: of its light, in each channel. (3,) float32
        glances: of vertices along their lobes, from `relume.moving.glints`. (vertices, 4) float32
    """

    lobes: Lobes
    sky: Sky
    turn: np.float32
    gain: F32
    glances: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _mirror(mirrored, normals, vertex, weight, directions, p, lobe, light):  # type: ignore[no-untyped-def]
    """Find what the lobe of pixel p sees. light: written, radiance. (3,)

    Returns:
        A row of the lobe's table and the share of the next, for its albedo.
    """
    lobes = mirrored.lobes
    nx = ny = nz = open_sky = np.float32(0)
    for k in range(3):
        v, w = vertex[p, k], weight[p, k]
        nx, ny, nz = nx + w * normals[v, 0], ny + w * normals[v, 1], nz + w * normals[v, 2]
        open_sky += w * mirrored.glances[v, 0]
    scale = np.float32(1) / math.sqrt(max(nx * nx + ny * ny + nz * nz, np.float32(1e-20)))
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    dx, dy, dz = directions[p, 0], directions[p, 1], directions[p, 2]
    facing = -(nx * dx + ny * dy + nz * dz)
    cosine: Any = min(max(facing, LEAST_COSINE), np.float32(1))
    row, share = row_of(cosine)
    mean = lobes.mean[lobe, row] + share * (lobes.mean[lobe, row + 1] - lobes.mean[lobe, row])
    sigma = lobes.sigma[lobe, row] + share * (lobes.sigma[lobe, row + 1] - lobes.sigma[lobe, row])
    ax, ay, az = dx + facing * nx, dy + facing * ny, dz + facing * nz
    length = math.sqrt(max(ax * ax + ay * ay + az * az, np.float32(1e-20)))
    flat = math.sqrt(max(np.float32(1) - mean * mean, np.float32(0))) / length
    sky_about(
        mirrored.sky, mirrored.turn, flat * ax + mean * nx, flat * ay + mean * ny, flat * az + mean * nz, sigma, light
    )
    for channel in range(3):
        light[channel] *= open_sky * mirrored.gain[channel]
        for k in range(3):
            light[channel] += weight[p, k] * mirrored.glances[vertex[p, k], 1 + channel]
    return row, share


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _combine(  # type: ignore[no-untyped-def]
    surface, pixel_angle, hits, directions, vertex, weight, sent, emission, mirrored, start, stop, out
):
    """Sum what vertices and lobes send along the rays of pixels [start, stop), and what surfaces emit."""
    textures, uvs, faces, face_material, face_normal, uv_scale, normals = surface
    face, uv, distance = hits
    lobes = mirrored.lobes
    texture_value, light = np.empty(3, np.float32), np.empty(3, np.float32)
    for p in range(start, stop):
        f = face[p]
        if f < 0:
            continue
        material = face_material[f]
        lobe, row, share = lobes.of[material], 0, np.float32(0)
        if lobe >= 0:
            row, share = _mirror(mirrored, normals, vertex, weight, directions, p, lobe, light)
        for channel in range(3):
            out[p, channel] = emission[material, channel]
        for group in range(NUM_GROUPS):
            texture_value[:] = 1
            texture = textures.of_material[material, group - 1] if group else -1
            if texture >= 0:
                a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
                w0, w1, w2 = np.float32(1) - uv[p, 0] - uv[p, 1], uv[p, 0], uv[p, 1]
                u = w0 * uvs[a, 0] + w1 * uvs[b, 0] + w2 * uvs[c, 0]
                v = w0 * uvs[a, 1] + w1 * uvs[b, 1] + w2 * uvs[c, 1]
                cosine = abs(
                    face_normal[f, 0] * directions[p, 0]
                    + face_normal[f, 1] * directions[p, 1]
                    + face_normal[f, 2] * directions[p, 2]
                )
                footprint = distance[p] * pixel_angle * uv_scale[f] / math.sqrt(max(cosine, _LEAST_SLANT))
                sample_texture(textures, texture, u, v, footprint, texture_value)
            for channel in range(3):
                total = np.float32(0)
                for k in range(3):
                    total += weight[p, k] * sent[vertex[p, k], group, channel]
                total = max(total, np.float32(0))
                if lobe >= 0:
                    near = lobes.albedo[lobe, row, group, channel]
                    albedo = near + share * (lobes.albedo[lobe, row + 1, group, channel] - near)
                    total += albedo * light[channel]
                out[p, channel] += texture_value[channel] * total


def combine(
    surface: Surface,
    seen: Seen,
    pixel_angle: float,
    sent: F32,
    emission: F32,
    mirrored: Mirrored,
) -> F32:
    """Find the radiance of every pixel that sees a surface; the others are black.

    Args:
        surface: that is seen. seen: what pixels see of it.
        pixel_angle: angle that a pixel spans, radians.
        sent: radiance of every vertex to the eye: untextured, then by each of `TEXTURES`. (vertices, groups, 3) float32
        emission: radiance of each material's own. (materials, 3) float32
        mirrored: what lobes send besides.
    Returns:
        (pixels, 3) float32
    """
    out = np.zeros((len(seen.directions), 3), np.float32)
    hits = (seen.hits.face, seen.hits.uv, seen.hits.distance)
    of_surface = (
        surface.textures, surface.uvs, surface.faces, surface.face_material, surface.face_normal, surface.uv_scale,
        surface.vertices.normal,
    )  # fmt: skip
    args = (
        of_surface, np.float32(pixel_angle), hits, seen.directions, seen.vertex, seen.weight, sent,
        emission, mirrored,
    )  # fmt: skip
    for_shares(lambda start, stop: _combine(*args, start, stop, out), len(out))
    return out
