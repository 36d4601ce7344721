"""Method `probes`: free-camera views (Mahajan 2008, Sun 2007); incident light is stored at surface probes.

The bake stores for each probe what `gather` stores for each view sample: its visible light triangles, and the patches
that its gather rays hit. Neither depends on a BRDF or a camera. Stages: "probes" (light triangles, probes, patches),
"visibility and gather rays" (rows of patches and of probes), "spherical harmonics", then "free-camera error", which
reads the finished bake.

    scene/positions, faces, face_material, uvs, textures, …  relume.probes.stored_scene
    lights/…                                                 as in relume.methods.view_stages
    patches/…                                                as in relume.methods.gather
    nodes/num_rows, first, node_index                        relume.probes.triangle_grids.ProbeGrid
    nodes/normal, probe, weight                              relume.probes.lattice_nodes.LatticeNodes
    probes/position, normal, tangent, material               relume.probes.mesh_lattice.PlacedProbes
    probes/visibility, probes/gather_hits                    lights visible from a probe; patches that its rays hit
    sh/…                                                     relume.methods.spherical_harmonic_transfer
    mirror_lights/…                                          as in relume.methods.gather, for static views
    error/free_camera                                        relume.live.opened.free_camera_error
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import PlanError
from relume.lights.spherical_triangles import tessellate_environment
from relume.methods import plan_estimates
from relume.methods.baked_error import FREE_CAMERA_ERROR
from relume.methods.mirror_lights import make_mirror_lights
from relume.methods.patch_layout import read_patch_points, read_tree
from relume.methods.read_cache import ReadCache
from relume.methods.spherical_harmonic_transfer import harmonic_bytes, make_harmonic_light
from relume.methods.store_layout import array_of_rows
from relume.methods.view_stages import SampledViews, light_arrays, read_targets, triangle_arrays
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patches import POINTS_PER_PATCH, choose_patches
from relume.probes.density import density_from_distance, density_from_shadows
from relume.probes.interpolation_weights import PROBES_PER_NODE
from relume.probes.mesh_lattice import MAX_PROBES, make_corner_grid, max_grid_nodes, place_probes
from relume.probes.stored_scene import corner_tangents, ray_pattern, read_probes
from relume.probes.visible_sides import visible_sides
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.texture_arrays import texture_arrays, texture_attributes
from relume.raytrace.visibility import VisibilityBits, trace_visibility
from relume.raytrace.visibility_masks import LightTargets, trace_visibility_masks
from relume.scene.model import Scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput, TaskStore

_PICTURES = "relume.live.opened.free_camera_error"
ROWS_PER_SHARD = 4096
RAYS_PER_PROBE = 377  # a single probe then errs by less than 1 % of its radiance (`probes.probe_rmse`)
RAYS_PER_PATCH_POINT = 55
_MIN_PATCHES, _MAX_PATCHES, _PROBES_PER_PATCH = 512, 8192, 6
_MAX_REQUESTED_PATCHES = 4 * _MAX_PATCHES
MIN_PROBES = 64
_MAX_UNSHARED_PROBES = 54  # probes of a material, on both sides, in each of 27 directions
_PROBE_MARGIN = 1.05  # maximum ratio to the requested number
_PROBE_BYTES = 3 * 12 + 2
_NODE_BYTES = 12 + 2 * 4 * PROBES_PER_NODE
_NODE_BUILD_BYTES = 600  # while nodes are merged: their surface, their keys, and the order of these
_PATCH_BYTES = POINTS_PER_PATCH * (56 + 2 * RAYS_PER_PATCH_POINT) + 64
_PATCH_BUILD_BYTES = 4000
_ERROR_PROBE_BYTES = 2600  # per probe while the error is measured: six vectors of 36 coefficients
_ERROR_BYTES = 300 << 20  # of everything else: tables, environments, static views
_RAY_NS, _TRIANGLE_US = 2000.0, 40.0  # on one core, for scenes of 200 to a million triangles


class ProbesMethod:
    """Implements `relume.store.bake_protocol.BakeMethod`."""

    name = "probes"
    stages = ("probes", "visibility and gather rays", "spherical harmonics", "free-camera error")

    def __init__(self) -> None:
        self._views = SampledViews()
        self._patch_tree, self._shadow_targets = ReadCache(read_tree), ReadCache(read_targets)

    def prepare(self, scene: Scene) -> None:
        """Build the acceleration structure of the triangles."""
        self._views.prepare(scene)

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Return upper bounds, from the recipe alone."""
        plan_estimates.check_gathering(recipe, _MAX_REQUESTED_PATCHES)
        views_plan = self._views.plan(_without_lenses(scene), recipe)
        if not MIN_PROBES <= recipe.num_probes <= MAX_PROBES:
            raise PlanError(f"{recipe.num_probes} probes were asked for; give {MIN_PROBES} to {MAX_PROBES:,}")
        num_probes = _max_probes(scene, recipe)
        num_patches, rays = _num_patches(recipe), _num_rays(recipe)
        num_patch_points = POINTS_PER_PATCH * num_patches
        num_nodes = max_grid_nodes(plan_estimates.num_triangles(scene), recipe.num_probes)
        textures = plan_estimates.texture_bytes(scene)
        peak_task_bytes = max(num_nodes * _NODE_BUILD_BYTES, _ERROR_BYTES + num_probes * _ERROR_PROBE_BYTES)
        num_rays = num_probes * (recipe.num_lights + rays) + num_patch_points * (
            recipe.num_lights + RAYS_PER_PATCH_POINT
        )
        return Plan(
            num_view_samples=num_probes,
            num_rays=num_rays,
            work_s=plan_estimates.estimated_work(scene, num_rays, _RAY_NS, _TRIANGLE_US),
            store_bytes=sum(bound_store_bytes(scene, recipe)) + textures + (1 << 20),
            peak_bytes=views_plan.peak_bytes
            + peak_task_bytes
            + num_patches * _PATCH_BUILD_BYTES
            + ROWS_PER_SHARD * 3 * 2 * rays  # gather hits: traced, joined, written
            + textures,
            lone_bytes=peak_task_bytes,
        )

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Return the store's attributes."""
        return {
            **self._views.attributes(_without_lenses(scene), recipe),
            "gather_seed": int(scene.id[:7], 16),
            "has_sh": True,
            "has_free_camera_error": True,
            **texture_attributes(scene),
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """Return tasks for lights, probes and patches; then for shards of patches and of probes. See `BakeMethod`."""
        if stage == 0:
            return [Task(0, index, group, 0, 0) for index, group in enumerate(("lights", "probes", "patches"))]
        if stage == 2:
            return [Task(2, 0, "spherical harmonics", 0, 0)]
        if stage == 3:
            return [Task(3, 0, "free-camera error", 0, 0)]
        rows = {group: store.shape(f"{group}/material")[0] for group in ("patches", "probes")}
        ranges = [
            (group, start, min(start + ROWS_PER_SHARD, num))
            for group, num in rows.items()
            for start in range(0, num, ROWS_PER_SHARD)
        ]
        return [Task(1, index, *task_range) for index, task_range in enumerate(ranges)]

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """Return visibility and gather hits of patches and probes; tasks create the other arrays. See `BakeMethod`."""
        if stage != 1:
            return []
        bits = (store.shape("lights/irradiance")[0] + 7) // 8
        widths = {
            "patches": (POINTS_PER_PATCH * bits, POINTS_PER_PATCH * RAYS_PER_PATCH_POINT),
            "probes": (bits, _num_rays(recipe)),
        }
        return [
            array_of_rows(f"{group}/{name}", (store.shape(f"{group}/material")[0], width), dtype, ROWS_PER_SHARD)
            for group, group_widths in widths.items()
            for name, width, dtype in zip(("visibility", "gather_hits"), group_widths, ("uint8", "uint16"), strict=True)
        ]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task; seeded by scene and rows: deterministic on any machine. See `BakeMethod`."""
        if task.stage == 0:
            bake_functions = {"lights": self._bake_lights, "probes": self._bake_probes, "patches": self._bake_patches}
            return TaskOutput(bake_functions[task.group](scene, recipe), 0, 0.0)
        if task.group == "spherical harmonics":
            mirror_light_arrays = make_mirror_lights(
                scene, self._views.geometry_of(scene), store, store.read("patches/position")
            )
            return TaskOutput(make_harmonic_light(store, int(scene.id[:7], 16)) | mirror_light_arrays, 0, 0.0)
        if task.group == "free-camera error":
            return TaskOutput({FREE_CAMERA_ERROR: _measure_error(store, scene, recipe.size)}, 0, 0.0)
        if task.group not in ("patches", "probes"):
            raise ValueError(f"{task.group!r} is not in the stage")
        return self._bake_rows(scene, recipe, task, store)

    def _bake_lights(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        geometry = self._views.geometry_of(scene)
        return {
            **light_arrays(scene, recipe),
            **triangle_arrays(geometry, scene),
            "scene/tangents": corner_tangents(scene, geometry),
            **texture_arrays(scene),
        }

    def _bake_probes(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        geometry = self._views.geometry_of(scene)
        cameras = [camera for camera in scene.cameras if camera.name in recipe.views]
        is_open = visible_sides(geometry, cameras, int(scene.id[:7], 16))
        camera_positions = np.array([camera.to_world[:3, 3] for camera in cameras])
        lights = tessellate_environment(scene.environment.radiance, recipe.num_lights)
        density = density_from_distance(geometry, camera_positions, make_corner_grid(is_open))
        density = density_from_shadows(
            geometry, place_probes(geometry, is_open, density, recipe.num_probes), camera_positions, lights
        )
        placed_probes = place_probes(geometry, is_open, density, recipe.num_probes)
        fields = {name: getattr(placed_probes.probes, name) for name in ("position", "normal", "tangent")}
        return {
            **{f"nodes/{name}": array for name, array in placed_probes.probe_grid._asdict().items()},
            **{f"nodes/{name}": array for name, array in placed_probes.lattice_nodes._asdict().items()},
            **{f"probes/{name}": array for name, array in fields.items()},
            "probes/material": placed_probes.material,
        }

    def _bake_patches(self, scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
        patches = choose_patches(scene, self._views.geometry_of(scene), recipe.views, recipe.size, _num_patches(recipe))
        fields: dict[str, NDArray[Any]] = {**vars(patches), **patches.tree._asdict()}
        del fields["tree"]
        return {f"patches/{name}": array for name, array in fields.items()}

    def _bake_rows(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        """Trace visibility and gather rays of some patches or probes."""
        geometry, seed = self._views.geometry_of(scene), int(store.attributes["gather_seed"])
        if task.group == "patches":
            points = read_patch_points(store, task.start, task.stop)
            pattern = make_pattern(RAYS_PER_PATCH_POINT, 0, seed)
        else:
            points = read_probes(store, task.start, task.stop)
            pattern = ray_pattern(store, _num_rays(recipe))
        visibility = _trace_visibility(
            geometry, points, self._shadow_targets(store), is_uniform=task.group == "patches"
        )
        gather_hits = trace_gather_rays(geometry, self._patch_tree(store), points, points.normal, pattern)
        num_rows = task.stop - task.start
        arrays: dict[str, NDArray[Any]] = {
            f"{task.group}/visibility": visibility.visible.reshape(num_rows, -1),
            f"{task.group}/gather_hits": gather_hits.patch.reshape(num_rows, -1),
        }
        return TaskOutput(arrays, visibility.num_rays + gather_hits.num_rays, visibility.trace_s + gather_hits.trace_s)


def _measure_error(store: StoreReader, scene: Scene, size: tuple[int, int]) -> NDArray[np.float32]:
    """Measure the pictures of a finished bake. They are loaded by name, for this task alone: pictures import bakes."""
    measured: NDArray[np.float32] = import_module(_PICTURES).measure_error(store, scene, size)
    return measured


def _trace_visibility(
    geometry: SceneBuffers, points: SurfacePoints, targets: LightTargets, *, is_uniform: bool
) -> VisibilityBits:
    """Trace the lights visible from points. is_uniform: points are dense enough to predict it from neighbors."""
    if not is_uniform:
        return trace_visibility(geometry.embree, points.position, points.normal, targets.directions)
    visibility = trace_visibility_masks(geometry.embree, points.position, points.normal, targets)
    return VisibilityBits(visibility.visible, visibility.rays.num_traced, visibility.trace_s)


class StoreBytes(NamedTuple):
    """Bytes of the parts of a store, without textures."""

    gather_hits: int
    probes: int
    patches: int
    nodes: int
    harmonics: int
    triangles: int
    lights: int


def bound_store_bytes(scene: Scene, recipe: Recipe) -> StoreBytes:
    """Bound the uncompressed bytes of each part of a store."""
    num_probes, bits, num_patches = _max_probes(scene, recipe), (recipe.num_lights + 7) // 8, _num_patches(recipe)
    triangles = plan_estimates.num_triangles(scene)
    return StoreBytes(
        gather_hits=num_probes * 2 * _num_rays(recipe),
        probes=num_probes * (_PROBE_BYTES + bits),
        patches=POINTS_PER_PATCH * num_patches * bits + num_patches * _PATCH_BYTES,
        nodes=(4 + _NODE_BYTES) * max_grid_nodes(triangles, recipe.num_probes),
        harmonics=harmonic_bytes(num_probes, num_patches),
        triangles=triangles * 10 + plan_estimates.triangles_bytes(scene) + plan_estimates.tangent_bytes(scene),
        lights=plan_estimates.lights_bytes(scene, recipe),
    )


def _without_lenses(scene: Scene) -> Scene:
    """Return the scene with cameras whose images are sharp everywhere: a free camera has no lens."""
    return replace(scene, cameras=tuple(replace(camera, lens=None) for camera in scene.cameras))


def _max_probes(scene: Scene, recipe: Recipe) -> int:
    unshared_probes = _MAX_UNSHARED_PROBES * len(scene.materials)  # cannot be merged, however few are requested
    return int(_PROBE_MARGIN * recipe.num_probes) + unshared_probes


def _num_patches(recipe: Recipe) -> int:
    """Return the number of patches: by default fewer than probes, since gathering blurs their light."""
    if recipe.num_patches is not None:
        return recipe.num_patches
    return min(_MAX_PATCHES, max(_MIN_PATCHES, recipe.num_probes // _PROBES_PER_PATCH))


def _num_rays(recipe: Recipe) -> int:
    """Return the number of gather rays of a probe."""
    return recipe.gather_rays or RAYS_PER_PROBE
