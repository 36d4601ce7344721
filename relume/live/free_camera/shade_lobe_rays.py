"""Shading by lobe rays: narrow terms of pixels, whose light is ray traced while the camera moves.

    B = a(θo) · texture · L̄ ,

L̄ from `relume.live.free_camera.lobe_radiance`, shared among neighboring pixels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.fixed_camera.illumination import Illumination
from relume.live.free_camera.basis.highlight_lobes import NUM_GROUPS
from relume.live.free_camera.basis.table_index import MIN_COSINE, table_row
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.lobe_terms import TracedLobe
from relume.live.free_camera.normal_mapping import normalize
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.live.free_camera.shade_pixels import blend, interpolate_uv, perturbed_normal, texture_footprint
from relume.live.free_camera.shared_lobe_rays import MAX_RAYS, ImagePoints, PixelSource, lobe_radiance
from relume.probes.stored_scene import StoredScene
from relume.raytrace.ray_origins import ray_origin
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.surface_textures import NORMAL_MAP
from relume.raytrace.texture_kernels import sample_texture
from relume.scene.model import Camera
from relume.transport.lobe_hits import NO_FOOTPRINT
from relume.transport.lobe_scene import LobeScene
from relume.transport.patch_lookup import tangents_of
from relume.transport.shading_points import ShadingPoints
from relume.views.pixel_footprint import pixel_footprint

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _find_points(scene, gbuffer, origins, pixel_angle, rows, start, stop, points, wo):  # type: ignore[no-untyped-def]
    """Write the points of rays rows[start:stop], with mapped normals.

    Args:
        scene: `PixelArrays`. gbuffer: `GBuffer`. origins: `OriginMesh` of the triangles.
        pixel_angle: angle of a pixel, radians. points: `SurfacePoints`, written. wo: written. (n, 3)
    """
    textures, uvs, tangents, faces, uv_faces, face_material, face_normal, uv_scale, normals, _ = scene
    (face, uv, distance), directions, _, lattice_node, weight, _, _, _ = gbuffer
    scratch = np.empty(3, np.float32)
    for i in range(start, stop):
        p = rows[i]
        f, d = face[p], (directions[p, 0], directions[p, 1], directions[p, 2])
        nodes = lattice_node[p, 0], lattice_node[p, 1], lattice_node[p, 2]
        weights, outward = (
            (weight[p, 0], weight[p, 1], weight[p, 2]),
            (face_normal[f, 0], face_normal[f, 1], face_normal[f, 2]),
        )
        n, view_cosine = (
            normalize(blend(normals, nodes, weights)),
            outward[0] * d[0] + outward[1] * d[1] + outward[2] * d[2],
        )
        image = textures.material_textures[face_material[f], NORMAL_MAP]
        if image >= 0:
            footprint = texture_footprint(distance[p], pixel_angle, uv_scale[f], view_cosine)
            texture_uv = interpolate_uv(uvs, (uv_faces[f, 0], uv_faces[f, 1], uv_faces[f, 2]), (uv[p, 0], uv[p, 1]))
            n = perturbed_normal(
                textures, image, texture_uv, footprint, tangents, (faces[f, 0], faces[f, 1], faces[f, 2]),
                (uv[p, 0], uv[p, 1]), n, outward, view_cosine > 0, scratch,
            )  # fmt: skip
        t, _ = tangents_of(n)
        side = -1 if view_cosine > 0 else 1
        x, y, z = ray_origin(origins, f, uv[p, 0], uv[p, 1], side)
        points.position[i, 0], points.position[i, 1], points.position[i, 2] = x, y, z
        for axis in range(3):
            points.normal[i, axis], points.tangent[i, axis], wo[i, axis] = n[axis], t[axis], -d[axis]
        points.seed[i] = p


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_lobes(scene, gbuffer, pixel_angle, albedo, points, wo, radiance, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the radiance of lobes to rays rows[start:stop].

    Args:
        scene, gbuffer, pixel_angle: as in `_find_points`. albedo: of `TracedLobe`.
        points, wo: of each ray. radiance: L̄ of each. out: added to. (rays, 3)
    """
    textures, uvs, _, _, uv_faces, face_material, face_normal, uv_scale, _, _ = scene
    (face, uv, distance), directions, _, _, _, _, _, _ = gbuffer
    texture_value = np.empty(3, np.float32)
    for i in range(start, stop):
        p = rows[i]
        f, n = face[p], points.normal[i]
        cosine = n[0] * wo[i, 0] + n[1] * wo[i, 1] + n[2] * wo[i, 2]
        row, fraction = table_row(min(max(cosine, MIN_COSINE), np.float32(1)))
        for group in range(NUM_GROUPS):
            texture_value[0] = texture_value[1] = texture_value[2] = 1
            image = textures.material_textures[face_material[f], group - 1] if group else -1
            if image >= 0:
                view_cosine = (
                    face_normal[f, 0] * directions[p, 0]
                    + face_normal[f, 1] * directions[p, 1]
                    + face_normal[f, 2] * directions[p, 2]
                )
                footprint = texture_footprint(distance[p], pixel_angle, uv_scale[f], view_cosine)
                u, v = interpolate_uv(uvs, (uv_faces[f, 0], uv_faces[f, 1], uv_faces[f, 2]), (uv[p, 0], uv[p, 1]))
                sample_texture(textures, image, u, v, footprint, texture_value)
            for channel in range(3):
                lower, upper = albedo[row, group, channel], albedo[row + 1, group, channel]
                out[p, channel] += texture_value[channel] * (lower + fraction * (upper - lower)) * radiance[i, channel]


