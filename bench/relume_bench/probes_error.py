"""probes.probe_rmse: error of incident radiance coefficients at single probes, without interpolation.

Radiance of visible probes of the Cornell box toward the camera, by all paths, against path tracing with its noise
removed (`relume_bench.standard_error.compare_with_passes`): for the scene's own diffuse surfaces, and in the context
for surfaces with a wide highlight; `direct` is the irradiance of all probes directly from the environment, against
tracing every texel of the map.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.view_images import material_documents
from relume.live.free_camera.basis.material_tables import build_tables
from relume.live.free_camera.incident_light import combine_all
from relume.live.free_camera.shade_probes import shade_probes
from relume.look import Look
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.reference import ReferencePoints, environment_texels, reference_radiance
from relume.reference.path_tracing import reference_indirect
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import FreeCameraScene
from relume_bench.standard_error import NoiseCorrectedError, compare_with_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Change = Callable[[dict[str, Any]], None]

PASSES = 8
_FEWER = 8  # paths if the error is not resolved as finely
_COPIES = 8  # paths per probe that are traced together
_NUM_TEXELS_PER_UV = 4


def measure(tiny: bool) -> list[Figure]:
    """Bake the box, trace its probes."""
    num, paths = (4, 64) if tiny else (400, 4096)
    with tempfile.TemporaryDirectory() as folder:
        box = FreeCameraScene("cornell_box", Path(folder), (60, 60) if tiny else (400, 400), tiny)
        comparison, glossy = (
            measure_radiance_rmse(box, num, paths),
            measure_radiance_rmse(box, num, paths // _FEWER, _set_rough_highlights),
        )
        direct = 100 * measure_direct_rmse(box, num)
        details = {"glossy": glossy.summary, "direct": direct, "probes": num, "of": box.num_probes, "paths": paths}
        context = {**comparison.context, **details, **box.sizes}
    return [
        Figure("probes.probe_rmse", 100 * comparison.error.value, "%", context, 100 * comparison.error.standard_error)
    ]


def _set_rough_highlights(document: dict[str, Any]) -> None:
    highlight = {"model": "ggx", "color": [0.5, 0.5, 0.5], "params": {"roughness": 0.6, "f0": 0.7}, "texture": None}
    for material in document["materials"].values():
        material["terms"] = [{"model": "lambert", "color": [0.3, 0.3, 0.3], "texture": None}, highlight]


def measure_direct_rmse(scene: FreeCameraScene, num: int) -> float:
    """Irradiance of some probes directly from the environment, against tracing every texel of the map."""
    probes, probe_indices = _select_probes(scene, num)
    radiance = np.asarray(scene.scene.environment.radiance, np.float64)
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3).astype(np.float32)
    light = (radiance * texel_solid_angles(height, width)[:, None, None]).reshape(-1, 3)
    visible_bits = trace_visibility(scene.free_camera_bake.embree, probes.position, probes.normal, directions).visible
    reference = np.empty((num, 3))
    for k in range(num):
        visibility = np.unpackbits(visible_bits[k], count=len(directions), bitorder="little")
        cosine = np.maximum(directions @ probes.normal[k], 0).astype(np.float64)
        reference[k] = (visibility * cosine) @ light

    def direct(document: dict[str, Any]) -> None:
        document["transport"]["show"] = "direct"

    direct_light = illumination_from_look(scene.look(direct), scene.free_camera_bake.material_names, has_bounces=True)
    irradiance = np.sqrt(np.pi) * combine_all(scene.free_camera_bake, direct_light).total[probe_indices, :, 0].astype(
        np.float64
    )
    return float(np.sqrt(np.mean((irradiance - reference) ** 2) / np.mean(reference**2)))


def measure_radiance_rmse(
    scene: FreeCameraScene, num: int, num_paths: int, change: Change = lambda document: None
) -> NoiseCorrectedError:
    """Radiance of some probes toward the camera by all paths, against path tracing; for a look with broad terms.

    Args:
        scene: without textures. num: visible probes. num_paths: per probe. change: change of its look.
    """
    look, free_camera_bake, camera_position = (
        scene.look(change),
        scene.free_camera_bake,
        scene.scene.cameras[0].to_world[:3, 3],
    )
    visible_probes = _find_visible_probes(scene, camera_position)
    probe_indices = visible_probes[np.linspace(0, len(visible_probes) - 1, num).astype(np.int64)]
    is_needed = np.zeros(free_camera_bake.stored_scene.probes.num_points, np.uint8)
    is_needed[probe_indices] = 1
    viewed = free_camera_bake.stored_scene.viewed_from(camera_position, is_needed)
    incident = combine_all(
        free_camera_bake, illumination_from_look(look, free_camera_bake.material_names, has_bounces=True)
    )
    tables = build_tables([material_documents(look, name) for name in free_camera_bake.material_names])
    # all light that the hemispherical basis represents
    highlight_tables = tables._replace(table_index=tables.table_index[..., [2, 3, 4, 5, 4, 5]])
    radiance = sum(
        shade_probes(viewed, incident.total, None, table).radiance[probe_indices].sum(axis=1)
        for table in (tables, highlight_tables)
    )
    reference_passes = _trace_paths(scene, look, probe_indices, num_paths)
    return compare_with_passes(radiance.astype(np.float64)[None], reference_passes[:, None].astype(np.float32))


def _find_visible_probes(scene: FreeCameraScene, camera_position: F64) -> NDArray[np.intp]:
    """Indices of probes visible to the camera: the insides of solids are not lit correctly."""
    probes = scene.free_camera_bake.stored_scene.probes
    towards = camera_position - probes.position
    distance = np.linalg.norm(towards, axis=1)
    wo = (towards / distance[:, None]).astype(np.float32)
    hits = trace_rays(scene.free_camera_bake.embree, probes.position, wo)
    is_free = (hits.face < 0) | (hits.distance > distance)
    return np.flatnonzero(is_free & (np.einsum("nc,nc->n", wo, probes.normal) > 0))


def _select_probes(scene: FreeCameraScene, num: int) -> tuple[Any, NDArray[np.int64]]:
    probes = scene.free_camera_bake.stored_scene.probes
    probe_indices = np.linspace(0, probes.num_points - 1, num).astype(np.int64)
    return probes.rows(probe_indices), probe_indices


def _trace_paths(built_in_scene: FreeCameraScene, look: Look, probe_indices: NDArray[np.intp], num_paths: int) -> F64:
    """Radiance of probes toward the camera, in independent passes with the same direct light. (passes, points, 3)"""
    scene, geometry, surface = (
        built_in_scene.scene,
        build_scene_buffers(built_in_scene.scene),
        built_in_scene.free_camera_bake.stored_scene,
    )
    probes, material = surface.probes.rows(probe_indices), surface.material[probe_indices]
    texels = environment_texels(scene.environment, look.environment.rotation).scaled(look.environment.gain)
    white = {name: np.ones((len(probe_indices), 3), np.float32) for name in ("diffuse", "specular")}
    towards = scene.cameras[0].to_world[:3, 3] - probes.position
    wo = (towards / np.linalg.norm(towards, axis=1, keepdims=True)).astype(np.float32)
    start_points = ReferencePoints(
        probes.position, probes.normal, probes.tangent, wo, white, np.ones(len(probe_indices), np.float32)
    )
    direct = np.empty((len(probe_indices), 3))
    for number, name in enumerate(built_in_scene.free_camera_bake.material_names):
        material_rows = np.flatnonzero(material == number)
        if len(material_rows):
            direct[material_rows] = reference_radiance(
                geometry, texels, start_points.samples_of(material_rows), [material_documents(look, name)]
            )[0]
    copies, paths = np.repeat(np.arange(len(probe_indices)), _COPIES), max(1, num_paths // (_COPIES * PASSES))
    out = np.empty((PASSES, len(probe_indices), 3))
    for k in range(PASSES):
        reflected = reference_indirect(
            scene, geometry, texels, look, start_points.samples_of(copies), material[copies],
            [look.transport.paths.without_direct()], paths, _NUM_TEXELS_PER_UV, seed=k,
        )  # fmt: skip
        out[k] = direct + reflected.mean[0].reshape(len(probe_indices), _COPIES, 3).mean(axis=1)
    return out
