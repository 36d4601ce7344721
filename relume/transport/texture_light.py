"""Incident light in the direction basis of a BTF: everything that its texels need from the light.

    a_l = Σ_s w_s hat_l(ω_s)

A BTF is interpolated linearly between the directions l (`relume.assets.btf.direction_rings`), so that sums over light
are exact. The weights w have no cosine: the BTF's values include it. a depends neither on the texel nor on the
tiling of the texture.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid, interpolation_weights
from relume.brdf.terms.btf import BtfRef
from relume.lights.spherical_triangles import TriangleLights
from relume.transport.shading_points import RayList, ShadingPoints, build_ray_lists

F32 = NDArray[np.float32]

_MIN_COSINE = np.float32(1e-3)  # of rays, to remove the cosine from their weights


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def to_texture_frame(x, y, axis):  # type: ignore[no-untyped-def]
    """Rotate a direction from a shading frame into the texture's, with x axis axis[:2] and y axis axis[2:]."""
    return axis[0] * x + axis[1] * y, axis[2] * x + axis[3] * y


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_triangles(grid, normal, tangent, axes, visible, direction, irradiance, out):  # type: ignore[no-untyped-def]
    """Add the visible light triangles of n points. out: (n, 3, L)"""
    index, weight = np.empty(4, np.int32), np.empty(4, np.float32)
    for p in range(out.shape[0]):
        n, t = normal[p], tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        for m in range(direction.shape[0]):
            if not (visible[p, m >> 3] >> (m & 7)) & 1:
                continue
            x, y, z = direction[m, 0], direction[m, 1], direction[m, 2]
            up = n[0] * x + n[1] * y + n[2] * z
            if up <= 0:
                continue
            lx, ly = to_texture_frame(t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z, axes[p])
            scale = interpolation_weights(grid, lx, ly, up, index, weight)
            for k in range(4):
                for channel in range(3):
                    out[p, channel, index[k]] += scale * weight[k] * irradiance[m, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _from_listed(grid, axes, first, wi, irradiance, out):  # type: ignore[no-untyped-def]
    """Add listed rays, weighted by the cosine, to their points. out: (n, 3, L)"""
    index, weight = np.empty(4, np.int32), np.empty(4, np.float32)
    for p in range(out.shape[0]):
        for ray in range(first[p], first[p + 1]):
            up = wi[2, ray]
            lx, ly = to_texture_frame(wi[0, ray], wi[1, ray], axes[p])
            scale = interpolation_weights(grid, lx, ly, up, index, weight) / max(up, _MIN_COSINE)
            for k in range(4):
                for channel in range(3):
                    out[p, channel, index[k]] += scale * weight[k] * irradiance[channel, ray]


def texture_axes(rotation: float, uv: Shaped[F32, "n uv"]) -> Shaped[F32, "n 4"]:
    """Return the axes of a texture in the shading frames of points, for `to_texture_frame`.

    Args:
        rotation: rotation of the texture, radians. uv: UV coordinates of the points, see `ShadingPoints`.
    """
    cosine, sine = math.cos(rotation), math.sin(rotation)
    x = np.stack([np.cos(uv[:, 3]), np.sin(uv[:, 3])], axis=1)
    y = uv[:, 4:5] * np.stack([-x[:, 1], x[:, 0]], axis=1)
    axes = np.concatenate([cosine * x + sine * y, cosine * y - sine * x], axis=1)
    return np.asarray(axes, np.float32)


def texture_light_rows(
    btf_ref: BtfRef, lights: TriangleLights | None, receivers: ShadingPoints, start: int, stop: int
) -> Shaped[F32, "m 3 L"]:
    """Project light onto the direction basis of a BTF in its texture frame.

    Args:
        btf_ref: the BTF and its mapping. lights: lights of the environment, None for rays alone.
        receivers: all points, with `uv`. start, stop: range of points.
    Returns:
        a of each point, channel and direction; without the cosine.
    """
    assert receivers.uv is not None
    rows, grid = slice(start, stop), btf_ref.btf.grid
    axes = texture_axes(btf_ref.rotation, receivers.uv[rows])
    incident = np.zeros((stop - start, 3, grid.num_directions), np.float32)
    if lights is not None and lights.num_lights and receivers.visible.shape[1]:
        n, t = (np.ascontiguousarray(a[rows], np.float32) for a in (receivers.normal, receivers.tangent))
        visible = np.ascontiguousarray(receivers.visible[rows])
        _from_triangles(grid, n, t, axes, visible, lights.direction, lights.irradiance, incident)
    for rays in receivers.rays:
        _add_rays(grid, rays, receivers, axes, start, stop, incident)
    return incident


def _add_rays(
    grid: DirectionGrid, rays: RayList, receivers: ShadingPoints, axes: F32, start: int, stop: int, out: F32
) -> None:
    ray_list = build_ray_lists(rays, receivers, start, stop)
    _from_listed(grid, axes, ray_list.first, ray_list.wi, ray_list.irradiance, out)


def rotated_tables(grid: DirectionGrid, tables: Shaped[F32, "*batch L"], angle: float) -> Shaped[F32, "*batch L"]:
    """Resample tables for a texture that is rotated relative to the binned light.

    On each ring a direction takes the mean of the two directions at its rotated position, which blurs light by up to
    one step of the ring.

    Args:
        grid: grid of the BTF. tables: see `LocalPcaBtf.tables`. angle: angle of the additional rotation, radians.
    """
    rotation = np.zeros((grid.num_directions, grid.num_directions), np.float32)
    for first, stop in zip(grid.first[:-1], grid.first[1:], strict=True):
        count = stop - first
        steps = angle / (2 * math.pi) * count
        low, azimuths = math.floor(steps), np.arange(count)
        rotation[first + azimuths, first + (azimuths + low) % count] += low + 1 - steps
        rotation[first + azimuths, first + (azimuths + low + 1) % count] += steps - low
    return np.asarray(tables @ rotation)
