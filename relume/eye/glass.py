"""What an eye sees through glass: its rays go on behind it, straight through panes, bent by solids, tinted by both.

Light's rays are not bent: `relume.trace.cutout_filter` lets their share pass. Behind each surface of glass that an
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
from relume.eye.ways import Ways
from relume.scene.model import Glass, Material
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_GLASS = 8  # surfaces that a ray meets; two are a pane, four a bottle
MOST_SHOWN = 2  # of glass, one behind the other, that are seen themselves: each costs a sample of every pixel


class Panes(NamedTuple):
    """The glass of every material, whether it is of glass or not. (materials,) and (materials, 3)"""

    is_glass: NDArray[np.bool_]
    ior: F64
    is_solid: NDArray[np.bool_]
    tint: F64
    absorbed: F64


def has_glass(materials: Sequence[Material]) -> bool:
    """Tell whether any material is of glass."""
    return any(material.glass is not None for material in materials)


def panes_of(materials: Sequence[Material]) -> Panes:
    """Read the glass of materials."""
    glasses = [material.glass or Glass() for material in materials]
    return Panes(
        np.array([material.glass is not None for material in materials]),
        np.array([glass.ior for glass in glasses]),
        np.array([glass.thickness > 0 for glass in glasses]),
        np.array([glass.tint for glass in glasses]),
        np.array([glass.absorbed for glass in glasses]),
    )


def through_glass(
    geometry: Geometry, panes: Panes, ways: Ways, hits: Hits, rows: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], Ways]:
    """Send rays that met glass on.

    Args:
        geometry: the triangles. panes: the glass of materials.
        ways: of the rays. hits: what they met. rows: those that met glass. (k,)
    Returns:
        Whether each met the outer side of a solid, or a pane, (k,), and how they go on.
    """
    own = hits.rows(rows)
    material, directions = geometry.face_material[own.face], ways.directions[rows].astype(np.float64)
    points = surface_at(geometry, own, ways.directions[rows]).points  # moved off to the side that is seen
    outwards, normal = geometry.face_normals[own.face].astype(np.float64), points.normal.astype(np.float64)
    along = np.einsum("nc,nc->n", outwards, directions)
    is_solid = panes.is_solid[material]
    is_outer = (along < 0) | ~is_solid
    cos_theta_i = np.clip(-np.einsum("nc,nc->n", normal, directions), 0, 1)
    eta = np.where(is_outer, 1 / panes.ior[material], panes.ior[material])
    reflected, cos_theta_t = dielectric(cos_theta_i, eta)
    is_kept_in = reflected >= 1
    inside = np.where(is_outer | ~is_solid, 0, own.distance).astype(np.float64)
    dimmed = np.where(is_kept_in[:, None], 1, (1 - reflected)[:, None] * panes.tint[material])
    dimmed *= np.exp(-inside[:, None] * panes.absorbed[material])
    bent = eta[:, None] * directions + (eta * cos_theta_i - cos_theta_t)[:, None] * normal
    mirrored = directions + 2 * cos_theta_i[:, None] * normal
    turned = np.where(is_kept_in[:, None], mirrored, np.where(is_solid[:, None], bent, directions))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    beyond = np.where(is_kept_in, 0, 2 * geometry.epsilon * np.sign(along))[:, None] * outwards
    return is_outer, Ways(
        ways.ray[rows],
        (points.position + beyond).astype(np.float32),
        turned.astype(np.float32),
        (ways.through[rows] * dimmed).astype(np.float32),
        ways.length[rows] + own.distance,
        ways.num_passed + 1,
        None if ways.chain is None else ways.chain.rows(rows),
        ways.via[rows],
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
