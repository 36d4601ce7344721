"""Cameras, lights, receivers, gather cells and rays as a store keeps them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import TEXTURES
from relume.errors import SceneError, StoreError
from relume.light.tiles import Tiles
from relume.light.triangles import TriangleLights
from relume.scene.checks import check_camera
from relume.scene.model import Camera
from relume.trace.cell_tree import CellTree
from relume.trace.coherent import RayCounts
from relume.trace.gather_rays import Pattern, make_pattern
from relume.transfer.base import StoreReader
from relume.transfer.gathered import CellLight
from relume.transfer.receivers import GatherRays, Receivers

F32 = NDArray[np.float32]

SHARD_ROWS = 16_384


def read_camera(store: StoreReader, k: int) -> Camera:
    """The camera of the k-th view. Raises StoreError where there is no usable one."""
    try:
        found = store.attributes["views"][k]
        to_world = np.array(found["to_world"], np.float64).reshape(4, 4)
        camera = Camera(str(found["name"]), to_world, float(found["yfov"]))
        check_camera(camera)
    except (KeyError, TypeError, ValueError, SceneError) as error:
        raise StoreError(f"view {k} of the store has no camera ({error}); delete the bake, bake again") from error
    return camera


def read_lights(store: StoreReader) -> TriangleLights:
    """The light triangles of a store."""
    return TriangleLights(*(store.read(f"lights/{name}") for name in ("nodes", "direction", "power")))


def read_tiles(store: StoreReader) -> Tiles:
    """The tiles that its light triangles stand for. Raises StoreError where they do not tile the sphere."""
    tiles = Tiles(store.read("lights/tiles"))
    if not tiles.is_whole():
        raise StoreError("the light tiles of the store do not cover the sphere; bake the scene again")
    return tiles


def read_traced_directions(store: StoreReader) -> F32:
    """Where shadow rays went: light that may come to any part of a tile is asked for in its middle. (M, 3) float32"""
    if store.attributes["relightable"]:
        return read_tiles(store).centroids.astype(np.float32)
    return read_lights(store).direction


def read_tree(store: StoreReader) -> CellTree:
    """The tree over a store's gather cells."""
    return CellTree(*(store.read(f"cells/{name}") for name in CellTree._fields))


def read_cells(store: StoreReader) -> CellLight:
    """The gather cells of a store."""
    normal, visible = store.read("cells/normal"), store.read("cells/visibility")
    return CellLight(
        normal,
        visible.reshape(*normal.shape[:2], visible.shape[1] // normal.shape[1]),
        store.read("cells/links"),
        store.read("cells/material"),
        np.stack([store.read(f"cells/{texture}") for texture in TEXTURES]),
    )


def pattern_of_material(store: StoreReader, k: int, material: int) -> Pattern:
    """The gather rays of a material's samples in the k-th view."""
    num_cosine, num_glossy = store.attributes["gather_rays"][material]
    return make_pattern(num_cosine, num_glossy, int(store.attributes["gather_seed"]) + 1 + k)


def read_gather_rays(store: StoreReader, k: int, material: int, start: int, stop: int, radiance: F32) -> GatherRays:
    """Rays of samples [start, stop) of the k-th view, all of one material. radiance: of cells"""
    links = store.read(f"views/{k}/links", start, stop)
    numbers = store.read(f"views/{k}/number", start, stop)
    return GatherRays(links, pattern_of_material(store, k, material), numbers, radiance)


def read_rays(store: StoreReader) -> RayCounts:
    """Shadow rays of the whole bake: traced, saved, and how often a prediction was found wrong."""
    counts = [
        store.read(f"views/{k}/rays/{shard}")
        for k in range(len(store.attributes["views"]))
        for shard in range(-(-store.shape(f"views/{k}/visibility")[0] // SHARD_ROWS))
    ]
    return RayCounts(*(int(count) for count in np.sum(counts, axis=0))) if counts else RayCounts(0, 0, 0, 0)


def read_receivers(store: StoreReader, k: int, start: int, stop: int, visible: NDArray[np.uint8]) -> Receivers:
    """Samples [start, stop) of the k-th view as points that light arrives at."""
    eye = read_camera(store, k).to_world[:3, 3].astype(np.float32)
    position = store.read(f"views/{k}/position", start, stop)
    towards = eye - position
    return Receivers(
        store.read(f"views/{k}/normal", start, stop),
        store.read(f"views/{k}/tangent", start, stop),
        (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32),
        visible,
    )
