"""Gather cells: the pieces of surfaces that reflected light is kept for (the gather samples of Nguyen 2010).

A cell is a leaf of the tree over importance photons, so that cells are small where the picture's gather rays go and
light is uneven. A few of its photons stand for its area (its sub-area samples): light that changes across a cell is
averaged over it, and no point of it lies where no ray arrives, such as on a floor below a box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.patches.patch_kdtree import MAX_PATCHES, PatchTree, grow_tree
from relume.patches.photon_density import shoot_photons
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent, rotation_between
from relume.scene.model import Scene

F32 = NDArray[np.float32]

POINTS_PER_PATCH = 4
_PHOTONS_PER_PATCH = 16
_TEXTURE_ANGLE = 0.02  # textures are read blurred, as cells blur them


@dataclass(frozen=True)
class Patches:
    """Cells in the order of their tree.

    Attributes:
        position: of the points that stand for a cell, off the surface. (C, `POINTS_PER_PATCH`, 3) float32
        normal: shading normals there. (C, `POINTS_PER_PATCH`, 3) float32
        diffuse, specular: texture channels, their means over the cell's points. (C, 3) float32
        material: index into the scene's materials. (C,) uint16
        uv: where points lie in textures, the side of what is read about them, and how textures are turned there, as
            `relume.raytrace.surface_interaction.SurfaceInteraction` has it. (C, `POINTS_PER_PATCH`, 5) float32
        surface_normal: normals there without bumps. (C, `POINTS_PER_PATCH`, 3) float32
    """

    tree: PatchTree
    position: F32
    normal: F32
    diffuse: F32
    specular: F32
    material: NDArray[np.uint16]
    uv: F32
    surface_normal: F32

    @property
    def num_patches(self) -> int:
        """Their number C."""
        return len(self.material)


def patch_sample_points(position: F32, normal: F32, first_patch: int = 0) -> SurfacePoints:
    """Make the points that stand for cells, where direct light arrives at them; any tangent does.

    Args:
        position, normal: as in `Patches`. (cells, `POINTS_PER_PATCH`, 3) float32
        first_patch: number of the first of these cells among all.
    """
    position, normal = position.reshape(-1, 3), normal.reshape(-1, 3)
    first_seed = POINTS_PER_PATCH * first_patch
    return SurfacePoints(
        position, normal, any_tangent(normal), np.arange(first_seed, first_seed + len(position), dtype=np.uint32)
    )


def choose_patches(
    scene: Scene, geometry: SceneBuffers, views: Sequence[str], size: tuple[int, int], num_patches: int
) -> Patches:
    """Place about `num_patches` cells where gather rays of these views go; nothing but the scene seeds it.

    Args:
        scene: what is seen. geometry: its triangles.
        views: names of the cameras. size: width and height of their pictures, pixels.
        num_patches: about so many; held to `MAX_PATCHES` less two for each mesh.
    """
    max_patches = min(num_patches, MAX_PATCHES - 2 * len(scene.meshes))
    photons = shoot_photons(scene, geometry, views, size, _PHOTONS_PER_PATCH * max_patches)
    hits, directions = photons.hits, photons.directions
    normal = geometry.face_normals[hits.face]
    is_back_face = np.einsum("nc,nc->n", normal, directions) > 0
    normal[is_back_face] *= -1
    position = surface_at(geometry, hits, directions).points.position
    side = 2 * geometry.face_mesh[hits.face] + is_back_face.astype(np.int32)
    tree, patch_rows = grow_tree(
        np.concatenate([position, normal], axis=1),
        photons.width * hits.distance,
        side.astype(np.int32),
        2 * len(scene.meshes),
        max_patches,
    )
    # a cell's photons are in order along the axis that divided it last: every so many are far apart
    fractions = (np.arange(POINTS_PER_PATCH) + 0.5) / POINTS_PER_PATCH
    point_rows = np.array(
        [photon_rows[(fractions * len(photon_rows)).astype(np.int64)] for photon_rows in patch_rows], np.int64
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
