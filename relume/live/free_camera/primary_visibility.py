"""Primary visibility of a free camera: hits of camera rays, and the three lattice nodes around each with weights."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.antialiasing import EDGE_SAMPLE_POSITIONS, find_edges, samples_per_edge
from relume.live.free_camera.glass import NO_GLASS, GlassLayers, find_glass_layers, has_glass
from relume.probes.stored_scene import StoredScene
from relume.probes.triangle_grids import surrounding_nodes
from relume.raytrace.alpha_filter import IGNORE_GLASS, STOP_AT_OPAQUE
from relume.raytrace.camera_rays import Hits, near_distances, trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_PIXEL_CENTER = np.array([[0.5, 0.5]], np.float32)


class GBuffer(NamedTuple):
    """Surfaces along camera rays: one ray per pixel center in row-major order, then extra rays on edges, then glass.

    Attributes:
        hits: hits of the rays. directions: directions of the rays, unit.
        owner: pixel of each extra ray.
        lattice_node: the three nodes around each hit. weight: weight of each; zero if the hit has none.
        glass: in front of rays; its own hits come after all others.
        is_visible: nonzero for lattice nodes around any hit.
        is_needed: nonzero for probes that visible nodes interpolate.
    """

    hits: Hits
    directions: Shaped[F32, "n 3"]
    owner: Shaped[NDArray[np.int32], " m"]
    lattice_node: Shaped[NDArray[np.uint32], "n 3"]
    weight: Shaped[F32, "n 3"]
    glass: GlassLayers
    is_visible: Shaped[NDArray[np.uint8], " nodes"]
    is_needed: Shaped[NDArray[np.uint8], " probes"]

    def pixel_centers(self, num_pixels: int) -> GBuffer:
        """Return only the rays through pixel centers, behind glass. num_pixels: number of pixels of the image"""
        rows = slice(0, num_pixels)
        return self._replace(
            hits=self.hits.rows(rows), directions=self.directions[rows], owner=self.owner[:0],
            lattice_node=self.lattice_node[rows], weight=self.weight[rows], glass=NO_GLASS,
        )  # fmt: skip

    def pixel_of_ray(self, num_pixels: int) -> Shaped[NDArray[np.int32], " n"]:
        """Return the pixel of each ray. num_pixels: number of pixels of the image"""
        pixel = np.concatenate([np.arange(num_pixels, dtype=np.int32), self.owner])
        return np.concatenate([pixel, pixel[self.glass.ray]])

    def pixels_behind_glass(self, num_pixels: int) -> Shaped[NDArray[np.int32], " glass_rays"]:
        """Return the pixel of each ray that meets glass. num_pixels: number of pixels of the image"""
        return self.pixel_of_ray(num_pixels)[len(self.directions) - len(self.glass.ray) :]

    def shows_surface(self, num_pixels: int) -> NDArray[np.bool_]:
        """Return whether the center of each pixel shows a surface or glass. num_pixels: number of pixels"""
        is_surface = self.hits.face[:num_pixels] >= 0
        is_surface[self.glass.ray[self.glass.ray < num_pixels]] = True
        return is_surface

    def with_glass_rules(
        self, stored_scene: StoredScene, embree: EmbreeScene, rules: Shaped[F32, "images 6"]
    ) -> GBuffer:
        """Return the same rays with other rules of glass. stored_scene, embree: the scene"""
        first = len(self.directions) - len(self.glass.ray)
        layers = find_glass_layers(
            embree, stored_scene, self.hits.rows(slice(first, None)), self.directions[first:], rules
        )
        return self._replace(glass=layers._replace(ray=self.glass.ray))

    def first_hit_row(self, pixel: int) -> int:
        """Return the row of the first hit at a pixel center, glass included."""
        glass_rays = self.glass.ray
        glass_index = int(np.searchsorted(glass_rays, pixel))
        has_glass = glass_index < len(glass_rays) and glass_rays[glass_index] == pixel
        return len(self.directions) - len(glass_rays) + glass_index if has_glass else pixel


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _aim(rotation, half_width, half_height, width, height, pixels, offsets, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute directions through points of pixels [start, stop), those of one pixel in succession."""
    for i in range(start, stop):
        y = pixels[i] // width
        x = pixels[i] - y * width
        for offset_index in range(offsets.shape[0]):
            r = i * offsets.shape[0] + offset_index
            a = (np.float32(2) * (x + offsets[offset_index, 0]) / width - np.float32(1)) * half_width
            b = (np.float32(1) - np.float32(2) * (y + offsets[offset_index, 1]) / height) * half_height
            scale = np.float32(1) / math.sqrt(a * a + b * b + np.float32(1))
            for axis in range(3):
                out[r, axis] = scale * (rotation[axis, 0] * a + rotation[axis, 1] * b - rotation[axis, 2])


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _find_nodes(probe_grid, face_normal, hits, directions, start, stop, lattice_node, weight, is_visible):  # type: ignore[no-untyped-def]
    """Find the lattice nodes around hits [start, stop); a side without nodes uses those of the other side."""
    face, uv, _ = hits
    for p in range(start, stop):
        f = face[p]
        weight[p, 0] = weight[p, 1] = weight[p, 2] = 0
        if f < 0:
            continue
        view_cosine = (
            face_normal[f, 0] * directions[p, 0]
            + face_normal[f, 1] * directions[p, 1]
            + face_normal[f, 2] * directions[p, 2]
        )
        side = 1 if view_cosine > 0 else 0
        if probe_grid.num_rows[f, side] == 0:
            side = 1 - side
        if probe_grid.num_rows[f, side] == 0:
            continue
        n0, n1, n2, w0, w1, w2 = surrounding_nodes(probe_grid, f, side, uv[p, 0], uv[p, 1])
        lattice_node[p, 0], lattice_node[p, 1], lattice_node[p, 2] = (
            probe_grid.node_index[n0],
            probe_grid.node_index[n1],
            probe_grid.node_index[n2],
        )
        weight[p, 0], weight[p, 1], weight[p, 2] = w0, w1, w2
        for k in range(3):
            is_visible[lattice_node[p, k]] = 1


