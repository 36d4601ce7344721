"""Camera rays through glass: straight through thin glass, refracted by solids, attenuated by both.

Shadow rays are not refracted: `relume.raytrace.alpha_filter` attenuates them. Behind each glass surface the
transmittance of a camera ray is multiplied by

    T = (1 - F) tint,  inside solids also e^(-absorbed s)  along s meters,

with F the Fresnel reflectance of the interface. Under total internal reflection the ray is reflected instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import fresnel
from relume.camera.ray_paths import RayPaths
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.scene.model import Glass, Material

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_GLASS_HITS = 8  # glass surfaces on a ray; a thin pane has two, a bottle four
MAX_VISIBLE_GLASS = 2  # successive glass surfaces that show reflections: each costs one sample per pixel


class GlassSurfaces(NamedTuple):
    """Glass parameters of each material; defaults if it is not glass."""

    is_glass: Shaped[NDArray[np.bool_], " materials"]
    ior: Shaped[F64, " materials"]
    is_solid: Shaped[NDArray[np.bool_], " materials"]
    tint: Shaped[F64, "materials 3"]
    absorbed: Shaped[F64, "materials 3"]


def has_glass(materials: Sequence[Material]) -> bool:
    """True if any material is glass."""
    return any(material.glass is not None for material in materials)


def glass_surfaces(materials: Sequence[Material]) -> GlassSurfaces:
    """Collect the glass parameters of materials."""
    glasses = [material.glass or Glass() for material in materials]
    return GlassSurfaces(
        np.array([material.glass is not None for material in materials]),
        np.array([glass.ior for glass in glasses]),
        np.array([glass.thickness > 0 for glass in glasses]),
        np.array([glass.tint for glass in glasses]),
        np.array([glass.absorbed for glass in glasses]),
    )


def refract(
    geometry: SceneBuffers, glass: GlassSurfaces, paths: RayPaths, hits: Hits, rows: Shaped[NDArray[np.intp], " k"]
) -> tuple[Shaped[NDArray[np.bool_], " k"], RayPaths]:
    """Continue the paths of rays that hit glass.

    Args:
        geometry: the triangles. glass: glass parameters of materials.
        paths: paths of the rays. hits: hits of all paths. rows: paths that hit glass.
    Returns:
        True for hits on thin glass or the outside of a solid, and the continued paths.
    """
    glass_hits = hits.rows(rows)
    material, directions = geometry.face_material[glass_hits.face], paths.directions[rows].astype(np.float64)
    points = surface_at(geometry, glass_hits, paths.directions[rows]).points  # offset toward the visible side
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


def dielectric(cos_theta_i: Shaped[F64, " n"], eta: Shaped[F64, " n"]) -> tuple[Shaped[F64, " n"], Shaped[F64, " n"]]:
    """Fresnel reflectance, unpolarized, and the cosine of refraction; 1 and 0 under total internal reflection.

    Args:
        cos_theta_i: cos θi on the incident side. eta: index of refraction, incident over transmitted side.
    """
    cos_theta_t = np.sqrt(np.maximum(1 - eta**2 * (1 - cos_theta_i**2), 0))
    return fresnel(cos_theta_i, 1 / eta, 0.0), cos_theta_t
