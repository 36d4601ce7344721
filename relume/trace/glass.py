"""What an eye sees through glass: its rays go on behind it, straight through panes, bent by solids, tinted by both.

Light's rays are not bent: `relume.trace.cutout_filter` lets their share pass. Here a ray leaves a layer at each surface
that it meets; those of glass reflect as any surface does, and behind them the ray is dimmed by what they let through,

    T = (1 - F) tint,  inside of solids also e^(-absorbed s)  along s metres,

with F of a dielectric's rim. Where nothing passes, inside of a solid, the ray is reflected instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import fresnel
from relume.scene.model import Glass, Material
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, trace_from
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_LAYERS = 8  # surfaces that a ray meets; two are a pane, four a bottle
MOST_SHOWN = 2  # of glass, one behind the other, that are seen themselves: each costs a sample of every pixel


class Layer(NamedTuple):
    """What some of an eye's rays meet after as many surfaces of glass.

    Attributes:
        ray: which of the rays they are, ascending. (m,) int64
        hits: what they meet; distances are along the whole way.
        directions: of the rays there, unit. (m, 3) float32
        through: share of what is sent there that comes to the eye. (m, 3) float32
        is_shown: whether there is something to be seen, and not just a way on. (m,)
    """

    ray: NDArray[np.int64]
    hits: Hits
    directions: F32
    through: F32
    is_shown: NDArray[np.bool_]


class _Ways(NamedTuple):
    """Rays behind glass, before it is known what they meet: where they begin, (m, 3), after which length, (m,)."""

    ray: NDArray[np.int64]
    origins: F32
    directions: F32
    through: F32
    length: F32


class _Panes(NamedTuple):
    """The glass of every material, whether it is of glass or not. (materials,) and (materials, 3)"""

    is_glass: NDArray[np.bool_]
    ior: F64
    is_solid: NDArray[np.bool_]
    tint: F64
    absorbed: F64


def has_glass(materials: Sequence[Material]) -> bool:
    """Tell whether any material is of glass."""
    return any(material.glass is not None for material in materials)


def layers_of(
    geometry: Geometry, materials: Sequence[Material], eye: F32, directions: F32, chance: F32 | np.float32
) -> list[Layer]:
    """Follow an eye's rays through glass.

    Args:
        geometry: the triangles. materials: of the scene. eye: (3,) float32
        directions: unit. (n, 3) float32. chance: of `trace_from`.
    Returns:
        All rays first; then, layer by layer, those that glass was before.
    """
    num, panes = len(directions), _panes(materials)
    chances, layers = np.broadcast_to(chance, num), list[Layer]()
    white, begun = np.ones((num, 3), np.float32), np.zeros(num, np.float32)
    ways = _Ways(np.arange(num), np.broadcast_to(eye, (1, 3)), directions, white, begun)
    while len(layers) < MAX_LAYERS and len(ways.ray):
        hits = trace_from(geometry.embree, ways.origins, ways.directions, chances[ways.ray])
        material = geometry.face_material[np.maximum(hits.face, 0)]
        is_glass = (hits.face >= 0) & panes.is_glass[material]
        is_outer, behind = _behind(geometry, panes, ways, hits, np.flatnonzero(is_glass))
        is_shown = ~is_glass
        is_shown[is_glass] = is_outer & (len(layers) < MOST_SHOWN)
        whole = replace(hits, distance=hits.distance + ways.length)
        layers.append(Layer(ways.ray, whole, ways.directions, ways.through, is_shown))
        ways = behind
    return layers


def _panes(materials: Sequence[Material]) -> _Panes:
    glasses = [material.glass or Glass() for material in materials]
    return _Panes(
        np.array([material.glass is not None for material in materials]),
        np.array([glass.ior for glass in glasses]),
        np.array([glass.thickness > 0 for glass in glasses]),
        np.array([glass.tint for glass in glasses]),
        np.array([glass.absorbed for glass in glasses]),
    )


def _behind(
    geometry: Geometry, panes: _Panes, ways: _Ways, hits: Hits, rows: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], _Ways]:
    """Send rays that met glass on.

    Args:
        panes: the glass of materials. ways: of the rays. hits: what they met. rows: those that met glass. (k,)
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
    return is_outer, _Ways(
        ways.ray[rows],
        (points.position + beyond).astype(np.float32),
        turned.astype(np.float32),
        (ways.through[rows] * dimmed).astype(np.float32),
        ways.length[rows] + own.distance,
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
