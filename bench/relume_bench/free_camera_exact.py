"""free_camera.exact_s_cornell, _still_life, _interior, probes.correction_s: waiting times after the camera stops.

The camera of each scene, 640×480, moves sideways twice, and then stays until the image has converged; the median of
both. From the camera's last move to the encoded exact image, without the quarter of a second that a session waits
first. `tracing_s` of that are view samples, shadow rays and gather rays; the rest is shading. `direct_s`: the same
under a look without indirect light, for which no gather rays are traced. `processor_s`: processor time of all threads.
`free_camera_error` is the error of the free-camera image against the exact one that replaces it, including edges,
which only the exact one antialiases.

`probes.correction_s`, of the still life, ends with the free-camera image that exact direct light has corrected;
`first_error` is its error against the exact one, `cornell_box_s` and `interior_s` are of the other scenes.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.thread_pools import num_threads
from relume.live.fixed_camera.jobs import Job
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.progressive_picture import ProgressivePicture
from relume.live.free_camera.static_view_jobs import TRACING_FRACTION
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.scene.examples.catalog import built_in
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure

_CACHE_BYTES = 4 << 30
_SCENES = {"cornell": "cornell_box", "still_life": "still_life", "interior": "interior"}


class _Convergence(NamedTuple):
    """Seconds until the exact image, those of tracing, processor time, seconds until the corrected image; errors.

    `error` and `first_error` are the relative RMSE of the free-camera image, and of the corrected one.
    """

    convergence_s: float
    tracing_s: float
    processor_s: float
    error: float
    first_s: float
    first_error: float


def measure(tiny: bool) -> list[Figure]:
    """Bake each scene, move the camera, wait."""
    by_scene = {name: _measure_scene(scene, tiny) for name, scene in _SCENES.items()}
    threads = {"threads": num_threads()}
    figures = [
        Figure(f"free_camera.exact_s_{name}", whole.convergence_s, "s", {**_context(whole, direct), **threads})
        for name, (whole, direct) in by_scene.items()
    ]
    still_life = by_scene["still_life"][0]
    errors = {"free_camera_error": still_life.error, "first_error": still_life.first_error}
    others = {f"{_SCENES[name]}_s": by_scene[name][0].first_s for name in ("cornell", "interior")}
    return [*figures, Figure("probes.correction_s", still_life.first_s, "s", {**errors, **others, **threads})]


def _context(whole: _Convergence, direct: _Convergence) -> dict[str, Any]:
    """Context of a scene's figure."""
    return {
        "size": "640×480",
        "tracing_s": whole.tracing_s,
        "processor_s": whole.processor_s,
        "direct_s": direct.convergence_s,
        "free_camera_error": whole.error,
    }


def _measure_scene(name: str, tiny: bool) -> tuple[_Convergence, _Convergence]:
    """With all light, and with direct light only."""
    scene, size = built_in(name), (64, 48) if tiny else (640, 480)
    recipe = Recipe("probes", (scene.cameras[0].name,), size, 60 if tiny else 1000, num_probes=2000 if tiny else 50_000)
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(METHODS["probes"], scene, recipe, Path(folder) / "moving.zarr")
        convergences = []
        for light_paths in ("all", "direct"):
            free_camera_bake = open_bake(path, Cache(_CACHE_BYTES))
            assert isinstance(free_camera_bake, BakedFreeCamera)
            convergences.append(_median(scene, free_camera_bake, size, light_paths))
    return convergences[0], convergences[1]


def _median(scene: Scene, free_camera_bake: BakedFreeCamera, size: tuple[int, int], light_paths: str) -> _Convergence:
    """Two stops of one session, after one with a small image, in which kernels are compiled and patches are lit."""
    look = validate(
        complete({"transport": {"show": light_paths}}, free_camera_bake.default_look), free_camera_bake.default_look
    )
    picture = ProgressivePicture(
        FreeCameraPicture(free_camera_bake, scene.cameras[0].name),
        StaticViewBuilder(free_camera_bake.light_transport, scene).make_static_view,
        free_camera_bake.cache,
    )
    picture.set_look(look)
    coarse_size = size[0] // 4, size[1] // 4
    _, *counted = (_measure_convergence(scene, picture, step, coarse_size if step == 0 else size) for step in range(3))
    return _Convergence(*np.median(np.array(counted), axis=0).tolist())


def _measure_convergence(scene: Scene, picture: ProgressivePicture, step: int, size: tuple[int, int]) -> _Convergence:
    camera = scene.cameras[0]
    to_world = camera.to_world.copy()
    to_world[:3, 3] += 0.01 * (step + 1) * to_world[:3, 0]
    picture.set_camera(replace(camera, to_world=to_world), size)
    picture.advance(None)
    before, first, first_s, tracing_s = picture.image().copy(), None, 0.0, 0.0
    start_time, processor_start = time.perf_counter(), time.process_time()
    while (job := picture.next_job()) is not None:
        job_began = time.perf_counter()

        def record_progress(fraction: float, job: Job = job, job_began: float = job_began) -> None:
            nonlocal tracing_s
            if fraction <= TRACING_FRACTION and job.kind == "static view":
                tracing_s = time.perf_counter() - job_began

        job.apply(job.run(record_progress, lambda: False))
        picture.advance(None)
        if job.kind == "direct light":
            picture.encode(picture.all_tiles(), "rgb9e5")
            first, first_s = picture.image().copy(), time.perf_counter() - start_time
    picture.encode(picture.all_tiles(), "rgb9e5")
    convergence_s, processor_s = time.perf_counter() - start_time, time.process_time() - processor_start
    exact = picture.image()
    first_error = _error(before if first is None else first, exact)
    return _Convergence(convergence_s, tracing_s, processor_s, _error(before, exact), first_s, first_error)


def _error(image: NDArray[np.float32], exact: NDArray[np.float32]) -> float:
    return float(np.sqrt(np.mean((image - exact) ** 2) / np.mean(exact**2)))
