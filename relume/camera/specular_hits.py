"""Specular reflection of camera rays at materials that are mirrors in the scene's own look."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.specular import is_mirror
from relume.camera.ray_paths import RayPaths, SpecularChain
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.scene.model import Material

MAX_MIRROR_BOUNCES = 2  # per camera ray; further reflections are as blurred as lobes


def is_mirror_material(materials: Sequence[Material]) -> Shaped[NDArray[np.bool_], " materials"]:
    """True for each material that is a mirror in the scene's own look."""
    return np.array([is_mirror(material.terms) for material in materials], np.bool_)


def reflect_rays(
    geometry: SceneBuffers,
    materials: Sequence[Material],
    paths: RayPaths,
    hits: Hits,
    rows: Shaped[NDArray[np.intp], " k"],
    pixel_angle: float,
    num_keys: int,
) -> RayPaths:
    """Continue the paths of rays that hit mirrors.

    Args:
        geometry: the triangles. materials: materials of the scene.
        paths: paths of the rays. hits: hits of all paths. rows: paths that hit mirrors.
        pixel_angle: angle of a pixel, radians. num_keys: larger than any mesh index.
    Returns:
        The continued paths.
    """
    mirror_hits, directions = hits.rows(rows), paths.directions[rows]
    length = paths.length[rows] + mirror_hits.distance
    surface = surface_at(geometry, mirror_hits._replace(distance=length), directions, materials, pixel_angle)
    reflected = _reflect(surface.points.normal, directions)
    face_normal = geometry.face_normals[mirror_hits.face]
    face_normal = face_normal * -np.sign(np.einsum("nc,nc->n", face_normal, directions))[:, None]
    # mapped normals, or smooth normals far from the triangle's, may reflect rays into the surface
    is_below_face = np.einsum("nc,nc->n", reflected, face_normal) <= 0
    reflected[is_below_face] = _reflect(face_normal[is_below_face], directions[is_below_face])
    cosine = np.clip(-np.einsum("nc,nc->n", surface.points.normal, directions), 0, 1)
    last_segment = SpecularChain(
        geometry.face_material[mirror_hits.face][:, None].astype(np.uint16),
        cosine[:, None].astype(np.float32),
        surface.specular[:, None],
    )
    chain = last_segment if paths.chain is None else paths.chain.rows(rows).append(last_segment)
    path_key = paths.path_key[rows] * num_keys + geometry.face_mesh[mirror_hits.face] + 1
    transmittance, num_glass = paths.transmittance[rows], paths.num_glass
    return RayPaths(
        paths.ray[rows],
        surface.points.position,
        reflected,
        transmittance,
        length,
        num_glass,
        chain,
        path_key,
        paths.frost[rows],
    )


def _reflect(normal: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Reflect directions at planes with unit normals. (n, 3) each"""
    reflected = directions - 2 * np.einsum("nc,nc->n", normal, directions)[:, None] * normal
    return np.asarray(reflected / np.linalg.norm(reflected, axis=1, keepdims=True), np.float32)
