"""render.two_workers_speedup: the same batch of frames by one worker process and by two, each with one thread.

The start of the processes is excluded: a few frames are rendered first. The time is from submitting to `ready`, with
the archive. The peer is one process of the same run.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import closing
from pathlib import Path

from relume.core.errors import PlanError
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure
from relume_bench.workers import bake_s
from relume_server.batch.cluster_steps import ClusterSteps
from relume_server.batch.worker_process import ProcessSettings
from relume_server.jobs.render_jobs import RenderJobs
from relume_server.schemas.renders import QueuedRender
from relume_worker.executor import num_cores
from relume_worker.jobs.job import Quota
from relume_worker.jobs.job_ledger import JobLedger
from relume_worker.jobs.job_service import JobService
from relume_worker.lease import new_owner
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


def measure(tiny: bool) -> list[Figure]:
    """Time the same batch with one worker process, then with two."""
    size, num_lights, frames = ((48, 32), 20, 4) if tiny else ((640, 480), 500, 60)
    scene = demo_scene()
    durations = {}
    with tempfile.TemporaryDirectory() as folder:
        with BakeService(Path(folder)) as service:
            register_scene(service.data_dir, service.ledger, scene)
            recipe = Recipe("direct", (scene.cameras[0].name,), size, num_lights)
            bake_s(service, scene.id, recipe)
            bake = service.bakes()[0].id
        for processes in (1, 2):
            with BakeService(Path(folder), num_workers=processes) as service:
                durations[processes] = _batch_s(service, bake, recipe.views[0], frames)
    context = {
        "one_s": durations[1],
        "two_s": durations[2],
        "frames": frames,
        "size": list(size),
        "lights": num_lights,
        "cores": num_cores(),
    }
    return [Figure("render.two_workers_speedup", durations[1] / durations[2], "ratio", context)]


def _batch_s(service: BakeService, bake: str, view: str, frames: int) -> float:
    """Seconds of a batch of frames, all of whose looks differ, by warm processes."""
    process = ProcessSettings(str(service.data_dir), 1 << 29, (), 1 << 30, 60)
    with closing(ClusterSteps(service.executors, process, {})) as steps:
        ledger = JobLedger(service.ledger.sessions, Quota(99, 99), new_owner())
        jobs = JobService(ledger, {})
        jobs.use_steps(steps.run, steps.num_slots, str)
        renders = RenderJobs(jobs, service.data_dir, lambda bake: "bench", service.get, lambda job, num_bytes: None)
        with closing(jobs):
            jobs.start()
            _render_s(renders, bake, view, [350.0 + k for k in range(2 * steps.num_slots())])
            return _render_s(renders, bake, view, [5.0 * k for k in range(frames)])


def _render_s(renders: RenderJobs, bake: str, view: str, rotations: list[float]) -> float:
    looks = [{"environment": {"rotation": rotation}} for rotation in rotations]
    start_time = time.perf_counter()
    identity = renders.submit(QueuedRender(bake=bake, view=view, looks=looks, format="png"))
    while (job := renders.get(identity)).state != "ready":
        if job.state == "failed":
            raise PlanError(f"the batch failed: {job.problem}")
        time.sleep(0.02)
    return time.perf_counter() - start_time
