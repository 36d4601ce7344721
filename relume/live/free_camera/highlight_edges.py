"""Antialiasing of highlight edges: pixels with a large luminance step get many rays.

Rays through pixel centers hit a thin highlight or miss it, and it is hundreds of times as bright as its surroundings. A
few pixels make most of the error (docs/free-camera.md#highlights). This takes more time than a moving camera allows, so
only fine frames do it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.live.free_camera.frame import Frame, FrameRequestState, finish_rays, render_frame
from relume.live.free_camera.occluded_probes import reweight
from relume.live.free_camera.primary_visibility import GBuffer, trace_through_glass
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_MAX_EDGE_FRACTION = 0.02  # of all pixels, those with the largest steps
_MIN_JUMP = 1.0  # of the image's mean luminance: smallest step
_RAYS_PER_PIXEL = 16
_STEP = 7  # from row to row: no two rays share a row or column, and none are close
RAY_POSITIONS = (
    (np.stack([np.arange(_RAYS_PER_PIXEL), np.arange(_RAYS_PER_PIXEL) * _STEP % _RAYS_PER_PIXEL], axis=1) + 0.5)
    / _RAYS_PER_PIXEL
).astype(np.float32)


def find_highlight_edges(
    image: Shaped[F32, "height width 3"], is_candidate: Shaped[NDArray[np.bool_], " pixels"]
) -> Shaped[NDArray[np.int32], " n"]:
    """Return the pixels whose luminance differs most from an adjacent one, in row-major order.

    Args:
        image: linear radiance.
        is_candidate: pixels that may be returned, one per pixel.
    """
    luminance = image @ np.array(LUMINANCE, np.float32)
    jump = np.zeros_like(luminance)
    for axis in (0, 1):
        step, before, after = np.abs(np.diff(luminance, axis=axis)), *_adjacent_views(jump, axis)
        np.maximum(before, step, out=before)
        np.maximum(after, step, out=after)
    jumps = np.where(is_candidate, jump.ravel(), 0)
    pixels = np.flatnonzero(jumps > _MIN_JUMP * luminance.mean(dtype=np.float64))
    max_pixels = int(_MAX_EDGE_FRACTION * jumps.size)
    if len(pixels) > max_pixels:
        pixels = pixels[np.argpartition(-jumps[pixels], max_pixels)[:max_pixels]]
    return np.sort(pixels).astype(np.int32)


def _adjacent_views(values: F32, axis: int) -> tuple[F32, F32]:
    """Views without the last and without the first element along an axis."""
    axis_first = np.moveaxis(values, axis, 0)
    return np.moveaxis(axis_first[:-1], 0, axis), np.moveaxis(axis_first[1:], 0, axis)


def add_samples(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    frame: Frame,
    shadow_visibility: Sequence[F32] = (),
) -> Frame:
    """Return the frame with pixels on highlight edges rendered anew.

    Args:
        transfer, state, gbuffer, camera, shadow_visibility: as in `relume.live.free_camera.frame.render_frame`, which
            rendered the frame. All rays of a pixel take the hard shadows of its center.
        frame: unchanged.
    """
    height, width, _ = frame.image.shape
    face = gbuffer.hits.face[: width * height]
    has_lobe = state.materials.lobes.lobe_index[transfer.stored_scene.face_material[np.maximum(face, 0)]] >= 0
    pixels = find_highlight_edges(frame.image, has_lobe & (face >= 0))
    if not len(pixels):
        return frame
    extra_gbuffer = trace_through_glass(
        transfer.stored_scene, transfer.embree, camera, (width, height), pixels, RAY_POSITIONS, gbuffer.glass.rules
    )
    reweight(extra_gbuffer, transfer.has_occluded_neighbor, transfer.occlusion_mesh)
    owner = np.repeat(pixels, _RAYS_PER_PIXEL)
    owner = np.concatenate([owner, owner[extra_gbuffer.glass.ray]])
    final_frame = finish_rays(
        transfer, state, extra_gbuffer, camera, (0, height), [fractions[owner] for fractions in shadow_visibility]
    )
    image, coverage = frame.image.copy(), frame.coverage
    image.reshape(-1, 3)[pixels] = final_frame.radiance.reshape(-1, _RAYS_PER_PIXEL, 3).mean(axis=1)
    if coverage is not None:
        coverage = coverage.copy()
        coverage.reshape(-1)[pixels] = final_frame.coverage.reshape(-1, _RAYS_PER_PIXEL).mean(axis=1)
    return frame._replace(image=image, coverage=coverage)


def render_fine_frame(
    transfer: FreeCameraTransfer,
    state: FrameRequestState,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    shadow_visibility: Sequence[F32],
) -> Frame:
    """Render the frame with anti-aliased highlight edges.

    Args:
        transfer, state, gbuffer, camera, size, shadow_visibility: as in `relume.live.free_camera.frame.render_frame`;
            `state` is fine.
    """
    frame = render_frame(transfer, state, gbuffer, camera, size, shadow_visibility)
    return add_samples(transfer, state, gbuffer, camera, frame, shadow_visibility)
