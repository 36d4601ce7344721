"""Fixed views: their samples, and the light triangles visible from each; two stages that methods share.

The bake stores rays, not results: one visibility bit per view sample and light triangle. Stages: "samples" (the light
triangles, and each view's samples), then "visibility" (rows of each view).

    scene/positions, normals, faces, face_material, face_mesh   triangles, for rays that looks require
    scene/uvs                                            of the corners
    alpha_masks/…                                        of alpha-tested scenes: relume.raytrace.alpha_test.AlphaMasks
    lights/environment                                   radiance, to weight it again
    lights/tiles                                         relume.lights.sphere_tiles.Tiles
    lights/nodes, direction, irradiance                  relume.lights.spherical_triangles.TriangleLights
    views/<k>/pixel, weight, material                    every sample of the k-th view; background samples last
    views/<k>/position, normal, tangent, diffuse, specular, uv
    scene/face_emission, views/<k>/emission              of scenes with emission images: relume.scene.emission
    views/<k>/level                                      of roughness: relume.scene.roughness_levels
    views/<k>/normal_length, surface_normal              of scenes with normal maps:
                                                         relume.raytrace.surface_interaction.SurfaceInteraction
    views/<k>/transmittance, camera, is_mirrored, mirror, mirror_cosine, mirror_tint
                                                         of scenes with glass or mirrors: relume.camera.view_samples
    views/<k>/camera                                     of cameras with a lens, too
    views/<k>/frost                                      of scenes with frosted glass: relume.camera.view_samples
    views/<k>/alpha_sample                               of scenes with tinted glass:
                                                         relume.raytrace.surface_points.SurfacePoints
    views/<k>/visibility                                 samples on surfaces only
    views/<k>/rays/<shard>                               relume.raytrace.visibility_masks.RayCounts of a shard's rows
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.camera.refraction import glass_surfaces, has_frost
from relume.camera.spectral_split import num_tints
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES
from relume.camera.transparency_layers import has_layers
from relume.camera.view_samples import BACKGROUND, camera_setup, sample_pixels
from relume.core.errors import PlanError
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment
from relume.lights.tile_subdivision import MAX_LIGHTS, MIN_LIGHTS, choose_tiles
from relume.methods import plan_estimates
from relume.methods.read_cache import ReadCache
from relume.methods.store_layout import (
    SHARD_ROWS,
    array_of_rows,
    light_members_path,
    read_lights,
    read_shadow_ray_directions,
)
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.visibility_masks import LightTargets, make_light_targets, trace_visibility_masks
from relume.scene.emission import has_emission_images, relative_emission
from relume.scene.model import Camera, Scene
from relume.scene.roughness_levels import levels_of_material, min_mean_normal_length
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput, TaskStore
from relume.views.store_io import read_alpha_samples

MIN_SIDE, MAX_PIXELS = 16, 4096 * 4096
_SURFACE_BYTES = 4 + 4 + 2 + 1 + 5 * 12 + 20
_EMISSION_BYTES, _NORMAL_MAP_BYTES, _ORIGIN_BYTES = 12, 4 + 12, 12
_LAYER_BYTES = 12 + 12 + 1 + 2 + 4 + MAX_MIRROR_BOUNCES * (2 + 4 + 12)
_SHARD_ROW_BYTES = 200  # position, normal, and the blocks of the tracer
_METADATA_BYTES = 1 << 20
_RAY_NS, _TRIANGLE_US = 5.0, 2.0  # on one core, for scenes of 200 to a million triangles


class ViewStage(NamedTuple):
    """Results of the first stage that every task of the second needs.

    Attributes:
        targets: targets of shadow rays. num_surface_samples: number of surface samples of each view.
    """

    targets: LightTargets
    num_surface_samples: tuple[int, ...]


class SampledViews:
    """The two stages as part of a method; a `relume.store.bake_protocol.BakeMethod` without a name.

    Args:
        smooths_edges: whether pixels on edges have several samples; see `sample_view`.
    """

    stages: tuple[str, ...] = ("samples", "visibility")

    def __init__(self, *, smooths_edges: bool = True) -> None:
        self._smooths_edges = smooths_edges
        self._lock = threading.Lock()
        self._geometry: tuple[str, SceneBuffers] | None = None
        self.view_stage = ReadCache(_read_view_stage)

    def __reduce__(self) -> tuple[Any, ...]:
        return _make_sampled_views, (self._smooths_edges,)  # pickled without cached data

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        """Return upper bounds, from the recipe alone."""
        width, height = recipe.size
        view_names = [camera.name for camera in scene.cameras]
        if unknown := [view for view in recipe.views if view not in view_names]:
            raise PlanError(f"the scene has no view {unknown[0]!r}; choose from {', '.join(view_names)}")
        if not recipe.views or len(set(recipe.views)) != len(recipe.views):
            raise PlanError("name at least one view, and each only once")
        if not (min(width, height) >= MIN_SIDE and width * height <= MAX_PIXELS):
            able = f"give at least {MIN_SIDE}×{MIN_SIDE}, at most {MAX_PIXELS} in all"
            raise PlanError(f"{width}×{height} pixels were asked for; {able}")
        if not MIN_LIGHTS <= recipe.num_lights <= MAX_LIGHTS:
            raise PlanError(f"{recipe.num_lights} lights were asked for; give {MIN_LIGHTS} to {MAX_LIGHTS}")
        samples = plan_estimates.max_view_samples(scene, recipe) * len(recipe.views)
        bits = (recipe.num_lights + 7) // 8
        surface_bytes = _SURFACE_BYTES + (_EMISSION_BYTES if has_emission_images(scene) else 0)
        surface_bytes += _NORMAL_MAP_BYTES if _has_normal_maps(scene) else 0
        surface_bytes += _LAYER_BYTES if has_layers(scene.materials) else 0
        surface_bytes += _ORIGIN_BYTES if plan_estimates.has_lens(scene, recipe) else 0
        # while samples are sorted, their files exist twice, and no bits yet
        in_store = samples * (surface_bytes + max(bits, surface_bytes)) + plan_estimates.lights_bytes(scene, recipe)
        num_rays = (
            samples * recipe.num_lights
            + plan_estimates.num_camera_rays(scene, recipe)
            + plan_estimates.num_tinted_rays(scene, samples)
        )
        sampling, tracing = plan_estimates.sampling_bytes(scene, recipe), SHARD_ROWS * (bits + _SHARD_ROW_BYTES)
        # concurrent tasks while a single view is sampled
        concurrent_bytes = max(tracing, plan_estimates.light_selection_bytes(scene))
        return Plan(
            num_view_samples=samples,
            num_rays=num_rays,
            work_s=plan_estimates.estimated_work(
                scene, num_rays * plan_estimates.supersampling_ratio(scene, recipe), _RAY_NS, _TRIANGLE_US
            ),
            store_bytes=in_store + plan_estimates.triangles_bytes(scene) + _METADATA_BYTES,
            peak_bytes=plan_estimates.process_bytes(scene) + max(sampling, tracing),
            lone_bytes=max(0, sampling - concurrent_bytes) if len(recipe.views) == 1 else 0,
        )

    def prepare(self, scene: Scene) -> None:
        """Build the acceleration structure of the triangles."""
        self.geometry_of(scene)

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        """Return the store's attributes."""
        cameras = {camera.name: camera for camera in scene.cameras}
        return {
            "method": recipe.method,
            "scene": scene.id,
            "size": list(recipe.size),
            "num_lights": recipe.num_lights,
            "relightable": recipe.relightable,
            "materials": [material.name for material in scene.materials],
            "objects": [mesh.name for mesh in scene.meshes],
            "double_sided": [material.double_sided for material in scene.materials],
            "has_alpha_test": any(material.is_alpha_tested for material in scene.materials),
            "has_layers": has_layers(scene.materials),
            "frost": glass_surfaces(scene.materials).alpha.tolist(),
            "has_tints": num_tints(scene.materials) > 0,
            "has_emission_images": has_emission_images(scene),
            "roughness_levels": [list(map(list, levels_of_material(material).pairs)) for material in scene.materials],
            "shortest_normals": [min_mean_normal_length(material.normal_map) for material in scene.materials],
            "views": [_view_attributes(cameras[view]) for view in recipe.views],
        }

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """Return tasks for the lights and each view; then for shards of each view's samples. See `BakeMethod`."""
        if stage == 0:
            return [Task(0, 0, "", 0, 0), *(Task(0, k + 1, view, 0, 0) for k, view in enumerate(recipe.views))]
        ranges = [
            (view, start, min(start + SHARD_ROWS, rows))
            for k, view in enumerate(recipe.views)
            for rows in [self.view_stage(store).num_surface_samples[k]]
            for start in range(0, rows, SHARD_ROWS)
        ]
        return [Task(1, index, view, start, stop) for index, (view, start, stop) in enumerate(ranges)]

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """Return the visibility arrays of the views; tasks of the first stage create theirs. See `BakeMethod`."""
        if stage == 0:
            return []
        bits = (store.shape("lights/irradiance")[0] + 7) // 8
        num_surface_samples = self.view_stage(store).num_surface_samples
        return [
            array_of_rows(f"views/{k}/visibility", (num_surface_samples[k], bits), "uint8")
            for k in range(len(recipe.views))
        ]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: TaskStore) -> TaskOutput:
        """Compute a task; deterministic on any machine. See `BakeMethod`."""
        if task.stage == 1:
            return self._visibility(scene, recipe.views.index(task.group), task, store)
        if not task.group:
            return TaskOutput(
                {**light_arrays(scene, recipe), **triangle_arrays(self.geometry_of(scene), scene)}, 0, 0.0
            )
        camera = replace(
            camera_setup(scene, self.geometry_of(scene), task.group, recipe.size), check_canceled=store.check_canceled
        )
        columns, num_rays = sample_pixels(
            camera, store.scratch, _columns(scene, camera.camera), smooths_edges=self._smooths_edges
        )
        prefix = f"views/{recipe.views.index(task.group)}"
        return TaskOutput({f"{prefix}/{name}": column for name, column in columns.items()}, num_rays, 0.0)

    def _visibility(self, scene: Scene, k: int, task: Task, store: StoreReader) -> TaskOutput:
        prefix = f"views/{k}"
        position = store.read(f"{prefix}/position", task.start, task.stop)
        normal = store.read(f"{prefix}/normal", task.start, task.stop)
        alpha_sample, targets = read_alpha_samples(store, k, task.start, task.stop), self.view_stage(store).targets
        visibility = trace_visibility_masks(self.geometry_of(scene).embree, position, normal, targets, alpha_sample)
        rays = np.array(
            [
                visibility.rays.num_traced,
                visibility.rays.num_full,
                visibility.rays.num_checked,
                visibility.rays.num_wrong,
            ]
        )
        arrays = {f"{prefix}/visibility": visibility.visible, f"{prefix}/rays/{task.start // SHARD_ROWS}": rays}
        return TaskOutput(arrays, visibility.rays.num_traced, visibility.trace_s)

    def geometry_of(self, scene: Scene) -> SceneBuffers:
        """Return the scene's triangles, built once for all tasks of a process."""
        with self._lock:
            if self._geometry is None or self._geometry[0] != scene.id:
                self._geometry = scene.id, build_scene_buffers(scene)
            return self._geometry[1]


