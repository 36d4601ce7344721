"""Which share of a beam each ray's surface sees, with few shadow rays: every fourth pixel is asked, others predicted.

Every second pixel of every second row asks for one of its targets, neighbours for different ones. Where all that are
asked about a pixel, on its surface, say the same, so does it. Others ask for all targets, from places spread over
what the pixel covers: so edges of shadows are smooth, and as wide as the light is. Where one of those finds else than
what was predicted beside it, its neighbours ask too, in a few rounds. Where a whole neighbourhood is partly in
shadow, each pixel takes the mean of nine, whose targets together are `TURNS` times as many.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.light.suns import NUM_TARGETS
from relume.moving.beams.beam import Targets
from relume.moving.beams.shadow_kernel import Rays, doubt, doubt_across, even_out, predict, trace_all, trace_one
from relume.moving.look_up import Seen
from relume.moving.solid import Solid
from relume.parallel import for_shares
from relume.scene.model import Camera
from relume.trace.embree import occluded, packet_arguments

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
_Asking = tuple[Any, int, int, Rays, Targets]  # what kernels that trace are called with first

_ROUNDS = 32  # a shadow is followed that many times two pixels beyond where it was seen first


def shares_seen(solid: Solid, seen: Seen, camera: Camera, size: tuple[int, int], targets: Targets) -> F32:
    """Find the share of a beam that is seen where each ray of an eye ends.

    Args:
        solid: what is seen, and may be in the way. seen: by the rays. camera: the eye.
        size: width and height of its picture, pixels. targets: what shadow rays are sent to.
    Returns:
        (rays,) float32
    """
    width, height = size
    num_pixels, num = width * height, np.zeros(len(seen.hits.face), np.uint8)
    arguments = packet_arguments(coherent=True)
    asking = (occluded, solid.embree.handle, arguments.ctypes.data, _rays_of(solid, seen, camera, height), targets)
    _ask_pixels(asking, seen, size, num)
    _ask_across_edges(asking, seen, num_pixels, width, num)
    out = np.divide(num, NUM_TARGETS, dtype=np.float32)
    for_shares(lambda a, b: even_out(asking[3], width, height, num, a, b, out), num_pixels)
    return out


def _rays_of(solid: Solid, seen: Seen, camera: Camera, height: int) -> Rays:
    surface, hits = solid.surface, seen.hits
    pixel = 2 * math.tan(camera.yfov / 2) / height
    right, up = (np.ascontiguousarray(camera.to_world[:3, k] * pixel, np.float32) for k in (0, 1))
    return Rays(
        solid.positions, solid.off_edges, surface.faces, surface.face_material, surface.face_normal,
        hits.face, hits.uv, hits.distance, seen.directions, right, up, np.float32(solid.off_surface),
    )  # fmt: skip


def _ask_pixels(asking: _Asking, seen: Seen, size: tuple[int, int], num: U8) -> None:
    """Ask every fourth pixel, and all that are in doubt. num: targets that rays see, written for pixels. (rays,)"""
    (width, height), rays, face = size, asking[3], seen.hits.face
    is_doubted, is_known, is_edge = (np.zeros(width * height, np.bool_) for _ in range(3))
    is_edge[seen.owner] = True
    every_second = np.arange(height)[::2, None] * width + np.arange(width)[::2]
    few = every_second[face[every_second] >= 0]
    for_shares(lambda a, b: trace_one(*asking, few, width, a, b, num), len(few))
    for_shares(lambda a, b: predict(rays, width, height, a, b, num, is_doubted), every_second.size)
    for _ in range(_ROUNDS):
        many = np.flatnonzero(is_doubted)
        if not len(many):
            break
        _ask_all(asking, many, is_edge, width, num)
        is_known[many], is_doubted[many] = True, False
        _spread_doubt(rays, size, many, is_known, num, is_doubted)


def _ask_all(asking: _Asking, chosen: NDArray[np.intp], is_edge: NDArray[np.bool_], width: int, num: U8) -> None:
    for_shares(lambda a, b: trace_all(*asking, chosen, is_edge, width, a, b, num), len(chosen))


def _spread_doubt(
    rays: Rays,
    size: tuple[int, int],
    found: NDArray[np.intp],
    is_known: NDArray[np.bool_],
    num: U8,
    is_doubted: NDArray[np.bool_],
) -> None:
    for_shares(lambda a, b: doubt(rays, *size, found, is_known, num, a, b, is_doubted), len(found))


def _ask_across_edges(asking: _Asking, seen: Seen, num_pixels: int, width: int, num: U8) -> None:
    """Ask the rays beyond one for each pixel, for all targets where those of one pixel do not agree."""
    rays, face = asking[3], seen.hits.face
    few = np.flatnonzero(face[num_pixels:] >= 0) + num_pixels
    for_shares(lambda a, b: trace_one(*asking, few, width, a, b, num), len(few))
    is_doubted, owner = np.zeros(len(seen.owner), np.bool_), seen.owner
    more = len(owner) // max(1, len(np.unique(owner)))
    for_shares(
        lambda a, b: doubt_across(rays, owner, num_pixels, more, num, a, b, is_doubted), len(owner) // max(1, more)
    )
    _ask_all(asking, np.flatnonzero(is_doubted) + num_pixels, np.zeros(0, np.bool_), width, num)
