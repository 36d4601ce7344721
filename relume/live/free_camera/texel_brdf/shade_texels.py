"""Per-texel BTF shading: the difference between a texel and the mean texel, under the light at the point.

    B(pixel) = B̄ + C Σ_k (p_k(ωo, x) − p̄_k(ωo)) (t_k + Σ_l V_l(pixel) u_lk)

B̄ is the radiance reflected by the mean texel, computed like other materials, hard shadows included; C is the term's
color and gain; V_l and u_l are the visibility and the unoccluded light of a hard-shadow light. In static views each
texel is summed over all lights (`relume.transport.btf_kernel`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid, interpolation_weights_at
from relume.core.numba_options import NO_REFCOUNT
from relume.core.simd import prefetch
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.antialiasing import is_edge
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.texel_brdf.coefficient_packing import NUM_COEFFICIENTS
from relume.live.free_camera.texel_brdf.lanes import (
    NUM_VIEWS,
    TEXELS_PER_VIEW,
    add_texels,
    integrate,
    pack_secondary_axes,
)
from relume.live.free_camera.texel_brdf.texel_tables import BtfMaterial, TexelTables
from relume.live.free_camera.texel_brdf.texture_coordinates import (
    AZIMUTH,
    BATCH_SIZE,
    LEVEL,
    NUM_COLUMNS,
    SHEAR,
    SIDE,
    THETA,
    U,
    V,
    X,
    Y,
    dot,
    gather_hits,
    get_vector,
    map_to_texture,
    repeat_fraction,
    vector_row,
)
from relume.live.free_camera.texel_brdf.texture_frame_light import (
    TexelLight,
    TexelSource,
    rotation_from_vector,
)
from relume.live.free_camera.texel_brdf.visible_relief import visible_height
from relume.probes.stored_scene import StoredScene
from relume.transport.btf_kernel import linear_taps

F32 = NDArray[np.float32]

F = np.float32
_LEVEL_SLOPE = F(4 / 3)  # of a coarser mip level's weight
_CHUNKS_PER_THREAD = 4  # per thread: rays that hit fine texels cost more


class TextureFootprint(NamedTuple):
    """Camera and G-buffer that texels are shaded for.

    Attributes:
        camera_position: meters. pixel_angle: angle of a pixel, radians. gbuffer: G-buffer of its rays.
    """

    camera_position: Shaped[F32, " 3"]
    pixel_angle: float | np.float32
    gbuffer: GBuffer


class IncidentTexelLight(NamedTuple):
    """Incident radiance, and what is derived from it.

    Attributes:
        sources: that of the probes, then hard-shadow lights. light: at lattice nodes, cached from frame to frame.
    """

    sources: Sequence[TexelSource]
    light: TexelLight

    @property
    def shadow_visibility(self) -> Shaped[F32, "lights rays"]:
        """Visible fractions of the hard-shadow lights."""
        fractions = [source.visibility for source in self.sources if source.visibility is not None]
        return np.stack(fractions) if fractions else np.empty((0, 0), np.float32)


class _PlacedBtf(NamedTuple):
    """A BTF on a material, for the kernel: see `BtfMaterial`. rotation: cosine and sine."""

    direction_grid: DirectionGrid
    tables: TexelTables
    secondary_axes: F32
    scale: np.float32
    rotation: tuple[np.float32, np.float32]
    color: Shaped[F32, " 3"]


class _TexelScratch(NamedTuple):
    """Scratch memory of a thread.

    Attributes:
        texels, texel_weights, views, view_weights: of a batch of rays: 4 view directions each, and 8 texels of each of
            them. num_texels: of each view direction of a ray. view, view_weight: of one ray.
        columns: see `relume.live.free_camera.texel_brdf.texture_coordinates`. coefficients: of one ray.
    """

    texels: NDArray[np.int32]
    texel_weights: F32
    views: NDArray[np.int32]
    view_weights: F32
    num_texels: NDArray[np.int64]
    view: NDArray[np.int32]
    view_weight: F32
    columns: F32
    coefficients: F32


def _allocate_scratch() -> _TexelScratch:
    n, num_texels = BATCH_SIZE, NUM_VIEWS * TEXELS_PER_VIEW
    return _TexelScratch(
        np.zeros(num_texels * n, np.int32), np.zeros(num_texels * n, np.float32),
        np.empty(NUM_VIEWS * n, np.int32), np.empty(NUM_VIEWS * n, np.float32), np.empty(n, np.int64),
        np.empty(NUM_VIEWS, np.int32), np.empty(NUM_VIEWS, np.float32),
        np.zeros(NUM_COLUMNS * n, np.float32), np.empty(NUM_COEFFICIENTS, np.float32),
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _list_rays(face, face_material, has_btf, reuses_center, lattice_node, first, rows, is_requested):  # type: ignore[no-untyped-def]
    """List the rays that hit BTF materials, sorted by material, and mark the lattice nodes of their hits.

    Args:
        has_btf: (materials,). reuses_center: 1 for rays to omit.
        first: start of each material in `rows`, written. (materials + 1,). rows: (rays,)
    """
    first[:] = 0
    for ray in range(face.shape[0]):
        if face[ray] >= 0 and not reuses_center[ray]:
            first[face_material[face[ray]] + 1] += has_btf[face_material[face[ray]]]
    for material in range(has_btf.shape[0]):
        first[material + 1] += first[material]
    next_row = first.copy()
    for ray in range(face.shape[0]):
        if face[ray] >= 0 and not reuses_center[ray] and has_btf[face_material[face[ray]]]:
            material = face_material[face[ray]]
            rows[next_row[material]] = ray
            next_row[material] += 1
            for k in range(3):
                is_requested[lattice_node[ray, k]] = 1


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _subtract_center(gbuffer, shadow_visibility, has_btf, surface, num_pixels, reuses_center, out):  # type: ignore[no-untyped-def]
    """Find edge rays that hit the same surface as the pixel center, in the same hard-shadow lights, and subtract the
    center's radiance from theirs.

    Args:
        gbuffer: of the rays. shadow_visibility: of hard-shadow lights. (lights, rays). surface: material and normal of
            each face. reuses_center: per ray, written. out: radiance by the mean texel, written. (rays, 3)
    """
    face_material, face_normal = surface
    for k in range(gbuffer.owner.shape[0]):
        ray, p = num_pixels + k, gbuffer.owner[k]
        f = gbuffer.hits.face[ray]
        if f < 0 or not has_btf[face_material[f]]:
            continue
        is_same = not is_edge(face_material, face_normal, gbuffer.hits, gbuffer.directions, p, ray)
        for light in range(shadow_visibility.shape[0]):
            is_same = is_same and shadow_visibility[light, ray] == shadow_visibility[light, p]
        if is_same:
            reuses_center[ray] = 1
            for channel in range(3):
                out[ray, channel] -= out[p, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_center(owner, num_pixels, reuses_center, out):  # type: ignore[no-untyped-def]
    """Add the shaded radiance of the pixel center to the rays that `_subtract_center` found."""
    for k in range(owner.shape[0]):
        if reuses_center[num_pixels + k]:
            for channel in range(3):
                out[num_pixels + k, channel] = max(out[num_pixels + k, channel] + out[owner[k], channel], F(0))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _neighbor_levels(level, coarsest):  # type: ignore[no-untyped-def]
    """Return the finer of the mip levels around a fractional one, and the weight of the coarser.

    One level alone serves a quarter of all rays, which halves their fetches; the weight stays continuous.
    """
    clamped = min(level, np.float32(coarsest))
    lower = np.int64(clamped)
    fraction = _LEVEL_SLOPE * (np.float32(clamped - np.float32(lower)) - F(0.5)) + F(0.5)
    if fraction >= 1:
        return min(lower + 1, coarsest), F(0)
    return lower, max(fraction, F(0)) if lower < coarsest else F(0)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _add_bilinear(levels, level, u, v, level_weight, first, texels, texel_weights):  # type: ignore[no-untyped-def]
    """Write the four texels of a level around a position, from index `first` on, and their weights."""
    start, height, width = levels[level, 0], levels[level, 1], levels[level, 2]
    left, right, fx = linear_taps(u, width)
    upper, below, fy = linear_taps(v, height)
    upper, below = start + upper * width, start + below * width
    texels[first], texels[first + 1] = upper + left, upper + right
    texels[first + 2], texels[first + 3] = below + left, below + right
    top, bottom = level_weight * (F(1) - fy), level_weight * fy
    texel_weights[first], texel_weights[first + 1] = top * (F(1) - fx), top * fx
    texel_weights[first + 2], texel_weights[first + 3] = bottom * (F(1) - fx), bottom * fx


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _fetch_texels(tables, direction_grid, num_rays, scratch):  # type: ignore[no-untyped-def]
    """Find the view directions of each ray and the texels in which each of them shows what the ray meets, and prefetch
    their coefficients while others are summed.
    """
    levels, weights, _, _, relief = tables
    texels, texel_weights, views, view_weights, num_texels, view, view_weight, columns, _ = scratch
    for j in range(num_rays):
        level, fraction = _neighbor_levels(columns[LEVEL + j], levels.shape[0] - 1)
        num_texels[j] = 8 if fraction > 0 else 4
        interpolation_weights_at(direction_grid, columns[THETA + j], columns[AZIMUTH + j], view, view_weight)
        shear_u, shear_v = columns[SHEAR + j], columns[SHEAR + BATCH_SIZE + j]
        nearest = 0
        for k in range(1, NUM_VIEWS):
            if view_weight[k] > view_weight[nearest]:
                nearest = k
        h = visible_height(relief, level, view[nearest], columns[U + j], columns[V + j], shear_u, shear_v)
        for k in range(NUM_VIEWS):
            views[NUM_VIEWS * j + k], view_weights[NUM_VIEWS * j + k] = view[k], view_weight[k]
            first = TEXELS_PER_VIEW * (NUM_VIEWS * j + k)
            u = repeat_fraction(columns[U + j] + h * (shear_u - relief.shear[view[k], 0]))
            v = repeat_fraction(columns[V + j] - h * (shear_v - relief.shear[view[k], 1]))
            _add_bilinear(levels, level, u, v, F(1) - fraction, first, texels, texel_weights)
            if fraction > 0:
                _add_bilinear(levels, level + 1, u, v, fraction, first + 4, texels, texel_weights)
            for pair in range(first, first + num_texels[j], 2):  # two beside each other: two cache lines at most
                prefetch(weights, (view[k], texels[pair], 0))
                prefetch(weights, (view[k], texels[pair + 1], NUM_COEFFICIENTS - 1))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _node_rotations(tangents, nodes, x, y):  # type: ignore[no-untyped-def]
    """Cosine and sine of the rotation from each of three lattice nodes to the texture's frame, a tuple of six.

    Args:
        tangents: of all nodes. nodes: the three. x, y: axes of the texture, tuples.
    """
    t, u, v = vector_row(tangents, nodes[0]), vector_row(tangents, nodes[1]), vector_row(tangents, nodes[2])
    rotation_t, rotation_u, rotation_v = (
        rotation_from_vector(dot(t, x), dot(t, y)),
        rotation_from_vector(dot(u, x), dot(u, y)),
        rotation_from_vector(dot(v, x), dot(v, y)),
    )
    return rotation_t[0], rotation_t[1], rotation_u[0], rotation_u[1], rotation_v[0], rotation_v[1]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _source_nodes(nodes, source, num_nodes):  # type: ignore[no-untyped-def]
    """Rows of `NodeLight.vectors` of three nodes for a source."""
    first = np.uint32(source * num_nodes)
    return np.uint32(nodes[0] + first), np.uint32(nodes[1] + first), np.uint32(nodes[2] + first)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _integrate_sources(btf, coefficients, light, shadow_visibility, ray, hit, frame):  # type: ignore[no-untyped-def]
    """Integrate a texel's coefficients with the visible light of all sources, per channel.

    Args:
        btf: `_PlacedBtf`. light: `NodeLight`. shadow_visibility: (lights, rays). ray: its index.
        hit: lattice nodes and their weights, tuples. frame: axes of the texture, tuples, and its handedness.
    """
    (tangents, vectors), (nodes, weights), (x, y, side) = light, hit, frame
    rotations = _node_rotations(tangents, nodes, x, y)
    red = green = blue = F(0)
    for source in range(1 + shadow_visibility.shape[0]):
        visible = F(1) if source == 0 else shadow_visibility[source - 1, ray]
        if visible > 0:
            visible_weights = visible * weights[0], visible * weights[1], visible * weights[2]
            source_nodes = _source_nodes(nodes, source, tangents.shape[0])
            radiance = integrate(
                coefficients, btf.tables.axes, btf.secondary_axes, vectors, source_nodes, visible_weights, rotations,
                side,
            )  # fmt: skip
            red, green, blue = red + radiance[0], green + radiance[1], blue + radiance[2]
    return red, green, blue


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _shade_texels(  # type: ignore[no-untyped-def]
    btf, footprint, placements, normals, light, shadow_visibility, rows, start, stop, scratch, out
):
    """Shade rays rows[start:stop]. btf: `_PlacedBtf`. shadow_visibility: (lights, rays). out: (rays, 3)"""
    camera_position, pixel_angle, gbuffer = footprint
    tables, color, columns, coefficients = btf.tables, btf.color, scratch.columns, scratch.coefficients
    lattice_node, weight = gbuffer.lattice_node, gbuffer.weight
    finest, max_slope = np.float32(max(tables.levels[0, 1], tables.levels[0, 2])), tables.relief.max_slope
    for batch_start in range(start, stop, BATCH_SIZE):
        num_rays = min(BATCH_SIZE, stop - batch_start)
        gather_hits(placements, normals, gbuffer, rows, batch_start, num_rays, columns)
        map_to_texture(columns, num_rays, camera_position, pixel_angle, btf.rotation, btf.scale, finest, max_slope)
        _fetch_texels(tables, btf.direction_grid, num_rays, scratch)
        for j in range(num_rays):
            ray = rows[batch_start + j]
            for first in range(0, scratch.num_texels[j], 4):
                add_texels(
                    tables.weight, tables.step, scratch.views, scratch.view_weights, NUM_VIEWS * j, scratch.texels,
                    scratch.texel_weights, TEXELS_PER_VIEW * NUM_VIEWS * j + first, first > 0, coefficients,
                )  # fmt: skip
            nodes = lattice_node[ray, 0], lattice_node[ray, 1], lattice_node[ray, 2]
            node_weights = weight[ray, 0], weight[ray, 1], weight[ray, 2]
            frame = get_vector(columns, X, j), get_vector(columns, Y, j), columns[SIDE + j]
            radiance = _integrate_sources(
                btf, coefficients, light, shadow_visibility, ray, (nodes, node_weights), frame
            )
            for channel in range(3):
                out[ray, channel] = max(out[ray, channel] + color[channel] * radiance[channel], F(0))


def shade_texels(
    btf_materials: Sequence[BtfMaterial],
    stored_scene: StoredScene,
    positions: Shaped[F32, "corners 3"],
    footprint: TextureFootprint,
    incident: IncidentTexelLight,
    out: Shaped[F32, "rays 3"],
) -> None:
    """Replace the mean texel by the actual texels in the radiance of rays.

    Rays of one pixel that hit the same surface share the texel difference: a texel is as wide as the pixel's side.

    Args:
        btf_materials: BTF materials of the look. stored_scene: that is hit.
        positions: positions of triangle corners, meters.
        footprint: footprint of the camera. incident: at its probes.
        out: radiance by the mean texel along the rays, hard-shadow lights included, written.
    """
    if not btf_materials:
        return
    gbuffer, face = footprint.gbuffer, footprint.gbuffer.hits.face
    has_btf = np.zeros(
        1 + max(int(stored_scene.face_material.max()), *(btf_material.material for btf_material in btf_materials)),
        np.uint8,
    )
    has_btf[[btf_material.material for btf_material in btf_materials]] = 1
    first, rows = np.empty(len(has_btf) + 1, np.int64), np.empty(len(face), np.int32)
    is_requested, reuses_center = np.zeros(len(gbuffer.is_visible), np.uint8), np.zeros(len(face), np.uint8)
    num_pixels = len(face) - len(gbuffer.owner) - len(gbuffer.glass.ray)
    surface, shadow_visibility = (stored_scene.face_material, stored_scene.face_normal), incident.shadow_visibility
    _subtract_center(gbuffer, shadow_visibility, has_btf, surface, num_pixels, reuses_center, out)
    _list_rays(
        face, stored_scene.face_material, has_btf, reuses_center, gbuffer.lattice_node, first, rows, is_requested
    )
    light = incident.light.around_nodes(stored_scene, incident.sources, is_requested)
    placements = incident.light.texture_placements(stored_scene, positions)
    kernel_footprint = footprint._replace(pixel_angle=np.float32(footprint.pixel_angle))
    args = kernel_footprint, placements, stored_scene.lattice_nodes.normal, light, shadow_visibility, rows
    spans = [
        (
            int(first[btf_material.material]),
            int(first[btf_material.material + 1]),
            _place(btf_material),
        )
        for btf_material in btf_materials
    ]

    def shade_range(start: int, stop: int) -> None:
        scratch = _allocate_scratch()
        for span_start, span_stop, btf in spans:
            if max(start, span_start) < min(stop, span_stop):
                _shade_texels(btf, *args, max(start, span_start), min(stop, span_stop), scratch, out)

    parallel_for_chunks(shade_range, int(first[-1]), _CHUNKS_PER_THREAD)
    _add_center(gbuffer.owner, num_pixels, reuses_center, out)


def _place(btf_material: BtfMaterial) -> _PlacedBtf:
    texels, tables = btf_material.texels, btf_material.tables
    rotation = np.float32(math.cos(texels.rotation)), np.float32(math.sin(texels.rotation))
    axes, scale = pack_secondary_axes(tables.axes), np.float32(texels.scale)
    return _PlacedBtf(texels.btf.grid, tables, axes, scale, rotation, btf_material.color)
