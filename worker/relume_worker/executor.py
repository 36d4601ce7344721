"""Run tasks: in this process for tiny bakes, on a Dask cluster for all others.

A cluster takes seconds to start (spawn, imports, compiled kernels); a preview bake takes less. So a bake of at most
`TINY_BAKE_S`, or of `TINY_BAKE_RAYS` and `TINY_BAKE_BYTES`, runs in this process, one task at a time on the kernels'
own threads, and the cluster starts with the first larger one. Its processes yield to interactive work.

Each worker process has two slots, which are Dask resources: one for bulk work (tasks of bakes, frames of animations),
on one core; one for work that a person waits for (stills, thumbnails), on all cores. So nobody waits for the end of a
stranger's task.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from multiprocessing import resource_tracker
from typing import Any

from relume.core.errors import PlanError
from relume.core.memory_usage import resident_bytes
from relume.store.bake_protocol import Plan
from relume_worker.dask_executor import DaskExecutor

log = logging.getLogger(__name__)

# As planned, on one core: half of it on two, about the start of a cluster on a busy machine. A preview with indirect
# light of as many views as are visible at once is below it.
TINY_BAKE_S = 20.0
TINY_BAKE_RAYS = 400_000_000
TINY_BAKE_BYTES = 512 << 20  # on disk: with millions of triangles placing probes takes longer than tracing
CONNECT_S = 10
# Interactive shading is at 5 (`relume.core.thread_pools`): at 0, two processes left it a quarter of two
# cores.
BAKE_NICE = 10
WORKER_PRELOAD = ["relume_worker.executor"]  # Dask's name for modules whose `dask_setup` runs in each process

# Slots of a process, and their number; see above. `relume worker` offers them, and so must workers that others start.
BULK, URGENT = "bulk", "urgent"
WORKER_SLOTS = {BULK: 1, URGENT: 1}
# One Python thread per slot, so one thread for every library below it.
SINGLE_THREAD_ENV = dict.fromkeys(
    ("RELUME_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

# Else each connection keeps its last thousand messages and the requests in them: gigabytes for frames of many looks.
NO_MESSAGE_LOGS: dict[str, Any] = {"distributed.admin.low-level-log-length": 0}
# The ledger decides about retries; results are a few numbers, so nothing is spilled to disk. Dask's profiler, with a
# hundred samples per second, took 2 % of a core from each tracing worker.
DASK_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.comm.timeouts.connect": f"{CONNECT_S}s",
}
# Dashboard pages would show anyone who connects what runs here.
NO_HTTP_ROUTES: dict[str, Any] = {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}


def is_tiny(plan: Plan) -> bool:
    """True if a bake is about done before a cluster would have started."""
    if 0 < plan.work_s <= TINY_BAKE_S:
        return True
    return plan.num_rays <= TINY_BAKE_RAYS and plan.store_bytes <= TINY_BAKE_BYTES


def dask_setup(_: object) -> None:
    """Make a worker process yield; its later threads inherit this."""
    os.nice(BAKE_NICE)


def num_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Executors:
    """Executors of one service, started on demand."""

    def __init__(self, scheduler: str | None = None, num_workers: int | None = None) -> None:
        """
        Args:
            scheduler: address of a Dask scheduler, tcp://…; None: a cluster of this machine's cores.
            num_workers: processes of the embedded cluster; None: one per core.
        """
        self.scheduler = scheduler
        self.num_workers = num_workers or num_cores()
        self._lock = threading.Lock()
        self._num_users, self._last_used_s = 0, time.monotonic()
        self._local: ThreadPoolExecutor | None = None
        self._cluster: Any = None
        self._client: Any = None

    def local(self) -> Executor:
        """This process, one task at a time; kernels split each task over their own threads."""
        with self._lock:
            if self._local is None:
                self._local = ThreadPoolExecutor(1, thread_name_prefix="relume-tiny-bake")
            return self._local

    @contextlib.contextmanager
    def keep_cluster(self) -> Iterator[None]:
        """Keep the cluster during a job, and for a while afterwards."""
        with self._lock:
            self._num_users += 1
        try:
            yield
        finally:
            with self._lock:
                self._num_users, self._last_used_s = self._num_users - 1, time.monotonic()

    def cluster(self, slot: str = BULK) -> Executor:
        """The Dask cluster. Raises PlanError if the scheduler does not answer, or its workers are not relume's.

        Args:
            slot: `BULK` or `URGENT`.
        """
        with self._lock:
            if self._client is not None and self._client.status != "running":  # the scheduler is gone
                with contextlib.suppress(Exception):  # nobody is connected any more
                    self._client.close(timeout=1)
                self._client = None
            if self._client is None:
                self._client = self._connect()
            return DaskExecutor(self._client, slot)

    @property
    def has_cluster(self) -> bool:
        """True if the cluster is running."""
        return self._client is not None

    def num_processes(self) -> int:
        """Worker processes of the cluster, hence concurrent bulk tasks; before it starts, as many as it will have."""
        with self._lock:
            if self._client is None:
                return self.num_workers
            return max(1, len(self._client.nthreads()))

    def stop_idle_cluster(self, idle_s: float) -> None:
        """End the embedded worker processes if no job has used them for so long; the next job starts new ones."""
        with self._lock:
            is_idle = self._num_users == 0 and time.monotonic() - self._last_used_s > idle_s
            if self._cluster is not None and is_idle:
                self._stop_cluster()

    def resident_bytes(self) -> int:
        """Resident memory of the embedded worker processes, in bytes."""
        cluster = self._cluster  # the lock may be held while processes start
        pids = [] if cluster is None else [nanny.pid for nanny in list(cluster.workers.values())]
        return sum(resident_bytes(pid) for pid in pids if pid is not None)

    def close(self) -> None:
        """Stop everything; running tasks are abandoned, their shards are complete or absent."""
        with self._lock:
            if self._local is not None:
                self._local.shutdown(wait=False, cancel_futures=True)
                self._local = None
            self._stop_cluster()

    def _stop_cluster(self) -> None:
        if self._client is not None:
            _attempt(self._client.close, timeout=2)
        if self._cluster is not None:
            _attempt(self._cluster.sync, _kill_workers, self._cluster, callback_timeout=5)
            _attempt(self._cluster.close, timeout=5)
        self._client = self._cluster = None

    def _connect(self) -> Any:
        import dask
        from distributed import Client

        logging.getLogger("distributed").setLevel(logging.WARNING)  # Dask sets its own when it is imported
        dask.config.set(NO_MESSAGE_LOGS)  # also for connections of workers that start later
        with dask.config.set(DASK_CONFIG):
            check_certificates(self.scheduler)
            address = self.scheduler or self._start_cluster()
            try:
                client = Client(address, timeout=CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
            except (OSError, ValueError) as error:
                raise PlanError(
                    f"the scheduler {address} does not answer ({error}); start it, then try again"
                ) from None
            if self.scheduler:
                _check_slots(client)
            return client

    def _start_cluster(self) -> Any:
        """Start processes on this machine. Every local account can reach their ports, and Dask runs anything for its
        clients: so each start has a key of its own, which stays in the memory of these processes.
        """
        import dask
        from distributed import LocalCluster
        from distributed.security import Security

        for name in ("distributed.scheduler", "distributed.nanny", "distributed.client"):
            # the bake itself reports a dead process
            logging.getLogger(name).setLevel(logging.CRITICAL)
        with _without_interrupts(), dask.config.set(NO_HTTP_ROUTES):
            self._cluster = LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=self.num_workers,
                threads_per_worker=len(WORKER_SLOTS),
                resources=WORKER_SLOTS,
                processes=True,
                host="127.0.0.1",
                security=Security.temporary(),  # type: ignore[no-untyped-call]
                scheduler_kwargs={"dashboard": False},
                dashboard_address="127.0.0.1:0",  # None would use Dask's default port, and warn if it is taken
                local_directory=tempfile.gettempdir(),
                silence_logs=logging.ERROR,
                env=SINGLE_THREAD_ENV,
                preload=WORKER_PRELOAD,
            )
        return self._cluster


def check_certificates(scheduler: str | None) -> None:
    """Raise PlanError if a scheduler uses TLS and Dask has no certificates."""
    import dask

    if (scheduler or "").startswith("tls:") and not dask.config.get("distributed.comm.tls.ca-file", None):
        raise PlanError(
            f"the scheduler {scheduler} uses TLS, but no certificates are set here; set "
            "DASK_DISTRIBUTED__COMM__TLS__CA_FILE and the related certificates and keys (docs/operations.md)"
        )


def _check_slots(client: Any) -> None:
    """Raise PlanError if the cluster's workers offer no slots: their tasks would wait for ever."""
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    if workers and not any(BULK in worker["resources"] for worker in workers):
        client.close()
        raise PlanError(
            "the workers of the scheduler have no slots for relume's tasks; start them with `relume worker`, or with "
            f"--nthreads 2 --resources '{BULK}=1 {URGENT}=1'"
        )


def _attempt(stop: Callable[..., object], *args: object, **kwargs: object) -> None:
    """Stop a part of the cluster. A failure must not keep the others, or the service, from stopping."""
    try:
        stop(*args, **kwargs)
    except Exception as error:  # Dask raises anything, AssertionError included
        log.warning("a part of the cluster did not stop cleanly (%s: %s)", type(error).__name__, error)


async def _kill_workers(cluster: Any) -> None:
    """Kill a cluster's worker processes without restarting them; runs in the cluster's loop.

    If a nanny is closed while its process is starting after another died, it fails and leaves the process running.
    """
    for nanny in cluster.workers.values():
        nanny.close_gracefully()
        worker_process = nanny.process
        if worker_process is not None and worker_process.process is not None:
            await worker_process.process.kill()  # waits behind a start


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Threads and processes started here never receive SIGINT: this process stops them after Ctrl-C."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # starting it unblocks the signal
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)