def trace_primary(
    stored_scene: StoredScene,
    embree: EmbreeScene,
    camera: Camera,
    size: tuple[int, int],
    glass_rules: Shaped[F32, "images 6"] | None = None,
) -> GBuffer:
    """Trace the camera rays of an image.

    Args:
        stored_scene: the scene. embree: its triangles. camera: camera of the image. size: width and height in pixels.
        glass_rules: see `GlassLayers`; None: as in the scene.
    """
    num_pixels = size[0] * size[1]
    directions = _directions(camera, size, np.arange(num_pixels, dtype=np.int32), _PIXEL_CENTER)
    hits, glass_hits = _trace(embree, camera, directions, IGNORE_GLASS), _trace_glass(embree, camera, directions)
    edges = find_edges(stored_scene, hits, directions, size)
    if glass_hits is not None:
        edges = np.union1d(edges, find_edges(stored_scene, glass_hits, directions, size)).astype(np.int32)
    num_samples = samples_per_edge(len(edges), num_pixels)
    owner = np.repeat(edges, num_samples)
    if len(owner):
        edge_directions = _directions(camera, size, edges, EDGE_SAMPLE_POSITIONS[:num_samples])
        hits = Hits.concatenate([hits, _trace(embree, camera, edge_directions, IGNORE_GLASS)])
        directions = np.concatenate([directions, edge_directions])
    if glass_hits is not None:
        glass_hits = Hits.concatenate([glass_hits, _trace(embree, camera, directions[num_pixels:], STOP_AT_OPAQUE)])
    return _make_gbuffer(stored_scene, embree, directions, hits, glass_hits, owner, glass_rules)


def trace_through_glass(
    stored_scene: StoredScene,
    embree: EmbreeScene,
    camera: Camera,
    size: tuple[int, int],
    pixels: Shaped[NDArray[np.int32], " n"],
    offsets: Shaped[F32, "k 2"],
    glass_rules: Shaped[F32, "images 6"] | None,
) -> GBuffer:
    """Trace more rays through some pixels only.

    Args:
        stored_scene, embree, camera, size, glass_rules: as in `trace_primary`.
        pixels: the pixels. offsets: offsets of rays in each pixel, pixel units.
    Returns:
        k rays for each pixel in succession, as if each ray were a pixel.
    """
    directions = _directions(camera, size, pixels, offsets)
    hits, glass_hits = _trace(embree, camera, directions, IGNORE_GLASS), _trace_glass(embree, camera, directions)
    return _make_gbuffer(stored_scene, embree, directions, hits, glass_hits, np.empty(0, np.int32), glass_rules)


def _trace(embree: EmbreeScene, camera: Camera, directions: F32, alpha_sample: np.float32) -> Hits:
    """Find the first hits behind a camera's near plane."""
    start = near_distances(camera, directions)
    return trace_rays(embree, camera.to_world[:3, 3].astype(np.float32), directions, alpha_sample, start)