def _columns(scene: Scene, camera: Camera) -> list[str]:
    """Return the names of the stored columns of a camera's view samples."""
    names = ["pixel", "weight", "material", "level", "position", "normal", "tangent", "diffuse", "specular", "uv"]
    if has_layers(scene.materials):
        names += ["transmittance", "camera", "is_mirrored", "mirror", "mirror_cosine", "mirror_tint"]
    elif camera.lens is not None:
        names.append("camera")
    if has_frost(scene.materials):
        names.append("frost")
    if num_tints(scene.materials):
        names.append("alpha_sample")
    if has_emission_images(scene):
        names.append("emission")
    return names + ["normal_length", "surface_normal"] * _has_normal_maps(scene)


def _has_normal_maps(scene: Scene) -> bool:
    return any(material.normal_map is not None for material in scene.materials)


def _make_sampled_views(smooths_edges: bool) -> SampledViews:
    return SampledViews(smooths_edges=smooths_edges)


def _read_view_stage(store: StoreReader) -> ViewStage:
    views = range(len(store.attributes["views"]))
    rows = tuple(int(np.searchsorted(store.read(f"views/{k}/material"), BACKGROUND)) for k in views)
    return ViewStage(read_targets(store), rows)


def light_arrays(scene: Scene, recipe: Recipe) -> dict[str, NDArray[Any]]:
    """Return the light triangles of a scene's environment, as arrays of a store."""
    radiance = scene.environment.radiance
    tiles = choose_tiles(radiance, recipe.num_lights, recipe.relightable)
    lights = integrate_environment(tiles, EnvironmentTexels.from_radiance(radiance))
    return {
        "lights/nodes": lights.nodes,
        "lights/direction": lights.direction,
        "lights/irradiance": lights.irradiance,
        "lights/tiles": tiles.codes,
        "lights/environment": radiance,
    }


