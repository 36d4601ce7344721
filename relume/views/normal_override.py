"""Normals of a bake where an image says how they lean: what a bake finds whose scene has the image as its map.

Bakes say where points lie in textures and how these are turned there. So the image is looked up, as wide as a pixel,
and leans the surface's own normal in the frame of its texture; docs/direct-light.md#textures-and-maps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.texture_slots import NormalMap
from relume.core.errors import StoreError
from relume.images.image_store import load_normal_map
from relume.raytrace.shading_normals import flip_to_viewer, mapped_normal, visible_length
from relume.raytrace.tangents import project_to_tangent, rotation_between
from relume.raytrace.texture import MipMap, sample_image
from relume.views.store_io import read_ray_origins, read_surface_normal, read_uv, view_directions
from relume.views.view import View

F32 = NDArray[np.float32]


class PerturbedNormals(NamedTuple):
    """Samples of a material under other bumps.

    Attributes:
        normal, tangent, uv, normal_length: as in `relume.raytrace.surface_interaction.SurfaceInteraction`.
        baked_normal: the normals that were baked. (n, 3) float32
    """

    normal: F32
    tangent: F32
    uv: F32
    normal_length: F32
    baked_normal: F32

    def rows(self, rows: NDArray[np.integer]) -> PerturbedNormals:
        """Choose some of them."""
        return PerturbedNormals(*(column[rows] for column in self))


def perturbed(view: View, material: int, map_: NormalMap) -> PerturbedNormals:
    """Lean the normals of a material's samples, in the order that they were baked in.

    Args:
        view: as it was baked. material: index of the material. map_: the image.
    Raises:
        StoreError: the store does not say where samples lie in textures, or what their normals are without bumps.
        NotFoundError, SceneError: the image cannot be had.
    """
    rows = view.rows(material)
    sample_range = view.store, view.index, rows.start, rows.stop
    uv, smooth = read_uv(*sample_range), read_surface_normal(*sample_range, material)
    if uv is None or smooth is None:
        raise StoreError("this bake is too old to show images of normals here; bake the scene again")
    normal, tangent, position = (
        view.store.read(f"views/{view.index}/{name}", rows.start, rows.stop)
        for name in ("normal", "tangent", "position")
    )
    return perturb_normals(
        map_, uv, smooth, normal, tangent, view_directions(read_ray_origins(*sample_range), position)
    )


def perturb_normals(map_: NormalMap, uv: F32, smooth: F32, normal: F32, tangent: F32, wo: F32) -> PerturbedNormals:
    """Lean the normals of points on surfaces.

    Args:
        map_: the image. uv: places in it, see `relume.raytrace.surface_interaction.SurfaceInteraction`. (n, 5) float32
        smooth: normals of the surface without bumps. (n, 3) normal, tangent: as they were. (n, 3) each
        wo: whence the points are seen, and normals must not lean away. (n, 3)
    Raises:
        NotFoundError, SceneError: the image cannot be had.
    """
    angle = uv[:, 3:4]
    texture_axis = np.asarray(np.cos(angle) * tangent + np.sin(angle) * np.cross(normal, tangent), np.float32)
    texture_axis = unproject(texture_axis, normal, smooth)
    texture = load_normal_map(map_)
    mapped = sample_image(texture, uv)
    new_normal = mapped_normal(mapped, smooth, np.column_stack([texture_axis, uv[:, 4]]), smooth)
    new_normal = flip_to_viewer(new_normal, -wo)
    new_tangent = project_to_tangent(unproject(tangent, normal, smooth), new_normal)
    new_uv = uv.copy()
    new_uv[:, 3] = rotation_between(new_normal, new_tangent, texture_axis)
    length = visible_length(mapped, MipMap.for_texture(texture).texels(uv[:, 2]))
    return PerturbedNormals(new_normal, new_tangent, new_uv, length, np.asarray(normal, np.float32))


def unproject(vector: F32, normal: F32, smooth: F32) -> F32:
    """Find what was projected across bumps: the vector across the surface that differs from it along these alone.

    Args:
        vector: across normals. (n, 3) normal: leant, unit. (n, 3) smooth: of the surface, unit. (n, 3)
    """
    cosine = _dot(normal, smooth)
    safe_cosine = np.where(np.abs(cosine) < _MIN_FACING, _MIN_FACING, cosine)
    return np.asarray(vector - (_dot(vector, smooth) / safe_cosine)[:, None] * normal, np.float32)


_MIN_FACING = np.float32(1e-3)


def _dot(a: F32, b: F32) -> F32:
    return np.asarray(np.einsum("nc,nc->n", a, b), np.float32)
