"""Incremental frames after material edits with the same camera and light: only affected pixels are rendered.

The G-buffer, incident light and all other materials stay. Probes with an edited material are shaded, then the lattice
nodes that interpolate them, then the rays that show either.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.primary_visibility import GBuffer
from relume.math.rgb9e5 import pack_rgb9e5
from relume.probes.stored_scene import StoredScene

F32 = NDArray[np.float32]


class DirtyRegion(NamedTuple):
    """The part of an image that shows some materials.

    Attributes:
        probe_mask: probes with these materials. node_mask: lattice nodes that interpolate such probes.
        rays: rays that show them; None: all.
    """

    probe_mask: Shaped[NDArray[np.uint8], " probes"]
    node_mask: Shaped[NDArray[np.uint8], " nodes"]
    rays: Shaped[NDArray[np.int32], " n"] | None


class DirtyPixels(NamedTuple):
    """A region of an image, and its pixels.

    Attributes:
        pixels: pixels with any of its rays.
        first_extra_ray: index of the first extra ray of each.
    """

    region: DirtyRegion
    pixels: Shaped[NDArray[np.int32], " m"]
    first_extra_ray: Shaped[NDArray[np.intp], " m"]


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _mark_nodes(lattice_nodes, is_visible, probe_mask, out):  # type: ignore[no-untyped-def]
    for v in range(is_visible.shape[0]):
        if is_visible[v]:
            for k in range(lattice_nodes.probe.shape[1]):
                if lattice_nodes.weight[v, k] > 0 and probe_mask[lattice_nodes.probe[v, k]]:
                    out[v] = 1


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _mark_rays(material, is_changed, node_mask, gbuffer, out, pixel_mask):  # type: ignore[no-untyped-def]
    face, lattice_node, weight, num_pixels = (
        gbuffer.hits.face,
        gbuffer.lattice_node,
        gbuffer.weight,
        pixel_mask.shape[0],
    )
    for r in range(face.shape[0]):
        if face[r] < 0:
            continue
        is_dirty = is_changed[material[face[r]]]
        for k in range(3):
            is_dirty |= weight[r, k] != 0 and node_mask[lattice_node[r, k]] != 0
        if is_dirty:
            out[r] = 1
            pixel_mask[r if r < num_pixels else gbuffer.owner[r - num_pixels]] = 1


def find_dirty_pixels(
    stored_scene: StoredScene, gbuffer: GBuffer, is_changed: Shaped[NDArray[np.bool_], " materials"], num_pixels: int
) -> DirtyPixels:
    """Return the pixels that show some materials.

    Args:
        stored_scene: the scene. gbuffer: G-buffer of the image's rays, without glass.
        is_changed: the materials. num_pixels: number of pixels of the image.
    """
    probe_mask = (gbuffer.is_needed & is_changed[stored_scene.material]).astype(np.uint8)
    node_mask, ray_mask = np.zeros_like(gbuffer.is_visible), np.zeros(len(gbuffer.directions), np.bool_)
    _mark_nodes(stored_scene.lattice_nodes, gbuffer.is_visible, probe_mask, node_mask)
    pixel_mask = np.zeros(num_pixels, np.bool_)
    _mark_rays(stored_scene.face_material, is_changed, node_mask, gbuffer, ray_mask, pixel_mask)
    region = DirtyRegion(probe_mask, node_mask, np.flatnonzero(ray_mask).astype(np.int32))
    pixels = np.flatnonzero(pixel_mask).astype(np.int32)
    return DirtyPixels(region, pixels, np.searchsorted(gbuffer.owner, pixels))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _resolve_subset(radiance, owner, first_extra_ray, pixels, start, stop, out, rgb9e5):  # type: ignore[no-untyped-def]
    """Resolve pixels[start:stop]."""
    num_pixels = out.shape[0]
    for i in range(start, stop):
        p, r, num = pixels[i], first_extra_ray[i], np.float32(1)
        red, green, blue = radiance[p, 0], radiance[p, 1], radiance[p, 2]
        while r < owner.shape[0] and owner[r] == p:
            red += radiance[num_pixels + r, 0]
            green += radiance[num_pixels + r, 1]
            blue += radiance[num_pixels + r, 2]
            num += 1
            r += 1
        out[p, 0], out[p, 1], out[p, 2] = red / num, green / num, blue / num
        rgb9e5[p] = pack_rgb9e5(out[p, 0], out[p, 1], out[p, 2])


def resolve_subset(
    radiance: Shaped[F32, "rays 3"],
    owner: Shaped[NDArray[np.int32], " m"],
    dirty: DirtyPixels,
    out: Shaped[F32, "pixels 3"],
    rgb9e5: Shaped[NDArray[np.uint32], " pixels"],
) -> None:
    """Average all rays of some pixels; see `relume.live.free_camera.antialiasing.resolve` for all pixels.

    Args:
        radiance: radiance of the rays through all pixel centers, then of the extra rays.
        owner: pixels of the extra rays, ascending. dirty: the pixels to resolve.
        out: radiance, float32, written there. rgb9e5: the same, packed.
    """
    args = radiance, owner, dirty.first_extra_ray, dirty.pixels
    parallel_for_chunks(lambda start, stop: _resolve_subset(*args, start, stop, out, rgb9e5), len(dirty.pixels))
