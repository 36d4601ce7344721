"""What an eye sees in mirrors: surfaces whose own look has a highlight that is sharp enough send its rays on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.brdf.mirror import is_mirror
from relume.eye.ways import Chain, Ways
from relume.scene.model import Material
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits
from relume.trace.surface import surface_at

MOST_MIRRORS = 2  # that a ray is sent on by; what the last one reflects is as coarse as lobes are


def are_mirrors(materials: Sequence[Material]) -> NDArray[np.bool_]:
    """Tell which materials are mirrors by themselves. (materials,)"""
    return np.array([is_mirror(material.terms) for material in materials], np.bool_)


def sent_back(
    geometry: Geometry,
    materials: Sequence[Material],
    ways: Ways,
    hits: Hits,
    rows: NDArray[np.intp],
    pixel_angle: float,
    num_keys: int,
) -> Ways:
    """Send rays that met mirrors on.

    Args:
        geometry: the triangles. materials: of the scene.
        ways: of the rays. hits: what they met. rows: those that met mirrors. (k,)
        pixel_angle: that a ray stands for, radians. num_keys: more than the numbers of meshes.
    Returns:
        How they go on.
    """
    own, directions = hits.rows(rows), ways.directions[rows]
    length = ways.length[rows] + own.distance
    there = surface_at(geometry, replace(own, distance=length), directions, materials, pixel_angle)
    turned = _about(there.points.normal, directions)
    outwards = geometry.face_normals[own.face]
    outwards = outwards * -np.sign(np.einsum("nc,nc->n", outwards, directions))[:, None]
    is_inside = np.einsum("nc,nc->n", turned, outwards) <= 0  # by bumps, or where smooth normals turn from the triangle
    turned[is_inside] = _about(outwards[is_inside], directions[is_inside])
    cosine = np.clip(-np.einsum("nc,nc->n", there.points.normal, directions), 0, 1)
    last = Chain(
        geometry.face_material[own.face][:, None].astype(np.uint16),
        cosine[:, None].astype(np.float32),
        there.specular[:, None],
    )
    chain = last if ways.chain is None else ways.chain.rows(rows).then(last)
    via = ways.via[rows] * num_keys + geometry.face_mesh[own.face] + 1
    through, passed = ways.through[rows], ways.num_passed
    return Ways(ways.ray[rows], there.points.position, turned, through, length, passed, chain, via)


def _about(normal: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mirror directions by planes with these unit normals. (n, 3) each"""
    turned = directions - 2 * np.einsum("nc,nc->n", normal, directions)[:, None] * normal
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True), np.float32)