def add_lobe_rays(
    transfer: FreeCameraTransfer,
    stored_scene: StoredScene,
    lobe_scene: LobeScene,
    lobes: Sequence[TracedLobe | None],
    light: Illumination,
    environment: PrefilteredEnvironment,
    gbuffer: GBuffer,
    camera: Camera,
    size: tuple[int, int],
    rays: Shaped[I32, " n"] | None,
    out: Shaped[F32, "rays 3"],
) -> None:
    """Add the reflections of narrow lobes along camera rays.

    Args:
        transfer: of the bake. stored_scene: that is hit, with map overrides. lobe_scene: that lobe rays meet.
        lobes: of each material. light: the illumination. environment: with the gain of all its light.
        gbuffer: G-buffer of the rays. camera: of the image. size: of the image, pixels.
        rays: the rays to shade; None: all. out: radiance, added to.
    """
    num_rays = len(gbuffer.hits.face) if rays is None else len(rays)
    is_traced = np.array([lobe is not None for lobe in lobes])
    material, all_rays = np.empty(num_rays, np.int32), np.empty(0, np.int32) if rays is None else rays
    hit_args = gbuffer.hits.face, gbuffer.weight, stored_scene.face_material, is_traced, all_rays
    parallel_for_chunks(lambda start, stop: _find_materials(*hit_args, start, stop, material), num_rays)
    found = np.flatnonzero(material >= 0).astype(np.int32)
    if not len(found):
        return
    pixel = gbuffer.pixel_of_ray(size[0] * size[1]) if size[0] else np.zeros(len(gbuffer.hits.face), np.int32)
    scene_args = transfer, stored_scene, lobe_scene, light, environment, gbuffer, camera
    for k in np.unique(material[found]):
        index = found[material[found] == k]
        rows = index if rays is None else rays[index]
        is_mapped = stored_scene.textures.material_textures[k, NORMAL_MAP] >= 0
        source = None if is_mapped or not size[0] else PixelSource(camera, int(k))
        image = ImagePoints.from_pixels(pixel[rows], size, source)
        _add_lobe(*scene_args, lobes[k], MAX_RAYS / len(found), rows, image, out)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _find_materials(face, weight, face_material, is_traced, rays, start, stop, out):  # type: ignore[no-untyped-def]
    """Write the material of hits with lattice nodes whose lobes are traced, −1 for others. rays: empty for all"""
    for i in range(start, stop):
        p = rays[i] if rays.shape[0] else i
        f = face[p]
        has_nodes = weight[p, 0] != 0 or weight[p, 1] != 0 or weight[p, 2] != 0
        out[i] = face_material[f] if f >= 0 and has_nodes and is_traced[face_material[f]] else -1


def _add_lobe(
    transfer: FreeCameraTransfer,
    stored_scene: StoredScene,
    lobe_scene: LobeScene,
    light: Illumination,
    environment: PrefilteredEnvironment,
    gbuffer: GBuffer,
    camera: Camera,
    lobe: TracedLobe | None,
    rays_per_point: float,
    rows: I32,
    image: ImagePoints,
    out: F32,
) -> None:
    """Add the reflections of one material.

    Args:
        transfer, stored_scene, lobe_scene, light, environment, gbuffer, camera, out: of `add_lobe_rays`.
        lobe: of the material. rays_per_point: mean number that time allows. rows: rays that hit it, ascending.
        image: their pixels.
    """
    assert lobe is not None
    scene_args, (width, height) = (stored_scene.pixel_arrays(), gbuffer), image.size
    pixel_angle = np.float32(camera.yfov / height)
    wo, positions, normals, tangents = np.empty((4, len(rows), 3), np.float32)
    points = SurfacePoints(positions, normals, tangents, np.empty(len(rows), np.uint32))
    point_args = *scene_args, lobe_scene.surfaces.origins, pixel_angle, rows
    parallel_for_chunks(lambda start, stop: _find_points(*point_args, start, stop, points, wo), len(rows))
    receivers = ShadingPoints(points, wo, np.empty((len(rows), 0), np.uint8))
    footprint = pixel_footprint(image.pixel, width, points, wo) if width else NO_FOOTPRINT
    light_args = lobe_scene, environment, receivers, footprint, lobe, image, rays_per_point
    radiance = lobe_radiance(*light_args, transfer.local_lobe_lights(light), is_direct=light.paths.direct)
    args = *scene_args, pixel_angle, lobe.albedo, points, wo, radiance, rows
    parallel_for_chunks(lambda start, stop: _add_lobes(*args, start, stop, out), len(rows))
