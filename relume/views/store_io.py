"""Readers for the cameras, view samples and gather rays of a store."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError, SceneError, StoreError
from relume.raytrace.gather_rays import RayPattern, make_pattern
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE, SurfacePoints
from relume.scene.lens import read_lens
from relume.scene.model import Camera
from relume.scene.validate import check_camera
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional

F32 = NDArray[np.float32]

_ROWS_PER_BLOCK = 8192


@runtime_checkable
class TransferReader(Protocol):
    """A store that can read rows that are not adjacent."""

    def read_rows(self, path: str, rows: NDArray[np.int64]) -> NDArray[Any]:
        """Read some rows of an array. path: path of the array. rows: in any order"""
        ...


@runtime_checkable
class RayTracing(Protocol):
    """A store that may have to trace its gather rays."""

    def trace_gather_rays(self, first: int, is_canceled: Callable[[], bool]) -> None:
        """Trace the rays of a material. first: row of its first sample. is_canceled: called regularly"""
        ...


def read_camera(store: StoreReader, k: int) -> Camera:
    """Read the camera of the k-th view. Raises StoreError if it is missing or invalid."""
    try:
        attributes = store.attributes["views"][k]
        to_world = np.array(attributes["to_world"], np.float64).reshape(4, 4)
        near = float(attributes.get("near", 0.0))
        lens = read_lens(attributes["lens"]) if "lens" in attributes else None
        camera = Camera(str(attributes["name"]), to_world, float(attributes["yfov"]), near=near, lens=lens)
        check_camera(camera)
    except (KeyError, TypeError, ValueError, ParameterError, SceneError) as error:
        raise StoreError(f"view {k} of the store has no camera ({error}); delete the bake, bake again") from error
    return camera


def make_material_pattern(store: StoreReader, k: int, material: int) -> RayPattern:
    """Recreate the pattern of the gather rays of a material's samples in the k-th view of a store."""
    num_cosine, num_glossy = store.attributes["gather_rays"][material]
    return make_pattern(num_cosine, num_glossy, int(store.attributes["gather_seed"]) + 1 + k)


def read_rows_by_block(
    store: StoreReader, path: str, rows: Shaped[NDArray[np.integer], " k"]
) -> Shaped[NDArray[Any], "k ..."]:
    """Read some rows of an array that need not fit into memory: a block of adjacent rows at a time.

    Args:
        store: an open store. path: of the array. rows: ascending.
    """
    num_rows = store.shape(path)[0]
    blocks, first = np.unique(rows // _ROWS_PER_BLOCK, return_index=True)
    parts = [store.read(path, 0, 0)]
    for block, some in zip(blocks.tolist(), np.split(rows, first)[1:], strict=True):
        start = block * _ROWS_PER_BLOCK
        parts.append(store.read(path, start, min(start + _ROWS_PER_BLOCK, num_rows))[some - start])
    return np.concatenate(parts)


def read_seeds(store: StoreReader, k: int, start: int, stop: int) -> Shaped[NDArray[np.uint32], " n"]:
    """Read the seeds of samples: those of their traced gather rays, else their rows.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
    """
    if "gather_rays" in store.attributes:
        return np.asarray(store.read(f"views/{k}/seed", start, stop), np.uint32)
    return np.arange(start, stop, dtype=np.uint32)


def read_surface_points(
    store: StoreReader, k: int, start: int, stop: int, seed: Shaped[NDArray[np.uint32], " n"]
) -> SurfacePoints:
    """Read surface samples of a view as points.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
        seed: seed of these points.
    """
    names = "position", "normal", "tangent"
    position, normal, tangent = (store.read(f"views/{k}/{name}", start, stop) for name in names)
    return SurfacePoints(position, normal, tangent, seed, read_alpha_samples(store, k, start, stop))


def read_alpha_samples(store: StoreReader, k: int, start: int, stop: int) -> Shaped[F32, " n"]:
    """Read the alpha samples of samples, one each or one for all; see `SurfacePoints`.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
    """
    if not store.attributes.get("has_tints"):
        return FIXED_ALPHA_SAMPLE
    alpha_samples = store.read(f"views/{k}/alpha_sample", start, stop)
    return alpha_samples if alpha_samples.any() else FIXED_ALPHA_SAMPLE


def read_ray_origins(store: StoreReader, k: int, start: int, stop: int) -> Shaped[F32, "n 3"]:
    """Read the origins of view directions: the camera, a point of its lens, or the last surface on the path.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
    Returns:
        One for all if they are equal.
    """
    camera = read_camera(store, k)
    if store.attributes.get("has_layers") or camera.lens is not None:
        return np.asarray(store.read(f"views/{k}/camera", start, stop), np.float32)
    return camera.to_world[None, :3, 3].astype(np.float32)


def view_directions(origin: Shaped[F32, "#n 3"], position: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Unit view directions wo from positions to the origins of camera rays."""
    offset = origin - position
    return np.asarray(offset / np.linalg.norm(offset, axis=1, keepdims=True), np.float32)


def read_uv(store: StoreReader, k: int, start: int, stop: int) -> Shaped[F32, "n uv"] | None:
    """Read the texture coordinates of samples, see `relume.raytrace.surface_interaction.SurfaceInteraction`.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
    Returns:
        None if the store has none
    """
    return read_optional(store, f"views/{k}/uv", start, stop)


def read_normal_length(store: StoreReader, k: int, start: int, stop: int) -> Shaped[F32, " n"]:
    """Read the lengths of the mean normals in pixels; one if the store has none.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays.
    """
    length = read_optional(store, f"views/{k}/normal_length", start, stop)
    return np.ones(stop - start, np.float32) if length is None else length


def read_surface_normal(store: StoreReader, k: int, start: int, stop: int, material: int) -> Shaped[F32, "n 3"] | None:
    """Read the normals of a material's samples without normal mapping; None if the store has none.

    Args:
        store: an open store. k: index of the view. start, stop: rows of its arrays. material: its index.
    """
    shortest_lengths = store.attributes.get("shortest_normals")
    if shortest_lengths is None:
        return None
    normal = read_optional(store, f"views/{k}/surface_normal", start, stop)
    if normal is None and shortest_lengths[material] >= 1:  # no normal map
        return store.read(f"views/{k}/normal", start, stop)
    return normal


def read_shortest_normals(store: StoreReader) -> list[float]:
    """Read the minimum length of mean normals for each material of an open store.

    See `relume.scene.roughness_levels.min_mean_normal_length`.
    """
    lengths = store.attributes.get("shortest_normals")
    return [1.0] * len(store.attributes["materials"]) if lengths is None else list(map(float, lengths))


def read_level_pairs(store: StoreReader) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Read the roughness levels of all materials, none without a map: roughness by the material's, and slope variance.

    Older bakes have the former alone, which contains the effect of the latter.
    """
    levels = store.attributes.get("roughness_levels")
    if levels is None:
        return ((),) * len(store.attributes["materials"])
    return tuple(
        tuple((float(np.ravel(level)[0]), float(np.ravel(level)[-1]) if np.size(level) > 1 else 0.0) for level in each)
        for each in levels
    )


def read_roughness_levels(store: StoreReader, k: int, num_samples: int) -> Shaped[NDArray[np.uint8], " n"]:
    """Read the roughness level of each surface sample.

    Args:
        store: an open store. k: index of the view. num_samples: number of surface samples.
    """
    if not any(read_level_pairs(store)):
        return np.zeros(num_samples, np.uint8)
    return np.asarray(store.read(f"views/{k}/level", 0, num_samples), np.uint8)
