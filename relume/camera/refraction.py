"""What an eye sees through glass: its rays go on behind it, straight through panes, bent by solids, tinted by both.

Light's rays are not bent: `relume.raytrace.alpha_filter` lets their share pass. Behind each surface of glass that an
eye's ray meets it is dimmed by what that lets through,

    T = (1 - F) tint,  inside of solids also e^(-absorbed s)  along s metres,

with F of a dielectric's rim. Where nothing passes, inside of a solid, the ray is reflected instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import fresnel
from relume.camera.ray_paths import RayPaths
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.scene.model import Glass, Material

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_GLASS_HITS = 8  # surfaces that a ray meets; two are a pane, four a bottle
MAX_VISIBLE_GLASS = 2  # of glass, one behind the other, that are seen themselves: each costs a sample of every pixel


class GlassSurfaces(NamedTuple):
    """The glass of every material, whether it is of glass or not. (materials,) and (materials, 3)"""

    is_glass: NDArray[np.bool_]
    ior: F64
    is_solid: NDArray[np.bool_]
    tint: F64
    absorbed: F64


def has_glass(materials: Sequence[Material]) -> bool:
    """Tell whether any material is of glass."""
    return any(material.glass is not None for material in materials)


def glass_surfaces(materials: Sequence[Material]) -> GlassSurfaces:
    """Read the glass of materials."""
    glasses = [material.glass or Glass() for material in materials]
    return GlassSurfaces(
        np.array([material.glass is not None for material in materials]),
        np.array([glass.ior for glass in glasses]),
        np.array([glass.thickness > 0 for glass in glasses]),
        np.array([glass.tint for glass in glasses]),
        np.array([glass.absorbed for glass in glasses]),
    )


def refract(
    geometry: SceneBuffers, glass: GlassSurfaces, paths: RayPaths, hits: Hits, rows: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], RayPaths]:
    """Send rays that met glass on.

    Args:
        geometry: the triangles. glass: the glass of materials.
        paths: of the rays. hits: what they met. rows: those that met glass. (k,)
    Returns:
        Whether each met the outer side of a solid, or a pane, (k,), and how they go on.
    """
    glass_hits = hits.rows(rows)
    material, directions = geometry.face_material[glass_hits.face], paths.directions[rows].astype(np.float64)
    points = surface_at(geometry, glass_hits, paths.directions[rows]).points  # moved off to the side that is seen
    face_normal, normal = geometry.face_normals[glass_hits.face].astype(np.float64), points.normal.astype(np.float64)
    facing = np.einsum("nc,nc->n", face_normal, directions)
    is_solid = glass.is_solid[material]
    is_outer = (facing < 0) | ~is_solid
    cos_theta_i = np.clip(-np.einsum("nc,nc->n", normal, directions), 0, 1)
    eta = np.where(is_outer, 1 / glass.ior[material], glass.ior[material])
    reflectance, cos_theta_t = dielectric(cos_theta_i, eta)
    is_total_reflection = reflectance >= 1
    inner_length = np.where(is_outer | ~is_solid, 0, glass_hits.distance).astype(np.float64)
    transmittance = np.where(is_total_reflection[:, None], 1, (1 - reflectance)[:, None] * glass.tint[material])
    transmittance *= np.exp(-inner_length[:, None] * glass.absorbed[material])
    refracted = eta[:, None] * directions + (eta * cos_theta_i - cos_theta_t)[:, None] * normal
    mirror_directions = directions + 2 * cos_theta_i[:, None] * normal
    new_directions = np.where(
        is_total_reflection[:, None], mirror_directions, np.where(is_solid[:, None], refracted, directions)
    )
    new_directions /= np.linalg.norm(new_directions, axis=1, keepdims=True)
    offset = np.where(is_total_reflection, 0, 2 * geometry.epsilon * np.sign(facing))[:, None] * face_normal
    return is_outer, RayPaths(
        paths.ray[rows],
        (points.position + offset).astype(np.float32),
        new_directions.astype(np.float32),
        (paths.transmittance[rows] * transmittance).astype(np.float32),
        paths.length[rows] + glass_hits.distance,
        paths.num_glass + 1,
        None if paths.chain is None else paths.chain.rows(rows),
        paths.path_key[rows],
    )


def dielectric(cos_theta_i: F64, eta: F64) -> tuple[F64, F64]:
    """Fresnel's reflectance, unpolarised, and the cosine behind the rim.

    Args:
        cos_theta_i: before it. (n,). eta: index of refraction before it over that behind it. (n,)
    Returns:
        (n,) both; 1 and 0 where nothing passes.
    """
    cos_theta_t = np.sqrt(np.maximum(1 - eta**2 * (1 - cos_theta_i**2), 0))
    return fresnel(cos_theta_i, 1 / eta, 0.0), cos_theta_t
