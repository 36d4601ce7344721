"""Camera rays through glass: straight through thin glass, refracted by solids, attenuated by both.

Shadow rays are not refracted: `relume.raytrace.alpha_filter` attenuates them. Behind each glass surface the
transmittance of a camera ray is multiplied by

    T = (1 - F) tint,  inside solids also e^(-absorbed s)  along s meters,

with F the Fresnel reflectance of the interface. Under total internal reflection the ray is reflected instead.

Frosted glass has GGX facets of width α = roughness². A ray meets one of those that it sees (Heitz 2018), and T is
multiplied by the fraction G₁ of facets that the refracted ray passes (Walter 2007). A pixel that shows frosted glass
has many rays, so its samples average the facets. Light that thin glass scatters is mirrored to its other side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import fresnel
from relume.camera.ray_paths import RayPaths
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.scene.model import Glass, Material

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_GLASS_HITS = 8  # glass surfaces on a ray; a thin pane has two, a bottle four
MAX_CLEAR_ROUGHNESS = 0.05  # up to which the blur of glass is negligible
_MAX_RAYS_PER_PIXEL, _KEY_BITS = 64, 20  # each ray behind frosted glass has a path key of its own
MAX_VISIBLE_GLASS = 2  # successive glass surfaces that show reflections: each costs one sample per pixel


class GlassSurfaces(NamedTuple):
    """Glass parameters of each material; defaults if it is not glass."""

    is_glass: Shaped[NDArray[np.bool_], " materials"]
    ior: Shaped[F64, " materials"]
    is_solid: Shaped[NDArray[np.bool_], " materials"]
    tint: Shaped[F64, "materials 3"]
    absorbed: Shaped[F64, "materials 3"]
    alpha: Shaped[F64, " materials"]

    @property
    def is_frosted(self) -> Shaped[NDArray[np.bool_], " materials"]:
        """True for glass that blurs what is behind it."""
        return self.is_glass & (self.alpha > 0)


def has_glass(materials: Sequence[Material]) -> bool:
    """True if any material is glass."""
    return any(material.glass is not None for material in materials)


def has_frost(materials: Sequence[Material]) -> bool:
    """True if any material is frosted glass."""
    return bool(glass_surfaces(materials).is_frosted.any())


def glass_surfaces(materials: Sequence[Material]) -> GlassSurfaces:
    """Collect the glass parameters of materials."""
    glasses = [material.glass or Glass() for material in materials]
    return GlassSurfaces(
        np.array([material.glass is not None for material in materials]),
        np.array([glass.ior for glass in glasses]),
        np.array([glass.thickness > 0 for glass in glasses]),
        np.array([glass.tint for glass in glasses]),
        np.array([glass.absorbed for glass in glasses]),
        np.array([glass.roughness**2 if glass.roughness > MAX_CLEAR_ROUGHNESS else 0.0 for glass in glasses]),
    )


def refract(
    geometry: SceneBuffers,
    glass: GlassSurfaces,
    paths: RayPaths,
    hits: Hits,
    rows: Shaped[NDArray[np.intp], " k"],
    facets: Shaped[F64, "k 2"] | None = None,
) -> tuple[Shaped[NDArray[np.bool_], " k"], RayPaths]:
    """Continue the paths of rays that hit glass.

    Args:
        geometry: the triangles. glass: glass parameters of materials.
        paths: paths of the rays. hits: hits of all paths. rows: paths that hit glass.
        facets: two numbers in [0, 1) for each, which choose the facets of frosted glass; None: as if it were clear.
    Returns:
        True for hits on thin glass or the outside of a solid, and the continued paths.
    """
    glass_hits = hits.rows(rows)
    material, directions = geometry.face_material[glass_hits.face], paths.directions[rows].astype(np.float64)
    points = surface_at(geometry, glass_hits, paths.directions[rows]).points
    face_normal, normal = geometry.face_normals[glass_hits.face].astype(np.float64), points.normal.astype(np.float64)
    facing = np.einsum("nc,nc->n", face_normal, directions)
    is_solid = glass.is_solid[material]
    is_outer = (facing < 0) | ~is_solid
    alpha, macro_normal = glass.alpha[material] if facets is not None else np.zeros(len(rows)), normal
    if facets is not None and alpha.any():
        normal = np.where(alpha[:, None] > 0, visible_facets(normal, -directions, alpha, facets), normal)
    cos_theta_i = np.clip(-np.einsum("nc,nc->n", normal, directions), 0, 1)
    eta = np.where(is_outer, 1 / glass.ior[material], glass.ior[material])
    reflectance, cos_theta_t = dielectric(cos_theta_i, eta)
    is_total_reflection = reflectance >= 1
    inner_length = np.where(is_outer | ~is_solid, 0, glass_hits.distance).astype(np.float64)
    transmittance = np.where(is_total_reflection[:, None], 1, (1 - reflectance)[:, None] * glass.tint[material])
    transmittance *= np.exp(-inner_length[:, None] * glass.absorbed[material])
    refracted = eta[:, None] * directions + (eta * cos_theta_i - cos_theta_t)[:, None] * normal
    mirror_directions = directions + 2 * cos_theta_i[:, None] * normal
    mirrored = np.einsum("nc,nc->n", macro_normal, mirror_directions)
    through_pane = mirror_directions - 2 * mirrored[:, None] * macro_normal  # equals `directions` without facets
    new_directions = np.where(
        is_total_reflection[:, None], mirror_directions, np.where(is_solid[:, None], refracted, through_pane)
    )
    new_directions /= np.linalg.norm(new_directions, axis=1, keepdims=True)
    if alpha.any():
        side = np.einsum("nc,nc->n", macro_normal, new_directions) * np.where(is_total_reflection, 1, -1)
        transmittance *= np.where(alpha > 0, unshadowed_fraction(side, alpha), 1)[:, None]
    path_key = paths.path_key[rows]
    path_key = np.where(alpha > 0, path_key + ((1 + paths.ray[rows] % _MAX_RAYS_PER_PIXEL) << _KEY_BITS), path_key)
    toward = np.where(is_total_reflection, -1, 1)[:, None] * directions
    continued = RayPaths(
        paths.ray[rows],
        positions_on_faces(geometry, glass_hits.face, glass_hits.uv, toward),
        new_directions.astype(np.float32),
        (paths.transmittance[rows] * transmittance).astype(np.float32),
        paths.length[rows] + glass_hits.distance,
        paths.num_glass + 1,
        None if paths.chain is None else paths.chain.rows(rows),
        path_key,
        np.where((alpha > 0) & (paths.frost[rows] == 0), material + 1, paths.frost[rows]).astype(np.uint16),
    )
    is_scattered_back = (alpha > 0) & ~transmittance.any(axis=1)
    return is_outer, continued.rows(~is_scattered_back) if is_scattered_back.any() else continued


def visible_facets(
    normal: Shaped[F64, "n 3"], wo: Shaped[F64, "n 3"], alpha: Shaped[F64, " n"], facets: Shaped[F64, "n 2"]
) -> Shaped[F64, "n 3"]:
    """Sample the normals of GGX facets that are visible from a direction, by projected area (Heitz 2018).

    Args:
        normal, wo: normals and view directions, unit. alpha: width. facets: numbers in [0, 1).
    """
    tangent = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.7, [1.0, 0, 0], [0, 1.0, 0]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    width = np.stack([alpha, alpha, np.ones(len(alpha))], axis=1)
    view = width * np.einsum("nkc,nc->nk", frame, wo)
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    x, y, z = view.T
    length = np.maximum(np.hypot(x, y), 1e-12)
    across = np.where((np.hypot(x, y) > 1e-9)[:, None], np.stack([-y, x, 0 * x], axis=1) / length[:, None], [1.0, 0, 0])
    radius, angle = np.sqrt(facets[:, 0]), 2 * np.pi * facets[:, 1]
    p, q = radius * np.cos(angle), radius * np.sin(angle)
    q = (1 - (1 + z) / 2) * np.sqrt(np.maximum(1 - p**2, 0)) + (1 + z) / 2 * q
    up = np.sqrt(np.maximum(1 - p**2 - q**2, 0))
    half = p[:, None] * across + q[:, None] * np.cross(view, across) + up[:, None] * view
    half = np.stack([alpha * half[:, 0], alpha * half[:, 1], np.maximum(half[:, 2], 1e-9)], axis=1)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    return np.asarray(np.einsum("nk,nkc->nc", half, frame))


def unshadowed_fraction(cosine: Shaped[F64, " n"], alpha: Shaped[F64, " n"]) -> Shaped[F64, " n"]:
    """Fraction G₁ of GGX facets that a direction passes; zero below the surface.

    Args:
        cosine: of the direction and the normal on its side. alpha: width of the facets.
    """
    squared_tangent = np.maximum(1 / np.maximum(cosine, 1e-9) ** 2 - 1, 0)
    return np.where(cosine > 0, 2 / (1 + np.sqrt(1 + alpha**2 * squared_tangent)), 0.0)


def dielectric(cos_theta_i: Shaped[F64, " n"], eta: Shaped[F64, " n"]) -> tuple[Shaped[F64, " n"], Shaped[F64, " n"]]:
    """Fresnel reflectance, unpolarized, and the cosine of refraction; 1 and 0 under total internal reflection.

    Args:
        cos_theta_i: cos θi on the incident side. eta: index of refraction, incident over transmitted side.
    """
    cos_theta_t = np.sqrt(np.maximum(1 - eta**2 * (1 - cos_theta_i**2), 0))
    return fresnel(cos_theta_i, 1 / eta, 0.0), cos_theta_t
