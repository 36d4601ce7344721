"""bake.rays_vs_embreex: shadow rays per second of the packets ÷ `EmbreeScene.run` on the same rays and threads.

The rays are those of a bake: view samples of the built-in scene against its environment triangles, above the horizon
only. embreex gets them as prepared arrays, in the order in which the packets trace them, in pieces on the same pool.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.core.thread_pools import for_ranges, num_threads
from relume.lights.spherical_triangles import tessellate_environment
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.scene.examples.still_life import demo_scene
from relume_bench.figure import Figure
from relume_bench.timing import time_interleaved

F32 = NDArray[np.float32]

_PIECE = 65_536


def measure(tiny: bool) -> list[Figure]:
    """Both sides alternating, the best of each; and the number of rays with different results."""
    size, num_positions, num_lights = ((32, 24), 160, 50) if tiny else ((640, 480), 16_384, 300)
    scene = demo_scene()
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "front", size)
    surfaces = int((samples.material != BACKGROUND).sum())
    start = max(0, surfaces // 2 - num_positions // 2) // 16 * 16  # neighbors, as in a bake
    origins = samples.surface.points.position[start : start + num_positions]
    normals = samples.surface.points.normal[start : start + num_positions]
    directions = tessellate_environment(scene.environment.radiance, num_lights).direction
    point_index, light = _active_rays(normals, directions)
    ray_origins, ray_directions = np.ascontiguousarray(origins[point_index]), np.ascontiguousarray(directions[light])
    peer, hits = embreex_scene(geometry), np.empty(len(point_index), np.int32)

    def piece(a: int, b: int) -> None:
        hits[a:b] = peer.run(ray_origins[a:b], ray_directions[a:b], query="OCCLUDED")

    def embreex() -> None:
        for_ranges(piece, len(point_index), _PIECE)

    relume_times, embree_times = time_interleaved(
        [lambda: trace_visibility(geometry.embree, origins, normals, directions), embreex], 2 if tiny else 7
    )
    traced = trace_visibility(geometry.embree, origins, normals, directions)
    is_visible = (traced.visible[point_index, light >> 3] >> (light & 7)) & 1 == 1
    context = {
        "packets_rays_per_s": traced.num_rays / min(relume_times),
        "embreex_rays_per_s": len(point_index) / min(embree_times),
        "rays": len(point_index),
        "answers_that_differ": float(np.mean(is_visible != (hits < 0))),
        "threads": num_threads(),
    }
    return [
        Figure(
            "bake.rays_vs_embreex",
            traced.num_rays / min(relume_times) / (len(point_index) / min(embree_times)),
            "ratio",
            context,
        )
    ]


def _active_rays(normals: F32, directions: F32) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Point and light of each ray above the horizon: sixteen points, then light by light."""
    above = normals @ directions.T > 0
    point_indices, lights = [], []
    for first in range(0, len(normals), 16):
        light, point_index = np.nonzero(above[first : first + 16].T)
        point_indices.append(point_index + first)
        lights.append(light)
    return np.concatenate(point_indices), np.concatenate(lights)


def embreex_scene(geometry: SceneBuffers) -> Any:
    """Scene of embreex with these triangles."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(geometry.positions[geometry.faces]))
    return scene
