"""Which share of a beam each ray's surface sees, with few shadow rays: every fourth pixel is asked, others predicted.

Every second pixel of every second row asks for one of its targets, neighbours for different ones. Where all that are
asked about a pixel, on its surface, say the same, so does it. Others ask for all targets, from places spread over
what the pixel covers: so edges of shadows are smooth, and as wide as the light is. Where one of those finds else than
what was predicted beside it, its neighbours ask too, in a few rounds. Where a whole neighbourhood is partly in
shadow, each pixel takes the mean of nine, whose targets together are `NUM_TARGET_SETS` times as many.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.lights.sun_disks import NUM_TARGETS
from relume.live.free_camera.hard_shadows.lights import ShadowTargets
from relume.live.free_camera.hard_shadows.shadow_kernels import (
    ShadowRays,
    needs_refinement,
    needs_refinement_at_edges,
    predict,
    smooth_visibility,
    trace_all_targets,
    trace_single_target,
)
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.raytrace.embree import occluded, packet_arguments
from relume.scene.model import Camera

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
_TraceArguments = tuple[Any, int, int, ShadowRays, ShadowTargets]  # what kernels that trace are called with first

_MAX_ROUNDS = 32  # a shadow is followed that many times two pixels beyond where it was seen first


def visible_fractions(
    solid: OcclusionMesh, gbuffer: GBuffer, camera: Camera, size: tuple[int, int], targets: ShadowTargets
) -> F32:
    """Find the share of a beam that is seen where each ray of an eye ends.

    Args:
        solid: what is seen, and may be in the way. gbuffer: by the rays. camera: the eye.
        size: width and height of its picture, pixels. targets: what shadow rays are sent to.
    Returns:
        (rays,) float32
    """
    width, height = size
    num_pixels, num_visible = width * height, np.zeros(len(gbuffer.hits.face), np.uint8)
    arguments = packet_arguments(coherent=True)
    trace_arguments = (
        occluded,
        solid.embree.handle,
        arguments.ctypes.data,
        _shadow_rays(solid, gbuffer, camera, height),
        targets,
    )
    _trace_pixels(trace_arguments, gbuffer, size, num_visible)
    _trace_edge_rays(trace_arguments, gbuffer, num_pixels, width, num_visible)
    out = np.divide(num_visible, NUM_TARGETS, dtype=np.float32)
    parallel_for_chunks(
        lambda a, b: smooth_visibility(trace_arguments[3], width, height, num_visible, a, b, out), num_pixels
    )
    return out


def _shadow_rays(solid: OcclusionMesh, gbuffer: GBuffer, camera: Camera, height: int) -> ShadowRays:
    stored_scene, hits = solid.stored_scene, gbuffer.hits
    pixel = 2 * math.tan(camera.yfov / 2) / height
    right, up = (np.ascontiguousarray(camera.to_world[:3, k] * pixel, np.float32) for k in (0, 1))
    return ShadowRays(
        solid.positions, solid.edge_offset, stored_scene.faces, stored_scene.face_material, stored_scene.face_normal,
        hits.face, hits.uv, hits.distance, gbuffer.directions, right, up, np.float32(solid.surface_offset),
    )  # fmt: skip


def _trace_pixels(trace_arguments: _TraceArguments, gbuffer: GBuffer, size: tuple[int, int], num_visible: U8) -> None:
    """Ask every fourth pixel, and all that are in doubt. num: targets that rays see, written for pixels. (rays,)"""
    (width, height), rays, face = size, trace_arguments[3], gbuffer.hits.face
    is_uncertain, is_refined, is_edge = (np.zeros(width * height, np.bool_) for _ in range(3))
    is_edge[gbuffer.owner] = True
    sparse_grid = np.arange(height)[::2, None] * width + np.arange(width)[::2]
    sparse_pixels = sparse_grid[face[sparse_grid] >= 0]
    parallel_for_chunks(
        lambda a, b: trace_single_target(*trace_arguments, sparse_pixels, width, a, b, num_visible), len(sparse_pixels)
    )
    parallel_for_chunks(lambda a, b: predict(rays, width, height, a, b, num_visible, is_uncertain), sparse_grid.size)
    for _ in range(_MAX_ROUNDS):
        uncertain_pixels = np.flatnonzero(is_uncertain)
        if not len(uncertain_pixels):
            break
        _trace_rays(trace_arguments, uncertain_pixels, is_edge, width, num_visible)
        is_refined[uncertain_pixels], is_uncertain[uncertain_pixels] = True, False
        _spread_uncertainty(rays, size, uncertain_pixels, is_refined, num_visible, is_uncertain)


def _trace_rays(
    trace_arguments: _TraceArguments,
    ray_indices: NDArray[np.intp],
    is_edge: NDArray[np.bool_],
    width: int,
    num_visible: U8,
) -> None:
    parallel_for_chunks(
        lambda a, b: trace_all_targets(*trace_arguments, ray_indices, is_edge, width, a, b, num_visible),
        len(ray_indices),
    )


def _spread_uncertainty(
    rays: ShadowRays,
    size: tuple[int, int],
    refined_pixels: NDArray[np.intp],
    is_refined: NDArray[np.bool_],
    num_visible: U8,
    is_uncertain: NDArray[np.bool_],
) -> None:
    parallel_for_chunks(
        lambda a, b: needs_refinement(rays, *size, refined_pixels, is_refined, num_visible, a, b, is_uncertain),
        len(refined_pixels),
    )


def _trace_edge_rays(
    trace_arguments: _TraceArguments, gbuffer: GBuffer, num_pixels: int, width: int, num_visible: U8
) -> None:
    """Ask the rays beyond one for each pixel, for all targets where those of one pixel do not agree."""
    rays, face = trace_arguments[3], gbuffer.hits.face
    edge_rays = np.flatnonzero(face[num_pixels:] >= 0) + num_pixels
    parallel_for_chunks(
        lambda a, b: trace_single_target(*trace_arguments, edge_rays, width, a, b, num_visible), len(edge_rays)
    )
    is_uncertain, owner = np.zeros(len(gbuffer.owner), np.bool_), gbuffer.owner
    rays_per_pixel = len(owner) // max(1, len(np.unique(owner)))
    parallel_for_chunks(
        lambda a, b: needs_refinement_at_edges(
            rays, owner, num_pixels, rays_per_pixel, num_visible, a, b, is_uncertain
        ),
        len(owner) // max(1, rays_per_pixel),
    )
    _trace_rays(trace_arguments, np.flatnonzero(is_uncertain) + num_pixels, np.zeros(0, np.bool_), width, num_visible)
