"""Patches with overridden normal maps, as if the scene had been baked with these.

Each sample point of a patch takes the normal of its texels, filtered like its textures. Lights that rise above its
horizon are traced, and its gather rays are distributed about the new normal; docs/indirect-light.md#algorithm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.brdf.texture_slots import NormalMap
from relume.core.thread_pools import parallel_for_cancellable
from relume.radiosity.patch_irradiance import PatchLight
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.views.map_override_store import RayTracer
from relume.views.normal_override import perturb_normals

_PATCHES_PER_STEP = 512  # rays for 0.05 s


def normal_mapped_patches(
    patches: PatchLight,
    normals: Sequence[NormalMap | None],
    tracer: RayTracer,
    is_canceled: Callable[[], bool] = lambda: False,
) -> PatchLight:
    """Apply normal-map overrides to patches. Traces O(points · (rays per point + lights that rise)) rays.

    Args:
        patches: as baked. normals: override of each material, None for none.
        tracer: tracer of the additional rays. is_canceled: polled.
    Returns:
        All patches, unchanged if the bake has no UV coordinates for them.
    Raises:
        StoreError: the store lacks data for tracing its rays. NotFoundError, SceneError: an image cannot be loaded.
            CancelledError: `is_canceled` returned True.
    """
    if patches.uv is None or patches.surface_normal is None:
        return patches
    for material, normal_map in enumerate(normals):
        rows = np.flatnonzero(patches.material == material)
        if normal_map is not None and len(rows):
            perturbed_points = _perturbed_points(patches, rows, normal_map)
            patches = _retrace(patches, perturbed_points, rows, tracer, is_canceled)
    return patches


def _perturbed_points(patches: PatchLight, rows: NDArray[np.intp], normal_map: NormalMap) -> SurfacePoints:
    """Return the points of all patches, with perturbed normals in some patches `rows`. (G,)"""
    assert patches.uv is not None  # checked by the caller
    assert patches.surface_normal is not None
    points = patches.points_of(rows)
    uv, surface_normal = patches.uv[rows].reshape(points.num_points, -1), patches.surface_normal[rows].reshape(-1, 3)
    perturbed_normal = perturb_normals(
        normal_map, uv, surface_normal, points.normal, points.tangent, surface_normal
    ).normal
    point_rows = (rows[:, None] * patches.points_per_patch + np.arange(patches.points_per_patch)).ravel()
    normal, tangent = patches.points.normal.copy(), patches.points.tangent.copy()
    normal[point_rows], tangent[point_rows] = perturbed_normal, any_tangent(perturbed_normal)
    return patches.points._replace(normal=normal, tangent=tangent)


def _retrace(
    patches: PatchLight,
    perturbed_points: SurfacePoints,
    rows: NDArray[np.intp],
    tracer: RayTracer,
    is_canceled: Callable[[], bool],
) -> PatchLight:
    """Trace patches `rows` with perturbed normals. perturbed_points: perturbed points of all patches."""
    retraced = replace(
        patches, points=perturbed_points, visible=patches.visible.copy(), gather_hits=patches.gather_hits.copy()
    )

    def trace(start: int, stop: int) -> None:
        step_rows = rows[start:stop]
        baked_points, step_points = patches.points_of(step_rows), retraced.points_of(step_rows)
        visible = tracer.visibility(
            step_points, baked_points.normal, patches.visible[step_rows].reshape(step_points.num_points, -1)
        )
        retraced.visible[step_rows] = visible.reshape(len(step_rows), *retraced.visible.shape[1:])
        retraced.gather_hits[step_rows] = tracer.gather_hits(step_points, step_points.normal, patches.pattern).reshape(
            len(step_rows), -1
        )

    parallel_for_cancellable(
        trace, len(rows), _PATCHES_PER_STEP, lambda fraction: None, is_canceled, "tracing normal-mapped patches"
    )
    return retraced