def triangle_arrays(geometry: SceneBuffers, scene: Scene) -> dict[str, NDArray[Any]]:
    """Return the merged triangles of a scene, as arrays of a store."""
    arrays = {f"scene/{name}": getattr(geometry, name) for name in ("positions", "faces", "face_material", "face_mesh")}
    arrays |= {"scene/normals": geometry.normals.astype(np.float16), "scene/uvs": geometry.uvs}
    if has_emission_images(scene):
        arrays["scene/face_emission"] = relative_emission(scene)
    arrays |= {
        light_members_path(light.name): light.members.rows() for light in scene.lights if light.members is not None
    }
    alpha_test = geometry.embree.alpha_test
    if alpha_test is not None:
        arrays |= {f"alpha_masks/{k}": array for k, array in alpha_test.alpha_masks._asdict().items()}
    return arrays


def read_targets(store: StoreReader) -> LightTargets:
    """Return the targets of a store's shadow rays."""
    return make_light_targets(read_shadow_ray_directions(store), read_lights(store).irradiance)


def _view_attributes(camera: Camera) -> dict[str, Any]:
    """Return a view's entry in a store's attributes."""
    near = {"near": camera.near} if camera.near else {}
    lens = {"lens": camera.lens.document()} if camera.lens else {}
    return {"name": camera.name, "to_world": camera.to_world.ravel().tolist(), "yfov": camera.yfov} | near | lens
