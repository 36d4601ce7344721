"""Light of an open bake along lobe rays, traced when the lobe is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import halve_to_width, rotate_about_y, texel_directions
from relume.brdf.albedo import Documents, Reflectance, Reflectances, directional_albedo, quantized_reflectance
from relume.brdf.lobe_sampling import LobeSampling, sample_lobe
from relume.brdf.roughness_levels import NO_LEVELS
from relume.core.errors import StoreError
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.live.opened.retrace import NormalRetracer
from relume.methods.patch_layout import read_tree
from relume.patches.patch_kdtree import NO_PATCH_NODE, PatchTree
from relume.raytrace.lobe_directions import LobePattern, make_lobe_pattern
from relume.store.bake_protocol import StoreReader
from relume.transport.lobe_hits import LobeHits, LobeSurfaces, PatchLookup, patch_reach, trace_lobe_rays
from relume.transport.lobe_rays import LobeEnvironment
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_ALBEDO_STEPS = 64
_PEAK, _PEAK_ROWS, _COARSE_ROWS = 8, 4, 64  # brightness of peaks by the mean; rows of maps
_BLUR = 1.5  # of the environment behind a second lobe, by the median of its half angle
_NUM_RAYS = ((1.0, 144), (90.0, 233))
"""Rays of lobes whose median is up to so many degrees."""


class LobeTracer:
    """Traces lobe rays from samples of a bake.

    Args:
        store: the bake's. tracer: with the triangles of the scene.
    """

    def __init__(self, store: StoreReader, tracer: NormalRetracer) -> None:
        self._store, self._tracer = store, tracer

    def pattern(self, lobe: LobeSampling) -> LobePattern:
        """Return the rays of every sample: fewer for a narrow lobe."""
        num_rays = next(num for degrees, num in _NUM_RAYS if np.degrees(lobe.median) <= degrees)
        return make_lobe_pattern(lobe, num_rays, int(self._store.attributes.get("gather_seed", 0)))

    def trace(
        self,
        receivers: ShadingPoints,
        footprint: Shaped[F32, "#n 2 2 3"],
        pattern: LobePattern,
        reflectances: Reflectances,
        tint: Shaped[F32, "patches 3"],
        is_canceled: Callable[[], bool],
    ) -> LobeHits:
        """Trace the rays of points. See `trace_lobe_rays`.

        Args:
            receivers: the points. footprint: of each in its pixel. pattern: their rays.
            reflectances: of all materials; rays go on from narrow lobes. Empty: rays end at the first surface.
            tint: mean of the specular texture of each patch. is_canceled: polled.
        """
        points_args = receivers.points, receivers.wo, footprint, receivers.level
        surfaces = self._surfaces(reflectances, tint)
        return trace_lobe_rays(self._tracer.geometry, self._lookup, surfaces, *points_args, pattern, is_canceled)

    def _surfaces(self, reflectances: Reflectances, tint: F32) -> LobeSurfaces:
        geometry, lobes = self._tracer.geometry, list(map(_narrow_lobe, reflectances))
        found = [lobe for lobe in lobes if lobe is not None]
        row = np.cumsum([lobe is not None for lobe in lobes]) - 1 if lobes else np.zeros(0, np.int64)
        row[[lobe is None for lobe in lobes]] = -1
        size = (len(found), 0) if not found else np.stack([lobe.quantile[0] for lobe, _ in found]).shape
        quantile, albedo = np.empty(size, np.float32), np.empty((len(found), _ALBEDO_STEPS, 3), np.float32)
        for k, (lobe, documents) in enumerate(found):
            theta_o, values = directional_albedo(documents)
            cosine = np.linspace(0, 1, _ALBEDO_STEPS)
            quantile[k] = lobe.quantile[0]
            albedo[k] = np.stack([np.interp(cosine, np.cos(theta_o)[::-1], v[::-1]) for v in values.T], axis=1)
        is_half_angle = np.array([lobe.is_half_angle for lobe, _ in found], np.bool_)
        blur = np.array([_BLUR * lobe.median for lobe, _ in found], np.float32)
        mesh_args = geometry.faces, geometry.face_material, self._normals
        return LobeSurfaces(
            *mesh_args, row.astype(np.int32), quantile, is_half_angle, albedo, blur, tint, geometry.epsilon
        )

    @cached_property
    def _normals(self) -> F32:
        """Normals of the corners; empty for a store that lacks them."""
        try:
            return np.asarray(self._store.read("scene/normals"), np.float32)
        except StoreError:
            return np.empty((0, 3), np.float32)

    @cached_property
    def _lookup(self) -> PatchLookup:
        geometry = self._tracer.geometry
        sides = (2 * geometry.face_mesh).astype(np.int32)
        try:
            tree, reach = read_tree(self._store), patch_reach(self._store.read("patches/position"))
        except StoreError:  # direct light alone
            tree, reach = _no_patches(int(sides.max(initial=0)) + 2), patch_reach(np.empty((0, 1, 3), np.float32))
        return PatchLookup(tree, geometry.face_normals, sides, reach)


def _narrow_lobe(reflectance: Reflectance) -> tuple[LobeSampling, Documents] | None:
    """Return the lobe of a material whose highlights are narrow and strong, and their terms; None for others."""
    lobes = (sample_lobe(document, NO_LEVELS) for document in reflectance.lobes)
    narrow = next((lobe for lobe in lobes if lobe is not None), None)
    return None if narrow is None else (narrow, reflectance.lobes)


def reflects_narrowly(reflectance: Reflectance) -> bool:
    """True if lobe rays go on from a material."""
    return _narrow_lobe(reflectance) is not None


def broad_share(reflectance: Reflectance) -> float:
    """Share of a material's reflectance that its narrow highlights do not have."""
    if not reflects_narrowly(reflectance):
        return 1.0
    total = float(reflectance.matrix[:, :, 0].sum())
    narrow = sum(float(quantized_reflectance(document)[:, 0].sum()) for document in reflectance.lobes)
    return max(0.0, 1 - narrow / max(total, 1e-6))


