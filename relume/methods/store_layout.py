"""Lights, alpha masks and ray counts in the layout of a store."""

from __future__ import annotations

import hashlib
import math

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError, StoreError
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.raytrace.alpha_filter import AlphaTest
from relume.raytrace.alpha_test import AlphaMasks, check_alpha_masks
from relume.raytrace.visibility_masks import RayCounts
from relume.scene.light_members import LightMembers
from relume.store.bake_protocol import ArraySpec, StoreReader

F32 = NDArray[np.float32]

SHARD_ROWS = 16_384
_CHUNK_BYTES, _MIN_CHUNK_ROWS = 1 << 20, 1024


def array_of_rows(path: str, shape: tuple[int, ...], dtype: str, shard_rows: int = SHARD_ROWS) -> ArraySpec:
    """Return an array that tasks write by shards, in chunks of about a mebibyte: small ones are slow to read.

    Args:
        path: in the store. shape: of the array, rows first. dtype: name. shard_rows: of a shard, a power of two.
    """
    row_bytes = math.prod(shape[1:]) * np.dtype(dtype).itemsize
    fitting_rows = 1 << max(_CHUNK_BYTES // max(row_bytes, 1), 1).bit_length() - 1
    chunk_rows = min(max(fitting_rows, _MIN_CHUNK_ROWS), shard_rows)
    return ArraySpec(path, shape, dtype, (chunk_rows, *shape[1:]), (shard_rows, *shape[1:]))


def read_lights(store: StoreReader) -> TriangleLights:
    """Read the light triangles of a store."""
    nodes, direction, power, codes = (
        store.read(f"lights/{name}") for name in ("nodes", "direction", "irradiance", "tiles")
    )
    return TriangleLights(nodes, direction, power, codes=codes)


def read_tiles(store: StoreReader) -> Tiles:
    """Read the tiles of the light triangles. Raises StoreError if they do not cover the sphere."""
    tiles = Tiles(store.read("lights/tiles"))
    if not tiles.is_whole():
        raise StoreError("the light tiles of the store do not cover the sphere; bake the scene again")
    return tiles


def read_shadow_ray_directions(store: StoreReader) -> Shaped[F32, "M 3"]:
    """Return the directions of shadow rays: tile centers if light may come from any part of a tile."""
    if store.attributes["relightable"]:
        return read_tiles(store).centroids.astype(np.float32)
    return read_lights(store).direction


def light_members_path(name: str) -> str:
    """Return the array of a store that has the members of a light; names of lights may have any characters."""
    return f"scene/light_members/{hashlib.sha256(name.encode()).hexdigest()[:16]}"


def read_light_members(store: StoreReader, name: str) -> LightMembers:
    """Return the members of a light. Raises StoreError if the store has none."""
    return LightMembers.from_rows(np.asarray(store.read(light_members_path(name)), np.float32))


def has_alpha_tested_surfaces(store: StoreReader) -> bool:
    """Return True if some triangles of a store are alpha-tested."""
    return bool(store.attributes.get("has_alpha_test"))


def read_alpha_test(
    store: StoreReader, positions: Shaped[F32, "vertices 3"], faces: Shaped[NDArray[np.uint32], "triangles 3"]
) -> AlphaTest | None:
    """Read the alpha test of a store; None if all triangles are opaque.

    Args:
        store: an open store. positions: its vertices. faces: its triangles.
    Raises:
        ChunkDamagedError: its arrays do not match the triangles.
    """
    if not has_alpha_tested_surfaces(store):
        return None
    names = store.attributes["materials"]
    alpha_masks = check_alpha_masks(
        {name: store.read(f"alpha_masks/{name}") for name in AlphaMasks._fields}, len(names)
    )
    uvs, material = store.read("scene/uvs"), store.read("scene/face_material")
    corner, last = int(faces.max(initial=0)), int(material.max(initial=0))
    if (
        corner >= min(len(uvs), len(positions))
        or len(material) != len(faces)
        or not 0 <= material.min(initial=0) <= last < len(names)
    ):
        raise ChunkDamagedError("scene/faces", "a triangle has a corner or a material that is not in the scene")
    return AlphaTest.build(faces, positions, uvs, material, alpha_masks)


def read_rays(store: StoreReader) -> RayCounts:
    """Return the bake's shadow rays: traced, saved by prediction, and mispredicted."""
    counts = [
        store.read(f"views/{k}/rays/{shard}")
        for k in range(len(store.attributes["views"]))
        for shard in range(-(-store.shape(f"views/{k}/visibility")[0] // SHARD_ROWS))
    ]
    return RayCounts(*(int(count) for count in np.sum(counts, axis=0))) if counts else RayCounts(0, 0, 0, 0)
