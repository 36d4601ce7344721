"""Adaptive hard shadows: the visible fraction of a light per ray, from few shadow rays.

Every second pixel in every second row traces one target of the light, adjacent pixels different ones. If all traced
neighbors of a pixel on its surface agree, the pixel takes their value. Other pixels trace all targets, from points
distributed over the pixel's footprint, so that shadow edges are antialiased and penumbras correct. Where such a pixel
contradicts the prediction next to it, its neighbors are traced too, in a few rounds. In wide penumbras each pixel takes
the mean of nine pixels, whose targets together are `NUM_TARGET_SETS` times as many.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.lights.sun_disks import NUM_TARGETS
from relume.live.free_camera.hard_shadow_lights import ShadowTargets
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.live.free_camera.shadow_kernels import (
    ShadowRays,
    needs_refinement,
    needs_refinement_at_edges,
    predict,
    smooth_visibility,
    trace_all_targets,
    trace_single_target,
)
from relume.raytrace.embree import PacketTracer
from relume.scene.model import Camera

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
_TraceArguments = tuple[PacketTracer, ShadowRays, ShadowTargets]  # first arguments of tracing kernels

_MAX_ROUNDS = 32  # each follows a shadow edge by two more pixels


def visible_fractions(
    solid: OcclusionMesh, gbuffer: GBuffer, camera: Camera, size: tuple[int, int], targets: ShadowTargets
) -> Shaped[F32, " rays"]:
    """Return the visible fraction of a light at each ray's hit, float32.

    Args:
        solid: the scene. gbuffer: G-buffer of the rays. camera: camera of the rays.
        size: width and height of the image, pixels. targets: targets of shadow rays.
    """
    width, height = size
    num_pixels, num_visible = width * height, np.zeros(len(gbuffer.hits.face), np.uint8)
    tracer, rays = solid.embree.shadow_tracer(coherent=True), _shadow_rays(solid, gbuffer, camera, height)
    trace_arguments = tracer, rays, targets
    _trace_pixels(trace_arguments, gbuffer, size, num_visible)
    _trace_edge_rays(trace_arguments, gbuffer, num_pixels, width, num_visible)
    out = np.divide(num_visible, NUM_TARGETS, dtype=np.float32)
    parallel_for_chunks(lambda a, b: smooth_visibility(rays, width, height, num_visible, a, b, out), num_pixels)
    return out


def _shadow_rays(solid: OcclusionMesh, gbuffer: GBuffer, camera: Camera, height: int) -> ShadowRays:
    pixel = 2 * math.tan(camera.yfov / 2) / height
    right, up = (np.ascontiguousarray(camera.to_world[:3, k] * pixel, np.float32) for k in (0, 1))
    return ShadowRays(solid.origins, solid.stored_scene.face_material, gbuffer.hits, gbuffer.directions, right, up)


def _trace_pixels(trace_arguments: _TraceArguments, gbuffer: GBuffer, size: tuple[int, int], num_visible: U8) -> None:
    """Trace every fourth pixel, and all uncertain ones. num_visible: visible targets, written for pixels. (rays,)"""
    (width, height), rays, face = size, trace_arguments[1], gbuffer.hits.face
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
    """Trace the extra rays of edge pixels; all targets if the rays of a pixel disagree."""
    rays, face = trace_arguments[1], gbuffer.hits.face
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
