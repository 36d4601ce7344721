"""Normals of a bake where an image says how they lean: what a bake finds whose scene has the image as its map.

Bakes say where points lie in textures and how these are turned there. So the image is looked up, as wide as a pixel,
and leans the surface's own normal in the frame of its texture; docs/adr/0107-images-of-normals.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import NormalMap
from relume.errors import StoreError
from relume.images.shelf import normals_of
from relume.trace.leaning import covered_length, mapped_normal, towards_viewer
from relume.trace.tangents import across, turn_between
from relume.trace.texture import MipMap, sample_image
from relume.views.store_io import read_eyes, read_surface_normal, read_uv, towards
from relume.views.view import View

F32 = NDArray[np.float32]


class Leant(NamedTuple):
    """Samples of a material under other bumps.

    Attributes:
        normal, tangent, uv, normal_length: as in `relume.trace.surface.Surface`.
        before: the normals that were baked. (n, 3) float32
    """

    normal: F32
    tangent: F32
    uv: F32
    normal_length: F32
    before: F32

    def rows(self, chosen: NDArray[np.integer]) -> Leant:
        """Choose some of them."""
        return Leant(*(each[chosen] for each in self))


def leant(view: View, material: int, map_: NormalMap) -> Leant:
    """Lean the normals of a material's samples, in the order that they were baked in.

    Args:
        view: as it was baked. material: index of the material. map_: the image.
    Raises:
        StoreError: the store does not say where samples lie in textures, or what their normals are without bumps.
        NotFoundError, SceneError: the image cannot be had.
    """
    rows = view.rows(material)
    where = view.store, view.index, rows.start, rows.stop
    uv, smooth = read_uv(*where), read_surface_normal(*where, material)
    if uv is None or smooth is None:
        raise StoreError("this bake is too old to show images of normals here; bake the scene again")
    normal, tangent, position = (
        view.store.read(f"views/{view.index}/{name}", rows.start, rows.stop)
        for name in ("normal", "tangent", "position")
    )
    return lean(map_, uv, smooth, normal, tangent, towards(read_eyes(*where), position))


def lean(map_: NormalMap, uv: F32, smooth: F32, normal: F32, tangent: F32, wo: F32) -> Leant:
    """Lean the normals of points on surfaces.

    Args:
        map_: the image. uv: places in it, see `relume.trace.surface.Surface`. (n, 5) float32
        smooth: normals of the surface without bumps. (n, 3) normal, tangent: as they were. (n, 3) each
        wo: whence the points are seen, and normals must not lean away. (n, 3)
    Raises:
        NotFoundError, SceneError: the image cannot be had.
    """
    turn = uv[:, 3:4]
    along = np.asarray(np.cos(turn) * tangent + np.sin(turn) * np.cross(normal, tangent), np.float32)
    along = on_surface(along, normal, smooth)
    texture = normals_of(map_)
    mapped = sample_image(texture, uv)
    found = mapped_normal(mapped, smooth, np.column_stack([along, uv[:, 4]]), smooth)
    found = towards_viewer(found, -wo)
    turned = across(on_surface(tangent, normal, smooth), found)
    placed = uv.copy()
    placed[:, 3] = turn_between(found, turned, along)
    length = covered_length(mapped, MipMap.of(texture).texels(uv[:, 2]))
    return Leant(found, turned, placed, length, np.asarray(normal, np.float32))


def on_surface(vector: F32, normal: F32, smooth: F32) -> F32:
    """Find what was projected across bumps: the vector across the surface that differs from it along these alone.

    Args:
        vector: across normals. (n, 3) normal: leant, unit. (n, 3) smooth: of the surface, unit. (n, 3)
    """
    along = _dot(normal, smooth)
    facing = np.where(np.abs(along) < _LEAST_FACING, _LEAST_FACING, along)
    return np.asarray(vector - (_dot(vector, smooth) / facing)[:, None] * normal, np.float32)


_LEAST_FACING = np.float32(1e-3)


def _dot(a: F32, b: F32) -> F32:
    return np.asarray(np.einsum("nc,nc->n", a, b), np.float32)
