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

from relume.points import Points
from relume.scene.model import Scene
from relume.trace.cell_tree import MAX_CELLS, CellTree, grow_tree
from relume.trace.geometry import Geometry
from relume.trace.photons import shoot_photons
from relume.trace.surface import surface_at
from relume.trace.tangents import any_tangent, turn_between

F32 = NDArray[np.float32]

POINTS_A_CELL = 4
_PHOTONS_A_CELL = 16
_TEXTURE_ANGLE = 0.02  # textures are read blurred, as cells blur them


@dataclass(frozen=True)
class Cells:
    """Cells in the order of their tree.

    Attributes:
        position: of the points that stand for a cell, off the surface. (C, `POINTS_A_CELL`, 3) float32
        normal: shading normals there. (C, `POINTS_A_CELL`, 3) float32
        diffuse, specular: texture channels, their means over the cell's points. (C, 3) float32
        material: index into the scene's materials. (C,) uint16
        uv: where points lie in textures, the side of what is read about them, and how textures are turned there, as
            `relume.trace.surface.Surface` has it. (C, `POINTS_A_CELL`, 5) float32
        surface_normal: normals there without bumps. (C, `POINTS_A_CELL`, 3) float32
    """

    tree: CellTree
    position: F32
    normal: F32
    diffuse: F32
    specular: F32
    material: NDArray[np.uint16]
    uv: F32
    surface_normal: F32

    @property
    def num_cells(self) -> int:
        """Their number C."""
        return len(self.material)

    @property
    def gather_samples(self) -> Points:
        """The points that stand for all cells, those of a cell one after another."""
        return gather_samples_of(self.position, self.normal)


def gather_samples_of(position: F32, normal: F32, first_cell: int = 0) -> Points:
    """Make the points that stand for cells, where direct light arrives at them; any tangent does.

    Args:
        position, normal: as in `Cells`. (cells, `POINTS_A_CELL`, 3) float32
        first_cell: number of the first of these cells among all.
    """
    position, normal = position.reshape(-1, 3), normal.reshape(-1, 3)
    first = POINTS_A_CELL * first_cell
    return Points(position, normal, any_tangent(normal), np.arange(first, first + len(position), dtype=np.uint32))


def choose_cells(
    scene: Scene, geometry: Geometry, views: Sequence[str], size: tuple[int, int], num_cells: int
) -> Cells:
    """Place about `num_cells` cells where gather rays of these views go; nothing but the scene seeds it.

    Args:
        scene: what is seen. geometry: its triangles.
        views: names of the cameras. size: width and height of their pictures, pixels.
        num_cells: about so many; held to `MAX_CELLS` less two for each mesh.
    """
    most = min(num_cells, MAX_CELLS - 2 * len(scene.meshes))
    photons = shoot_photons(scene, geometry, views, size, _PHOTONS_A_CELL * most)
    hits, directions = photons.hits, photons.directions
    normal = geometry.face_normals[hits.face]
    is_behind = np.einsum("nc,nc->n", normal, directions) > 0
    normal[is_behind] *= -1
    place = surface_at(geometry, hits, directions).points.position
    side = 2 * geometry.face_mesh[hits.face] + is_behind.astype(np.int32)
    tree, members = grow_tree(
        np.concatenate([place, normal], axis=1),
        photons.width * hits.distance,
        side.astype(np.int32),
        2 * len(scene.meshes),
        most,
    )
    # a cell's photons are in order along the axis that divided it last: every so many are far apart
    evenly = (np.arange(POINTS_A_CELL) + 0.5) / POINTS_A_CELL
    chosen = np.array([rows[(evenly * len(rows)).astype(np.int64)] for rows in members], np.int64).reshape(-1)
    some = hits.rows(chosen)
    surface = surface_at(geometry, some, directions[chosen], scene.materials, _TEXTURE_ANGLE)
    points, shape = surface.points, (len(members), POINTS_A_CELL, 3)
    uv = surface.uv.copy()
    uv[:, 3] += turn_between(points.normal, any_tangent(points.normal), points.tangent)
    return Cells(
        tree,
        points.position.reshape(shape),
        points.normal.reshape(shape),
        surface.diffuse.reshape(shape).mean(axis=1),
        surface.specular.reshape(shape).mean(axis=1),
        geometry.face_material[some.face].reshape(shape[:2])[:, 0].astype(np.uint16),
        uv.reshape(*shape[:2], uv.shape[1]),
        surface.surface_normal.reshape(shape),
    )
