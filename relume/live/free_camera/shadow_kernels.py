"""Kernels of adaptive hard shadows: trace targets, predict pixels, mark uncertain ones, smooth penumbras.

A target is one of `ShadowTargets.towards`. Visibility is counted in targets, from 0 to `NUM_TARGETS`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.lights.sun_disks import NUM_TARGETS
from relume.live.free_camera.antialiasing import is_edge
from relume.raytrace.camera_rays import Hits
from relume.raytrace.ray_origins import OriginMesh, ray_origin
from relume.raytrace.ray_packet import (
    FAR,
    LANES,
    enable_lane,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)

F32 = NDArray[np.float32]

_REFINEMENT_RADIUS = 2  # pixels around a contradiction that are traced
_MIN_SLANT = np.float32(0.05)  # cosine, below which the pixel footprint is limited
_LIFT = np.float32(0.15)  # of the lateral offset; concave tessellated surfaces rise less
# order of targets in adjacent pixels: far apart on the light
_ORDER = np.array([0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15], np.int64)


class ShadowRays(NamedTuple):
    """Hits of camera rays, as arrays for kernels."""

    origins: OriginMesh
    material: NDArray[np.int32]
    hits: Hits
    directions: F32
    right: F32
    up: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _shadow_origin(rays, p, at):  # type: ignore[no-untyped-def]
    """Write the hit point, offset from its surface, and the face normal on its side. at: (2, 3)"""
    f, along = rays.hits.face[p], np.float32(0)
    for axis in range(3):
        along += rays.origins.normal[f, axis] * rays.directions[p, axis]
    side = np.float32(-1) if along > 0 else np.float32(1)
    at[0, 0], at[0, 1], at[0, 2] = ray_origin(rays.origins, f, rays.hits.uv[p, 0], rays.hits.uv[p, 1], side)
    for axis in range(3):
        at[1, axis] = side * rays.origins.normal[f, axis]
    return -abs(along)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _aim_at_target(packet, lane, targets, target_set, target_index, x, y, z, normal):  # type: ignore[no-untyped-def]
    """Aim a lane from a point at a target; returns whether the target lies above the face."""
    dx, dy, dz = (
        targets.towards[target_set, target_index, 0],
        targets.towards[target_set, target_index, 1],
        targets.towards[target_set, target_index, 2],
    )
    if not targets.is_far:
        dx, dy, dz = dx - x, dy - y, dz - z
    is_above = dx * normal[0] + dy * normal[1] + dz * normal[2] > 0
    set_origin(packet, lane, x, y, z)
    set_direction(packet, lane, dx, dy, dz, FAR if targets.is_far else np.float32(1))
    enable_lane(packet, lane, is_above)
    return is_above


@nb.njit(nogil=True, cache=True)
def trace_single_target(tracer, rays, targets, ray_indices, width, start, stop, num_visible):  # type: ignore[no-untyped-def]
    """Trace one target from each of the rays ray_indices[start:stop].

    Args:
        tracer: of shadow rays. rays: of the camera. targets: of the light. ray_indices: the rays. (m,)
        width: of the image, pixels. start, stop: the range. num_visible: written, 0 or `NUM_TARGETS`. (rays,) uint8
    """
    packet, at = new_packet(tracer), np.empty((2, 3), np.float32)
    is_above = np.zeros(LANES, np.bool_)
    for batch_start in range(start, stop, LANES):
        batch_size = min(LANES, stop - batch_start)
        for lane in range(LANES):
            p = ray_indices[batch_start + min(lane, batch_size - 1)]
            x, y = (p % width) >> 1, (p // width) >> 1
            _shadow_origin(rays, p, at)
            target_set, target_index = (x + y) % targets.towards.shape[0], _ORDER[(x + 4 * y) & (NUM_TARGETS - 1)]
            is_above[lane] = _aim_at_target(
                packet, lane, targets, target_set, target_index, at[0, 0], at[0, 1], at[0, 2], at[1]
            )
            enable_lane(packet, lane, is_above[lane] and lane < batch_size)
        trace_shadows(packet)
        for lane in range(batch_size):
            num_visible[ray_indices[batch_start + lane]] = (
                NUM_TARGETS if is_above[lane] and is_unoccluded(packet, lane) else 0
            )


@nb.njit(nogil=True, cache=True)
def trace_all_targets(tracer, rays, targets, ray_indices, is_edge, width, start, stop, num_visible):  # type: ignore[no-untyped-def]
    """Trace all targets of the rays ray_indices[start:stop], from points in their pixel footprints.

    Args:
        tracer, rays, targets, ray_indices, width, start, stop: as in `trace_single_target`.
        is_edge: pixels on an edge. (pixels,) num_visible: written, number of visible targets. (rays,) uint8
    """
    packet, at = new_packet(tracer), np.empty((2, 3), np.float32)
    is_above, step = np.zeros(LANES, np.bool_), np.empty((2, 3), np.float32)
    for index in range(start, stop):
        p = ray_indices[index]
        slant = min(_shadow_origin(rays, p, at), np.float32(-1e-6))
        reach = np.float32(0)
        if p < len(is_edge) and not is_edge[p]:
            reach = np.float32(0.25) * rays.hits.distance[p] * min(-slant / _MIN_SLANT, np.float32(1))
        for side in range(2):  # footprint of the pixel in the plane through its center
            across = rays.right if side == 0 else rays.up
            normal_component = across[0] * at[1, 0] + across[1] * at[1, 1] + across[2] * at[1, 2]
            for axis in range(3):
                step[side, axis] = reach * (across[axis] - rays.directions[p, axis] * normal_component / slant)
        target_set = p % width % 3 + 3 * (p // width % 3)
        num_visible[p] = 0
        for first_target in range(0, NUM_TARGETS, LANES):
            for lane in range(LANES):
                column, row = (first_target + lane) & 3, (first_target + lane) >> 2
                a, b = np.float32(column) - np.float32(1.5), np.float32(row) - np.float32(1.5)
                dx = a * step[0, 0] + b * step[1, 0]
                dy = a * step[0, 1] + b * step[1, 1]
                dz = a * step[0, 2] + b * step[1, 2]
                lift = _LIFT * math.sqrt(dx * dx + dy * dy + dz * dz)
                x, y = at[0, 0] + dx + lift * at[1, 0], at[0, 1] + dy + lift * at[1, 1]
                z, target_index = at[0, 2] + dz + lift * at[1, 2], 4 * ((column + row) & 3) + row
                is_above[lane] = _aim_at_target(packet, lane, targets, target_set, target_index, x, y, z, at[1])
            trace_shadows(packet)
            for lane in range(LANES):
                if is_above[lane] and is_unoccluded(packet, lane):
                    num_visible[p] += 1


@nb.njit(nogil=True, cache=True, inline="always")
def _is_same_surface(rays, p, q):  # type: ignore[no-untyped-def]
    """Return whether two pixels show one surface."""
    return rays.hits.face[q] >= 0 and not is_edge(rays.material, rays.origins.normal, rays.hits, rays.directions, p, q)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def predict(rays, width, height, start, stop, num_visible, is_uncertain):  # type: ignore[no-untyped-def]
    """Predict untraced pixels in blocks of 2 × 2 pixels [start, stop); mark them uncertain if neighbors disagree.

    Args:
        rays: rays of the camera. width, height: width and height of the image, pixels. start, stop: the range.
        num_visible: visible targets, written for untraced pixels. (rays,) uint8. is_uncertain: written. (rays,)
    """
    across, down = (width + 1) // 2, (height + 1) // 2
    for block in range(start, stop):
        block_x, block_y = block % across, block // across
        value, agree = num_visible[2 * (block_y * width + block_x)], True
        for row in range(max(block_y - 1, 0), min(block_y + 2, down)):
            for column in range(max(block_x - 1, 0), min(block_x + 2, across)):
                agree = agree and num_visible[2 * (row * width + column)] == value
        for y in range(2 * block_y, min(2 * block_y + 2, height)):
            for x in range(2 * block_x, min(2 * block_x + 2, width)):
                p = y * width + x
                if agree:
                    num_visible[p] = value
                elif rays.hits.face[p] >= 0:
                    _predict_pixel(rays, width, height, x, y, num_visible, is_uncertain)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _predict_pixel(rays, width, height, x, y, num_visible, is_uncertain):  # type: ignore[no-untyped-def]
    """Predict a pixel from traced neighbors on its surface."""
    p, num_neighbors, agree, value = y * width + x, 0, True, np.uint8(0)
    for row in range(max(y - 2 + y % 2, 0), min(y + 3, height), 2):
        for column in range(max(x - 2 + x % 2, 0), min(x + 3, width), 2):
            q = row * width + column
            if _is_same_surface(rays, p, q):
                agree = agree and (num_neighbors == 0 or num_visible[q] == value)
                value = num_visible[q]
                num_neighbors += 1
    is_uncertain[p] = not agree or num_neighbors < 2
    if num_neighbors > 0 and (x % 2 == 1 or y % 2 == 1):
        num_visible[p] = value


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def needs_refinement(rays, width, height, refined_pixels, is_refined, num_visible, start, stop, is_uncertain):  # type: ignore[no-untyped-def]
    """Mark predicted pixels near refined_pixels[start:stop], on their surface, that differ from them.

    Args:
        rays, width, height, num_visible: as in `predict`. refined_pixels: pixels that traced all targets. (m,)
        is_refined: pixels that did. (pixels,) start, stop: the range. is_uncertain: written. (rays,)
    """
    for k in range(start, stop):
        p = refined_pixels[k]
        x, y = p % width, p // width
        for row in range(max(y - _REFINEMENT_RADIUS, 0), min(y + _REFINEMENT_RADIUS + 1, height)):
            for column in range(max(x - _REFINEMENT_RADIUS, 0), min(x + _REFINEMENT_RADIUS + 1, width)):
                q = row * width + column
                if not is_refined[q] and num_visible[q] != num_visible[p] and _is_same_surface(rays, p, q):
                    is_uncertain[q] = True


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def needs_refinement_at_edges(rays, owner, num_pixels, rays_per_pixel, num_visible, start, stop, is_uncertain):  # type: ignore[no-untyped-def]
    """Mark extra rays of edge pixels owner[rays_per_pixel · (start:stop)] that differ from others on a surface.

    Args:
        rays, num_visible: as in `predict`. owner: pixels of the extra rays, ascending. (k,)
        num_pixels: number of pixels of the image. rays_per_pixel: extra rays per edge pixel.
        start, stop: the range. is_uncertain:
            written. (k,)
    """
    for first in range(start * rays_per_pixel, stop * rays_per_pixel, rays_per_pixel):
        pixel = owner[first]
        for k in range(first, first + rays_per_pixel):
            p = num_pixels + k
            if rays.hits.face[p] < 0:
                continue
            if num_visible[p] != num_visible[pixel]:
                is_uncertain[k] = _is_same_surface(rays, p, pixel)
            for neighbor_ray in range(num_pixels + first, num_pixels + first + rays_per_pixel):
                if num_visible[p] != num_visible[neighbor_ray] and not is_uncertain[k]:
                    is_uncertain[k] = _is_same_surface(rays, p, neighbor_ray)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def smooth_visibility(rays, width, height, num_visible, start, stop, out):  # type: ignore[no-untyped-def]
    """Write visible fractions of pixels [start, stop): the mean of nine if all are in penumbra.

    Args:
        rays, width, height, num_visible: as in `predict`. start, stop: the range. out: written, 0…1. (rays,) float32
    """
    for p in range(start, stop):
        x, y, total = p % width, p // width, np.int64(num_visible[p])
        out[p] = np.float32(total) / np.float32(NUM_TARGETS)
        if total == 0 or total == NUM_TARGETS or x == 0 or y == 0 or x == width - 1 or y == height - 1:
            continue
        is_penumbra = True
        total = np.int64(0)
        for row in range(y - 1, y + 2):
            for column in range(x - 1, x + 2):
                q = row * width + column
                is_penumbra = is_penumbra and 0 < num_visible[q] < NUM_TARGETS and _is_same_surface(rays, p, q)
                total += num_visible[q]
        if is_penumbra:
            out[p] = np.float32(total) / np.float32(9 * NUM_TARGETS)
