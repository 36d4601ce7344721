"""A frame after an edit of materials, its eye and its light as they were: only what shows them is found anew.

What an eye meets, the light at points and all other materials stay. Of points those are evaluated whose own material
was edited, of vertices those that take from such points, of rays those that show either.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.views.resolve import pack_rgb9e5

F32 = NDArray[np.float32]


class DirtyRegion(NamedTuple):
    """What of a picture shows some materials.

    Attributes:
        probe_mask: that send by them. (points,) uint8. node_mask: that take from those. (vertices,) uint8
        rays: that show them; None: all. (n,) int32
    """

    probe_mask: NDArray[np.uint8]
    node_mask: NDArray[np.uint8]
    rays: NDArray[np.int32] | None


class DirtyPixels(NamedTuple):
    """A part of a picture, and its pixels.

    Attributes:
        pixels: that have any of its rays. (m,) int32
        first_extra_ray: of each, where its other rays begin among those that go through no middle. (m,) int64
    """

    region: DirtyRegion
    pixels: NDArray[np.int32]
    first_extra_ray: NDArray[np.intp]


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _mark_nodes(lattice_nodes, is_visible, probe_mask, out):  # type: ignore[no-untyped-def]
    for v in range(is_visible.shape[0]):
        if is_visible[v]:
            for k in range(lattice_nodes.probe.shape[1]):
                if lattice_nodes.weight[v, k] > 0 and probe_mask[lattice_nodes.probe[v, k]]:
                    out[v] = 1


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _mark_rays(material, is_changed, node_mask, face, lattice_node, weight, owner, out, pixel_mask):  # type: ignore[no-untyped-def]
    num_pixels = pixel_mask.shape[0]
    for r in range(face.shape[0]):
        if face[r] < 0:
            continue
        is_dirty = is_changed[material[face[r]]]
        for k in range(3):
            is_dirty |= weight[r, k] != 0 and node_mask[lattice_node[r, k]] != 0
        if is_dirty:
            out[r] = 1
            pixel_mask[r if r < num_pixels else owner[r - num_pixels]] = 1


def find_dirty_pixels(
    stored_scene: StoredScene, gbuffer: GBuffer, is_changed: NDArray[np.bool_], num_pixels: int
) -> DirtyPixels:
    """Find what of a picture shows some materials.

    Args:
        stored_scene: that is seen. gbuffer: by the rays of the picture, no glass among it.
        is_changed: whether a material is one of them. (materials,) bool. num_pixels: of the picture.
    """
    probe_mask = (gbuffer.is_needed & is_changed[stored_scene.material]).astype(np.uint8)
    node_mask, ray_mask = np.zeros_like(gbuffer.is_visible), np.zeros(len(gbuffer.directions), np.bool_)
    _mark_nodes(stored_scene.lattice_nodes, gbuffer.is_visible, probe_mask, node_mask)
    pixel_mask, ray_arrays = (
        np.zeros(num_pixels, np.bool_),
        (gbuffer.hits.face, gbuffer.lattice_node, gbuffer.weight, gbuffer.owner),
    )
    _mark_rays(stored_scene.face_material, is_changed, node_mask, *ray_arrays, ray_mask, pixel_mask)
    region = DirtyRegion(probe_mask, node_mask, np.flatnonzero(ray_mask).astype(np.int32))
    pixels = np.flatnonzero(pixel_mask).astype(np.int32)
    return DirtyPixels(region, pixels, np.searchsorted(gbuffer.owner, pixels))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _resolve_subset(radiance, owner, first_extra_ray, pixels, start, stop, out, rgb9e5):  # type: ignore[no-untyped-def]
    """Resolve the pixels that are [start, stop) of pixels."""
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
    radiance: F32, owner: NDArray[np.int32], dirty: DirtyPixels, out: F32, rgb9e5: NDArray[np.uint32]
) -> None:
    """Take the mean of all rays of some pixels; see `relume.views.resolve`, which does so of all.

    Args:
        radiance: of the rays through the middles of all pixels, then of the others. (rays, 3) float32
        owner: pixels of the others, rising. (m,) int32. dirty: with the pixels that are asked.
        out: written there. (num_pixels, 3) float32. rgb9e5: the same, packed. (num_pixels,) uint32
    """
    args = radiance, owner, dirty.first_extra_ray, dirty.pixels
    parallel_for_chunks(lambda start, stop: _resolve_subset(*args, start, stop, out, rgb9e5), len(dirty.pixels))