def _no_patches(num_sides: int) -> PatchTree:
    """Return the tree of a scene without patches."""
    return PatchTree(
        np.zeros(1, np.uint8),
        np.zeros(1, np.float32),
        np.full((1, 2), NO_PATCH_NODE, np.int32),
        np.full(num_sides, NO_PATCH_NODE, np.int32),
    )


def tile_of_texels(tiles: Tiles, shape: tuple[int, int], rotation: float) -> Shaped[NDArray[np.int32], "height width"]:
    """Return the light triangle of each texel of an environment.

    Args:
        tiles: of the bake. shape: height and width of the map. rotation: of the map about +Y, degrees.
    """
    directions = rotate_about_y(texel_directions(*shape).reshape(-1, 3).astype(np.float64), rotation)
    return tiles.locate(directions).reshape(shape)


def _halved(radiance: F32) -> list[F32]:
    """Return a map and its halves down to one row."""
    images = [radiance]
    while min(images[-1].shape[:2]) > 1 and images[-1].shape[0] % 2 == images[-1].shape[1] % 2 == 0:
        images.append(halve_to_width(images[-1], images[-1].shape[1] // 2))
    return images


def _without_peaks(images: Sequence[F32]) -> list[F32]:
    """Spread the peaks of coarse images widely: hardly any ray of two wide lobes meets a sun, and each would be a spot.

    Their light stays, though not its direction.
    """
    limit = _PEAK * images[0].mean(axis=(0, 1))
    limited = _halved(np.minimum(images[0], limit))
    spread = [image - low for image, low in zip(images, limited, strict=True)]
    widest = next((k for k, image in enumerate(images) if len(image) <= _PEAK_ROWS), len(images) - 1)
    out = list(images)
    for k in range(widest):
        if len(images[k]) <= _COARSE_ROWS:
            factor = len(images[k]) // len(images[widest])
            out[k] = limited[k] + np.repeat(np.repeat(spread[widest], factor, axis=0), factor, axis=1)
    return out


def lobe_environment(
    radiance: Shaped[F32, "height width 3"],
    tile: Shaped[NDArray[np.int32], "height width"],
    rotation: float,
    lights: TriangleLights,
    *,
    is_direct: bool,
) -> LobeEnvironment:
    """Return an environment for lobe rays. See `LobeEnvironment`.

    Args:
        radiance: the map, times its gain. tile: from `tile_of_texels`. rotation: degrees. lights: its triangles.
        is_direct: as in `LobeEnvironment`.
    """
    cosine_sine = np.array([np.cos(np.radians(rotation)), np.sin(np.radians(rotation))], np.float32)
    images = _without_peaks(_halved(np.ascontiguousarray(radiance, np.float32)))
    shapes = np.array([image.shape[:2] for image in images])
    sizes = shapes.prod(axis=1)
    levels = np.column_stack([np.cumsum(sizes) - sizes, shapes])
    texels = np.concatenate([image.reshape(-1, 3) for image in images])
    light_args = lights.direction, lights.radius, lights.solid_angle
    return LobeEnvironment(images[0], tile, cosine_sine, *light_args, texels, levels.astype(np.int64), is_direct)
