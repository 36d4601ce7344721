"""Rays of a baked store, traced for normals that it did not know; shared by all pictures of the bake."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.errors import ChunkDamagedError, StoreError
from relume.eye.flat_mirrors import lights_in_mirrors
from relume.light.gather_rays import Pattern
from relume.methods.local_lights import LocalLights
from relume.methods.store_io import read_traced_directions, read_tree
from relume.methods.thrown import Thrown
from relume.points import Points
from relume.trace.cell_tree import CellTree
from relume.trace.geometry import Geometry, off_surface
from relume.trace.links import trace_links
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]

_POINTS_AT_ONCE = 4096


class Retracing:
    """The triangles of a store, and where its rays go; a `relume.views.worn_store.Tracer`.

    Args:
        local: with the triangles' search tree. thrown: what flat mirrors send exactly, where they do.
    """

    def __init__(self, store: StoreReader, local: LocalLights, thrown: Thrown | None) -> None:
        self._store, self._local, self._thrown = store, local, thrown

    def check(self) -> None:
        """Raises StoreError where the store does not say what is needed to trace its rays."""
        if "gather_rays" in self._store.attributes:
            _ = self._geometry

    def seen(self, points: Points, before: F32, known: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Find which lights points see: those that come up are traced, those that go down are hidden.

        Args:
            points: as they lean now. before: their normals when the bake was traced. (n, 3) float32
            known: what it found. (n, bytes) uint8
        Returns:
            (n, bytes) uint8
        """
        directions = read_traced_directions(self._store)
        found = trace_visibility(
            self._local.embree, points.position, points.normal, directions, points.chance, before
        ).visible
        for start in range(0, len(found), _POINTS_AT_ONCE):
            some = slice(start, start + _POINTS_AT_ONCE)
            above = np.packbits(points.normal[some] @ directions.T > 0, axis=1, bitorder="little")
            found[some] |= known[some] & above
        return found

    def linked(self, points: Points, wo: F32, pattern: Pattern) -> NDArray[np.uint16]:
        """Find the cells that gather rays of points hit.

        Args:
            points: as they lean now. wo: towards the viewer. (n, 3) float32. pattern: of the rays.
        Returns:
            (n, rays) uint16
        """
        return trace_links(self._geometry, self._tree, points, wo, pattern).cell

    def thrown(self, points: Points) -> NDArray[np.uint8]:
        """Find which lights points see in flat mirrors. points: as they lean now. Returns (n, bytes) uint8"""
        assert self._thrown is not None  # who asks has read them from the store
        return lights_in_mirrors(self._geometry, self._thrown.mirrors, points, self._thrown.direction).visible

    @cached_property
    def _tree(self) -> CellTree:
        return read_tree(self._store)

    @cached_property
    def _geometry(self) -> Geometry:
        """What of a scene's triangles rays between surfaces ask for: no normals, no textures."""
        store, positions, faces = self._store, self._local.positions, self._local.faces
        try:
            mesh, material = (store.read(f"scene/{name}") for name in ("face_mesh", "face_material"))
        except ChunkDamagedError:
            raise
        except StoreError:
            raise StoreError("this bake is too old to show images of normals; bake the scene again") from None
        nothing = np.empty((0, 3), np.float32)
        return Geometry(
            positions, nothing, nothing, nothing, faces, material, mesh, self._local.embree, off_surface(positions)
        )
