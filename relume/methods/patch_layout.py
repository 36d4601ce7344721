"""Patches in the layout of a store."""

from __future__ import annotations

from relume.patches.patch_kdtree import PatchTree
from relume.patches.patches import patch_sample_points
from relume.raytrace.surface_points import SurfacePoints
from relume.store.bake_protocol import StoreReader


def read_tree(store: StoreReader) -> PatchTree:
    """Read the kd-tree over a store's patches."""
    return PatchTree(*(store.read(f"patches/{name}") for name in PatchTree._fields))


def read_patch_points(store: StoreReader, start: int = 0, stop: int | None = None) -> SurfacePoints:
    """Read the sample points of patches [start, stop) of a store, patch by patch."""
    position, normal = (store.read(f"patches/{name}", start, stop) for name in ("position", "normal"))
    return patch_sample_points(position, normal, start)
