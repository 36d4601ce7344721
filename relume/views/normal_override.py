"""Normals of a bake with an overridden normal map, as if baked with that map.

Bakes store texture coordinates and the orientation of textures at each sample. So the map is filtered over the pixel,
and perturbs the surface's own normal in its texture frame; docs/direct-light.md#textures-and-maps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import NormalMap
from relume.core.errors import StoreError
from relume.images.image_store import load_normal_map
from relume.raytrace.shading_normals import flip_to_viewer, mapped_normal, mean_normal
from relume.raytrace.tangents import project_to_tangent, rotation_between
from relume.raytrace.texture import footprint_sides
from relume.views.store_io import read_ray_origins, read_surface_normal, read_uv, view_directions
from relume.views.view import View

F32 = NDArray[np.float32]


class PerturbedNormals(NamedTuple):
    """Samples of a material with an overridden normal map.

    Attributes:
        normal, tangent, uv, normal_length: as in `relume.raytrace.surface_interaction.SurfaceInteraction`.
        baked_normal: normals before the override.
    """

    normal: Shaped[F32, "n 3"]
    tangent: Shaped[F32, "n 3"]
    uv: Shaped[F32, "n uv"]
    normal_length: Shaped[F32, " n"]
    baked_normal: Shaped[F32, "n 3"]

    def rows(self, rows: NDArray[np.integer]) -> PerturbedNormals:
        """Select samples."""
        return PerturbedNormals(*(column[rows] for column in self))


def perturbed(view: View, material: int, map_: NormalMap) -> PerturbedNormals:
    """Perturb the normals of a material's samples, in baked order.

    Args:
        view: the baked view. material: index of the material. map_: the image.
    Raises:
        StoreError: the store has no texture coordinates, or no normals without normal mapping.
        NotFoundError, SceneError: the image cannot be loaded.
    """
    rows = view.rows(material)
    sample_range = view.store, view.index, rows.start, rows.stop
    uv, smooth = read_uv(*sample_range), read_surface_normal(*sample_range, material)
    if uv is None or smooth is None:
        raise StoreError("this bake is too old for normal map overrides here; bake the scene again")
    normal, tangent, position = (
        view.store.read(f"views/{view.index}/{name}", rows.start, rows.stop)
        for name in ("normal", "tangent", "position")
    )
    return perturb_normals(
        map_, uv, smooth, normal, tangent, view_directions(read_ray_origins(*sample_range), position)
    )


def perturb_normals(
    map_: NormalMap,
    uv: Shaped[F32, "n uv"],
    smooth: Shaped[F32, "n 3"],
    normal: Shaped[F32, "n 3"],
    tangent: Shaped[F32, "n 3"],
    wo: Shaped[F32, "n 3"],
) -> PerturbedNormals:
    """Perturb the normals of points on surfaces.

    Args:
        map_: the image. uv: texture coordinates, see `relume.raytrace.surface_interaction.SurfaceInteraction`.
        smooth: normals without normal mapping. normal, tangent: normals and tangents before the override.
        wo: toward the viewer; the new normals face it.
    Raises:
        NotFoundError, SceneError: the image cannot be loaded.
    """
    angle = uv[:, 3:4]
    texture_axis = np.asarray(np.cos(angle) * tangent + np.sin(angle) * np.cross(normal, tangent), np.float32)
    texture_axis = unproject(texture_axis, normal, smooth)
    lookups = uv if map_.uv is None else map_.uv.footprints(uv)
    mapped, length = mean_normal(load_normal_map(map_), lookups[:, :2], footprint_sides(lookups))
    if map_.uv is not None:
        mapped = map_.uv.normals(mapped)
    new_normal = mapped_normal(mapped, smooth, np.column_stack([texture_axis, uv[:, 4]]), smooth)
    new_normal = flip_to_viewer(new_normal, -wo)
    new_tangent = project_to_tangent(unproject(tangent, normal, smooth), new_normal)
    new_uv = uv.copy()
    new_uv[:, 3] = rotation_between(new_normal, new_tangent, texture_axis)
    return PerturbedNormals(new_normal, new_tangent, new_uv, length, np.asarray(normal, np.float32))


def unproject(vector: Shaped[F32, "n 3"], normal: Shaped[F32, "n 3"], smooth: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Invert a projection to mapped tangent planes: move vectors along `normal` into the planes orthogonal to `smooth`.

    Args:
        vector: orthogonal to `normal`. normal: mapped, unit. smooth: normal without normal mapping, unit.
    """
    cosine = _dot(normal, smooth)
    safe_cosine = np.where(np.abs(cosine) < _MIN_FACING, _MIN_FACING, cosine)
    return np.asarray(vector - (_dot(vector, smooth) / safe_cosine)[:, None] * normal, np.float32)


_MIN_FACING = np.float32(1e-3)


def _dot(a: F32, b: F32) -> F32:
    return np.asarray(np.einsum("nc,nc->n", a, b), np.float32)