def _trace_glass(embree: EmbreeScene, camera: Camera, directions: F32) -> Hits | None:
    """Find the first hits including glass; None if the scene has no glass."""
    return _trace(embree, camera, directions, STOP_AT_OPAQUE) if has_glass(embree) else None


def _make_gbuffer(
    stored_scene: StoredScene,
    embree: EmbreeScene,
    directions: F32,
    hits: Hits,
    glass_hits: Hits | None,
    owner: NDArray[np.int32],
    glass_rules: F32 | None,
) -> GBuffer:
    """Make the G-buffer of rays and glass. glass_hits: first hits including glass, None without glass."""
    glass = NO_GLASS
    if glass_hits is not None:
        glass = find_glass_layers(embree, stored_scene, glass_hits, directions, glass_rules)
        hits = Hits.concatenate([hits, glass_hits.rows(glass.ray)])
        directions = np.concatenate([directions, directions[glass.ray]])
    num_rays = len(directions)
    lattice_node, weight = np.zeros((num_rays, 3), np.uint32), np.empty((num_rays, 3), np.float32)
    is_visible = np.zeros(len(stored_scene.lattice_nodes.normal), np.uint8)
    args = stored_scene.probe_grid, stored_scene.face_normal, hits, directions
    parallel_for_chunks(lambda start, stop: _find_nodes(*args, start, stop, lattice_node, weight, is_visible), num_rays)
    is_needed = np.zeros(stored_scene.probes.num_points, np.uint8)
    mark_needed_probes(stored_scene.lattice_nodes, is_visible, is_needed)
    return GBuffer(hits, directions, owner, lattice_node, weight, glass, is_visible, is_needed)


def _directions(camera: Camera, size: tuple[int, int], pixels: NDArray[np.int32], offsets: F32) -> F32:
    """Directions through points of pixels, those of one pixel in succession. offsets: pixel units. (k, 2) float32"""
    width, height = size
    half_height = np.float32(math.tan(camera.yfov / 2))
    rotation = np.ascontiguousarray(camera.to_world[:3, :3], np.float32)
    directions = np.empty((len(pixels) * len(offsets), 3), np.float32)
    camera_args = (rotation, np.float32(half_height * width / height), half_height, width, height, pixels, offsets)
    parallel_for_chunks(lambda start, stop: _aim(*camera_args, start, stop, directions), len(pixels))
    return directions


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def mark_needed_probes(lattice_nodes, is_visible, is_needed):  # type: ignore[no-untyped-def]
    """Mark the probes that lattice nodes interpolate.

    Args:
        lattice_nodes: all. is_visible: the nodes. (nodes,) uint8. is_needed: written. (probes,) uint8
    """
    for v in range(is_visible.shape[0]):
        if is_visible[v]:
            for k in range(lattice_nodes.probe.shape[1]):
                if lattice_nodes.weight[v, k] > 0:
                    is_needed[lattice_nodes.probe[v, k]] = 1


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _interpolate_to_nodes(lattice_nodes, rows, values, start, stop, out):  # type: ignore[no-untyped-def]
    """Interpolate probe values to the lattice nodes rows[start:stop]."""
    for v in rows[start:stop]:
        out[v] = 0
        for k in range(lattice_nodes.probe.shape[1]):
            w, probe = lattice_nodes.weight[v, k], lattice_nodes.probe[v, k]
            if w > 0:
                for c in range(values.shape[1]):
                    out[v, c] += w * values[probe, c]


def interpolate_to_nodes(
    stored_scene: StoredScene,
    is_visible: Shaped[NDArray[np.uint8], " nodes"],
    values: Shaped[F32, " probes *channels"],
    out: Shaped[F32, " nodes *channels"] | None = None,
) -> Shaped[F32, " nodes *channels"]:
    """Interpolate probe values to lattice nodes.

    Args:
        stored_scene: the scene. is_visible: nonzero for nodes to evaluate.
        values: values of probes. out: overwritten there; None: new, zero elsewhere.
    """
    flat = values.reshape(len(values), -1)
    node_values = np.zeros((len(is_visible), *values.shape[1:]), np.float32) if out is None else out
    rows, flat_node_values = np.flatnonzero(is_visible.view(np.bool_)), node_values.reshape(len(node_values), -1)
    parallel_for_chunks(
        lambda start, stop: _interpolate_to_nodes(
            stored_scene.lattice_nodes, rows, flat, start, stop, flat_node_values
        ),
        len(rows),
    )
    return node_values
