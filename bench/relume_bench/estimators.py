"""estimators.*: indirect light at view samples by final-gather rays, and by connecting patches to every sample.

The second is Nguyen's, E(x) = Σ_g V(x, g) L_g cos θx cos θg A_g / max(r², A_g / π), one shadow ray per patch, areas by
points distributed evenly on the triangles. Patches are merged along their tree to as many as there are gather rays, or
as many as their visibility bits fit into the store of the gather hits, or not at all. Both use the same light on the
same patches; the reference is the mean of many gather rays. Relative RMSE of the irradiance of samples all over the
image, none shared.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.opened.fixed_views_indirect import BakedIndirectViews
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.patch_layout import read_tree
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patch_kdtree import NO_PATCH, PatchTree
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.examples.cornell import cornell_box
from relume_bench.figure import Figure
from relume_bench.gather import bake, make_recipe
from relume_bench.standard_error import estimate_point_error

F64 = NDArray[np.float64]
_NAMES = (
    "estimators.final_gather", "estimators.connect_equal_rays",
    "estimators.connect_equal_store", "estimators.connect_all",
)  # fmt: skip
_UNIT = "relative RMSE"
_SEED = 11


def measure(tiny: bool) -> list[Figure]:
    """Compare some samples of one bake in all three ways."""
    scene, num_samples, num_reference_rays = cornell_box(), 40 if tiny else 1200, 512 if tiny else 4096
    geometry = build_scene_buffers(scene)
    with tempfile.TemporaryDirectory() as folder:
        transfer = open_transfer(bake(scene, make_recipe(tiny), Path(folder) / "gather.zarr").path, Cache(4 << 30))
        store, tree = transfer.store, read_tree(transfer.store)
        light = illumination_from_look(
            validate(transfer.default_look, transfer.default_look), transfer.material_names, has_bounces=True
        )
        assert isinstance(transfer, BakedIndirectViews)
        radiance = transfer.indirect.outgoing_light(light).isotropic
        num_rays = store.shape("views/0/gather_hits")[1]
        sample_rows = np.linspace(0, store.shape("views/0/gather_hits")[0] - 1, num_samples).astype(np.int64)
        position, normal = (store.read(f"views/0/{name}")[sample_rows] for name in ("position", "normal"))
        surface_points = SurfacePoints(
            position, normal, any_tangent(normal), 64 * np.arange(num_samples, dtype=np.uint32)
        )
        patch_position, patch_normal = (store.read(f"patches/{name}")[:, 0] for name in ("position", "normal"))

    def gathered(count: int) -> F64:
        gather_hits = trace_gather_rays(
            geometry, tree, surface_points, surface_points.normal, make_pattern(count, 0, _SEED)
        )
        return np.asarray(np.pi * radiance[gather_hits.patch].mean(axis=1, dtype=np.float64))

    reference, num_patches = gathered(num_reference_rays), len(patch_position)
    areas = _areas(geometry, tree, num_patches, 1 << (14 if tiny else 21))
    patches = (patch_position, patch_normal, areas, radiance[:num_patches].astype(np.float64))
    counts = [min(count, num_patches) for count in (num_rays, 16 * num_rays, num_patches)]
    estimates = [
        gathered(num_rays),
        *(_connect_to_patches(geometry, surface_points, _merge_patches(*patches, count)) for count in counts),
    ]
    return [
        Figure(name, estimate_point_error(irradiance, reference).value, _UNIT, {
            "rays_or_patches": count, "samples": num_samples,
            "without_the_worst_percent": _without_the_worst(irradiance, reference),
        }, estimate_point_error(irradiance, reference).standard_error)
        for name, irradiance, count in zip(_NAMES, estimates, [num_rays, *counts], strict=True)
    ]  # fmt: skip


def _without_the_worst(estimate: F64, reference: F64) -> float:
    """Relative RMSE without the worst hundredth of the samples."""
    squared_errors = np.sort(((estimate - reference) ** 2).mean(axis=1))[: round(0.99 * len(reference))]
    return float(np.sqrt(squared_errors.mean() / np.mean(reference**2)))


def _areas(geometry: SceneBuffers, tree: PatchTree, num_patches: int, num_samples: int) -> F64:
    """Areas of all patches, m². (C,)"""
    rng = np.random.default_rng(_SEED)
    area = geometry.face_areas
    face = rng.choice(len(area), num_samples, p=area / area.sum())
    u, v = rng.random((2, num_samples))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    normal = geometry.face_normals[face]
    position = positions_on_faces(geometry, face, np.stack([u, v], axis=1).astype(np.float32), normal)
    keys, node = np.concatenate([position, normal], axis=1), tree.roots[2 * geometry.face_mesh[face]].astype(np.int64)
    while np.any(inner := (node >= 0) & (node < len(tree.axis))):
        sample_index = node[inner]
        second = keys[inner, tree.axis[sample_index]] >= tree.value[sample_index]
        node[inner] = tree.children[sample_index, second.astype(np.int64)]
    patch = -1 - node
    counts = np.bincount(patch[(patch >= 0) & (patch < min(num_patches, NO_PATCH))], minlength=num_patches)
    return np.asarray(counts * (area.sum() / num_samples))


def _merge_patches(position: Any, normal: Any, area: F64, radiance: F64, count: int) -> tuple[Any, Any, F64, F64]:
    """Merge neighbors in the tree: position of the middle one, total area and power."""
    bounds = np.linspace(0, len(area), count + 1).astype(np.int64)
    middle, total = (bounds[:-1] + bounds[1:]) // 2, np.add.reduceat(area, bounds[:-1])
    power = np.add.reduceat(area[:, None] * radiance, bounds[:-1])
    return position[middle], normal[middle], total, power / np.maximum(total, 1e-30)[:, None]


def _connect_to_patches(
    geometry: SceneBuffers, surface_points: SurfacePoints, patches: tuple[Any, Any, F64, F64]
) -> F64:
    """Irradiance of points. (n, 3)"""
    position, normal, area, radiance = patches
    out = np.zeros((len(surface_points.position), 3))
    for p, (x, n) in enumerate(zip(surface_points.position, surface_points.normal, strict=True)):
        offset = (position - x).astype(np.float64)
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        towards = offset / distance[:, None]
        hits = trace_rays(geometry.embree, x, towards.astype(np.float32))
        is_visible = hits.distance >= distance * (1 - 1e-3)
        cosines = np.maximum(towards @ n, 0) * np.maximum(-np.einsum("gc,gc->g", towards, normal), 0)
        out[p] = (is_visible * cosines * area / np.maximum(distance**2, area / np.pi)) @ radiance
    return out
