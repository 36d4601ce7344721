"""Method `gather`: final gathering to surface patches, any number of bounces, fixed views (Nguyen 2010).

Besides the arrays of `relume.methods.view_stages`: surface patches, the lights visible from them, and gather rays from
patches and view samples. Only the patch that each ray hits is stored; directions are generated again from a seed.
Stages after those of the views: "patches", then "gather rays" (rows of patches, rows of each view).

    scene/uvs, textures/<k>, roughness/<k>      relume.raytrace.texture_arrays
    patches/axis, value, children, roots        relume.patches.patch_kdtree.PatchTree
    patches/position, normal, material, …       relume.patches.patches.Patches
    patches/visibility                          lights visible from the sample points of patches, patch by patch
    patches/gather_hits                         patches that the rays of its points hit
    views/<k>/gather_hits                       patches that the rays of a view sample hit
    views/<k>/seed                              seeds the rays of a view sample
    mirror_lights/…                             relume.methods.mirror_lights.MirrorLights: bright lights, planes
    views/<k>/mirror_lights                     lights that a view sample sees in planar mirrors
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import scatters_diffusely
from relume.camera.planar_mirrors import lights_visible_in_mirrors
from relume.methods import plan_estimates
from relume.methods.mirror_lights import make_mirror_lights, max_mirror_lights, read_mirror_lights
from relume.methods.patch_layout import read_patch_points, read_tree
from relume.methods.read_cache import ReadCache
from relume.methods.store_layout import SHARD_ROWS, array_of_rows
from relume.methods.view_stages import SampledViews
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patch_kdtree import MAX_PATCHES, NO_PATCH
from relume.patches.patches import POINTS_PER_PATCH, choose_patches
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.texture_arrays import texture_arrays, texture_attributes
from relume.raytrace.visibility_masks import trace_visibility_masks
from relume.scene.model import Scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput, TaskStore
from relume.views.sample_seeds import make_seeds
from relume.views.store_io import (
    make_material_pattern,
    read_ray_origins,
    read_surface_points,
    view_directions,
)

PATCHES_PER_SHARD = 4096
RAYS_PER_SAMPLE, RAYS_PER_POINT = 377, 55
_GLOSSY_RAYS = 144
_PIXELS_PER_PATCH, _MIN_PATCHES = 10, 1024
_PATCH_STAGE, _RAY_STAGE = 2, 3
_PATCH_BYTES = POINTS_PER_PATCH * (56 + 2 * RAYS_PER_POINT) + 64
_NORMAL_BYTES = 240  # per triangle, while normals are computed
_PATCH_BUILD_BYTES = 4000  # importons, their hits, and the tree that is built over them
_SHARD_ROW_BYTES = 500  # per sample besides its gather hits, which are held three times: traced, joined, written
_RAY_NS, _TRIANGLE_US = 8.0, 3.0  # on one core, for scenes of 200 to a million triangles


class GatherMethod:
    """Implements `relume.store.bake_protocol.BakeMethod`.

    Args:
        rays: per view sample. glossy: number of these if the material has a highlight. diffuse: of all other samples.
        smooths_edges: whether pixels on edges have several samples.
    """

    name = "gather"
    stages = (*SampledViews.stages, "patches", "gather rays")

    def __init__(
        self,
        rays: int = RAYS_PER_SAMPLE,
        glossy: int = _GLOSSY_RAYS,
        diffuse: int = RAYS_PER_SAMPLE,
        *,
        smooths_edges: bool = True,
    ) -> None:
        self._views, self._rays = SampledViews(smooths_edges=smooths_edges), rays
        self._glossy, self._diffuse = glossy, min(diffuse, rays)
        self._patch_tree = ReadCache(read_tree)

    def prepare(self, scene: Scene) -> None:
        """Build the acceleration structure of the triangles."""
        self._views.prepare(scene)

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Return upper bounds, from the recipe alone."""
        plan_estimates.check_gathering(recipe, MAX_PATCHES)
        direct, patch_count, (rays, _) = self._views.plan(scene, recipe), num_patches(recipe), self._ray_counts(recipe)
        num_points, bits = POINTS_PER_PATCH * patch_count, (recipe.num_lights + 7) // 8
        num_mirror_lights = max_mirror_lights(scene, recipe)
        num_rays = direct.num_rays + direct.num_view_samples * (rays + 2 * num_mirror_lights)
        num_rays += num_points * (RAYS_PER_POINT + recipe.num_lights)
        return Plan(
            num_view_samples=direct.num_view_samples,
            num_rays=num_rays,
            work_s=plan_estimates.estimated_work(
                scene, num_rays * plan_estimates.supersampling_ratio(scene, recipe), _RAY_NS, _TRIANGLE_US
            ),
            store_bytes=direct.store_bytes
            + direct.num_view_samples * (2 * rays + 4 + -(-num_mirror_lights // 8))
            + patch_count * _PATCH_BYTES
            + num_points * bits
            + plan_estimates.texture_bytes(scene),
            peak_bytes=direct.peak_bytes
            + plan_estimates.texture_bytes(scene)
            + patch_count * _PATCH_BUILD_BYTES
            + plan_estimates.num_triangles(scene) * _NORMAL_BYTES
            + SHARD_ROWS * (3 * 2 * rays + _SHARD_ROW_BYTES + 2 * num_mirror_lights),
            lone_bytes=direct.lone_bytes,
        )

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Return the store's attributes, with `gather_rays` (cosine, glossy) by material."""
        rays, num_glossy = self._ray_counts(recipe)
        diffuse, glossy = [round(rays * self._diffuse / self._rays), 0], [rays - num_glossy, num_glossy]
        return {
            **self._views.attributes(scene, recipe),
            **texture_attributes(scene),
            "gather_rays": [
                diffuse if all(map(scatters_diffusely, material.terms)) else glossy for material in scene.materials
            ],
            "gather_seed": int(scene.id[:7], 16),
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """Return tasks of the views; the patches; shards of patches and of each view's samples. See `BakeMethod`."""
        if stage < _PATCH_STAGE:
            return self._views.tasks(stage, scene, recipe, store)
        if stage == _PATCH_STAGE:
            return [Task(stage, 0, "", 0, 0)]
        num_patches = store.shape("patches/material")[0]
        ranges = [
            ("", start, min(start + PATCHES_PER_SHARD, num_patches))
            for start in range(0, num_patches, PATCHES_PER_SHARD)
        ]
        ranges += [(task.group, task.start, task.stop) for task in self._views.tasks(1, scene, recipe, store)]
        return [Task(stage, index, *task_range) for index, task_range in enumerate(ranges)]

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """Return arrays of the views, visibility from patches, and all gather hits. See `BakeMethod`."""
        if stage < _RAY_STAGE:
            return self._views.arrays(stage, scene, recipe, store) if stage < _PATCH_STAGE else []
        num_patches, mirror_lights = store.shape("patches/material")[0], read_mirror_lights(store)
        bits = POINTS_PER_PATCH * ((store.shape("lights/irradiance")[0] + 7) // 8)
        widths = [
            ("patches/visibility", bits, "uint8"),
            ("patches/gather_hits", POINTS_PER_PATCH * RAYS_PER_POINT, "uint16"),
        ]
        patch_specs = [
            array_of_rows(path, (num_patches, width), dtype, PATCHES_PER_SHARD) for path, width, dtype in widths
        ]
        sample_columns = [("gather_hits", (self._ray_counts(recipe)[0],), "uint16"), ("seed", (), "uint32")]
        if mirror_lights is not None:
            sample_columns.append(("mirror_lights", (-(-mirror_lights.num_mirrored_lights // 8),), "uint8"))
        view_specs = [
            array_of_rows(f"views/{k}/{name}", (rows, *width), dtype)
            for k, rows in enumerate(self._views.view_stage(store).num_surface_samples)
            for name, width, dtype in sample_columns
        ]
        return [*patch_specs, *view_specs]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task; seeded by scene and rows: deterministic on any machine. See `BakeMethod`."""
        if task.stage < _PATCH_STAGE:
            output = self._views.compute(scene, recipe, task, store)
            is_of_scene = task.stage == 0 and not task.group
            return replace(output, arrays={**output.arrays, **self._texture_arrays(scene)}) if is_of_scene else output
        if task.stage == _PATCH_STAGE:
            return self._bake_patches(scene, recipe, store)
        return (
            self._bake_view_rows(scene, recipe, task, store)
            if task.group
            else self._bake_patch_rows(scene, task, store)
        )

    def _texture_arrays(self, scene: Scene) -> dict[str, NDArray[Any]]:
        """Textures of the scene and their coordinates, for lobe rays that hit its surfaces."""
        return {"scene/uvs": self._views.geometry_of(scene).uvs, **texture_arrays(scene)}

    def _ray_counts(self, recipe: Recipe) -> tuple[int, int]:
        """Rays per view sample, and the number of glossy ones for highlights, in a fixed ratio."""
        rays = recipe.gather_rays or self._rays
        return rays, round(rays * self._glossy / self._rays)

    def _bake_patches(self, scene: Scene, recipe: Recipe, store: StoreReader) -> TaskOutput:
        geometry = self._views.geometry_of(scene)
        patches = choose_patches(scene, geometry, recipe.views, recipe.size, num_patches(recipe))
        fields: dict[str, NDArray[Any]] = {**vars(patches), **patches.tree._asdict()}
        del fields["tree"]
        mirror_light_arrays = make_mirror_lights(scene, geometry, store, patches.position)
        return TaskOutput({f"patches/{name}": array for name, array in fields.items()} | mirror_light_arrays, 0, 0.0)

    def _bake_patch_rows(self, scene: Scene, task: Task, store: StoreReader) -> TaskOutput:
        points, geometry = read_patch_points(store, task.start, task.stop), self._views.geometry_of(scene)
        visibility = trace_visibility_masks(
            geometry.embree, points.position, points.normal, self._views.view_stage(store).targets
        )
        pattern = make_pattern(RAYS_PER_POINT, 0, int(store.attributes["gather_seed"]))
        gather_hits = trace_gather_rays(geometry, self._patch_tree(store), points, points.normal, pattern)
        num_patches = task.stop - task.start
        arrays: dict[str, NDArray[Any]] = {
            "patches/visibility": visibility.visible.reshape(num_patches, -1),
            "patches/gather_hits": gather_hits.patch.reshape(num_patches, -1),
        }
        return TaskOutput(
            arrays, visibility.rays.num_traced + gather_hits.num_rays, visibility.trace_s + gather_hits.trace_s
        )

    def _bake_view_rows(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        k = recipe.views.index(task.group)
        seed, num_rays = make_seeds(store, k, recipe.size[0], task.start, task.stop), 0
        points = read_surface_points(store, k, task.start, task.stop, seed)
        wo = view_directions(read_ray_origins(store, k, task.start, task.stop), points.position)
        material = store.read(f"views/{k}/material", task.start, task.stop)
        geometry, tree, trace_s = self._views.geometry_of(scene), self._patch_tree(store), 0.0
        gather_hits = np.full((len(seed), self._ray_counts(recipe)[0]), NO_PATCH, np.uint16)
        for index in np.unique(material):
            first, stop = np.searchsorted(material, [index, index + 1])
            pattern = make_material_pattern(store, k, int(index))
            hits = trace_gather_rays(geometry, tree, points.rows(slice(first, stop)), wo[first:stop], pattern)
            gather_hits[first:stop, : pattern.num_rays] = hits.patch
            num_rays, trace_s = num_rays + hits.num_rays, trace_s + hits.trace_s
        arrays: dict[str, NDArray[Any]] = {f"views/{k}/gather_hits": gather_hits, f"views/{k}/seed": seed}
        if (mirror_lights := read_mirror_lights(store)) is not None:
            reflected_light = lights_visible_in_mirrors(
                geometry, mirror_lights.mirrors, points, mirror_lights.direction
            )
            arrays[f"views/{k}/mirror_lights"], num_rays = reflected_light.visible, num_rays + reflected_light.num_rays
        return TaskOutput(arrays, num_rays, trace_s)


def num_patches(recipe: Recipe) -> int:
    """Return the number of patches: by default in proportion to the pixels of all views."""
    if recipe.num_patches is not None:
        return recipe.num_patches
    width, height = recipe.size
    return min(MAX_PATCHES, max(_MIN_PATCHES, len(recipe.views) * width * height // _PIXELS_PER_PATCH))
