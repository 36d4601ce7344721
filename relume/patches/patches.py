"""Surface patches, between which indirect light is solved (the gather samples of Nguyen 2010).

A patch is a leaf of the tree over importons, so that patches are small where gather rays of the images arrive and
light varies. A few of its importons are its sample points (sub-area samples): light that varies over a patch is
averaged, and no point lies where no ray arrives, such as on a floor below a box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.patches.importons import trace_importons
from relume.patches.patch_kdtree import MAX_PATCHES, PatchTree, grow_tree
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent, rotation_between
from relume.scene.model import Scene

F32 = NDArray[np.float32]

POINTS_PER_PATCH = 4
_IMPORTONS_PER_PATCH = 16
_TEXTURE_ANGLE = 0.02  # filter width of textures, comparable to that of patches


@dataclass(frozen=True)
class Patches:
    """Patches in the order of their tree.

    Attributes:
        position: positions of the sample points, offset from the surface. normal: shading normals there.
        diffuse, specular: texture channels, averaged over the points.
        material: index into the scene's materials.
        uv: coordinates, filter width and texture rotation, as in
            `relume.raytrace.surface_interaction.SurfaceInteraction`.
        surface_normal: normals without normal mapping.
    """

    tree: PatchTree
    position: Shaped[F32, "patches points 3"]
    normal: Shaped[F32, "patches points 3"]
    diffuse: Shaped[F32, "patches 3"]
    specular: Shaped[F32, "patches 3"]
    material: Shaped[NDArray[np.uint16], " patches"]
    uv: Shaped[F32, "patches points uv"]
    surface_normal: Shaped[F32, "patches points 3"]

    @property
    def num_patches(self) -> int:
        """Number of patches."""
        return len(self.material)


def patch_sample_points(
    position: Shaped[F32, "patches points 3"], normal: Shaped[F32, "patches points 3"], first_patch: int = 0
) -> SurfacePoints:
    """Create the sample points of patches, with arbitrary tangents.

    Args:
        position, normal: as in `Patches`. first_patch: index of the first of these patches.
    """
    position, normal = position.reshape(-1, 3), normal.reshape(-1, 3)
    first_seed = POINTS_PER_PATCH * first_patch
    return SurfacePoints(
        position, normal, any_tangent(normal), np.arange(first_seed, first_seed + len(position), dtype=np.uint32)
    )


def choose_patches(
    scene: Scene, geometry: SceneBuffers, views: Sequence[str], size: tuple[int, int], num_patches: int
) -> Patches:
    """Create about `num_patches` patches where gather rays of the views arrive; seeded by the scene alone.

    Args:
        scene: scene of the views. geometry: its triangles.
        views: names of the cameras. size: width and height of their images, pixels.
        num_patches: clamped to `MAX_PATCHES` less two for each mesh.
    """
    max_patches = min(num_patches, MAX_PATCHES - 2 * len(scene.meshes))
    importons = trace_importons(scene, geometry, views, size, _IMPORTONS_PER_PATCH * max_patches)
    hits, directions = importons.hits, importons.directions
    normal = geometry.face_normals[hits.face]
    is_back_face = np.einsum("nc,nc->n", normal, directions) > 0
    normal[is_back_face] *= -1
    position = surface_at(geometry, hits, directions).points.position
    side = 2 * geometry.face_mesh[hits.face] + is_back_face.astype(np.int32)
    tree, patch_rows = grow_tree(
        np.concatenate([position, normal], axis=1),
        importons.width * hits.distance,
        side.astype(np.int32),
        2 * len(scene.meshes),
        max_patches,
    )
    # a patch's importons are sorted along the last split axis: an even stride spreads the points
    fractions = (np.arange(POINTS_PER_PATCH) + 0.5) / POINTS_PER_PATCH
    point_rows = np.array(
        [importon_rows[(fractions * len(importon_rows)).astype(np.int64)] for importon_rows in patch_rows], np.int64
    ).reshape(-1)
    point_hits = hits.rows(point_rows)
    surface = surface_at(geometry, point_hits, directions[point_rows], scene.materials, _TEXTURE_ANGLE)
    points, shape = surface.points, (len(patch_rows), POINTS_PER_PATCH, 3)
    uv = surface.uv.copy()
    uv[:, 3] += rotation_between(points.normal, any_tangent(points.normal), points.tangent)
    return Patches(
        tree,
        points.position.reshape(shape),
        points.normal.reshape(shape),
        surface.diffuse.reshape(shape).mean(axis=1),
        surface.specular.reshape(shape).mean(axis=1),
        geometry.face_material[point_hits.face].reshape(shape[:2])[:, 0].astype(np.uint16),
        uv.reshape(*shape[:2], uv.shape[1]),
        surface.surface_normal.reshape(shape),
    )
