"""Services that live as long as the server: opened at startup, closed at shutdown; routes use `ServicesDep`."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Annotated, NamedTuple

from fastapi import Depends
from sqlalchemy import select
from starlette.requests import HTTPConnection

from relume.assets.environments.built_in import load_built_in
from relume.core.memory_usage import live_bytes
from relume_server.auth import tables as access_tables  # noqa: F401  like those of persistence
from relume_server.auth.services import AuthServices
from relume_server.batch.prewarm import Prewarmer
from relume_server.batch.thumbnails import Thumbnails
from relume_server.client_state.resume import ResumeStore
from relume_server.collaboration.comment_sync import CommentSync
from relume_server.collaboration.room_lease import RoomLease
from relume_server.collaboration.rooms import Rooms
from relume_server.errors import make_problem
from relume_server.io.import_processes import Importers
from relume_server.io.import_queue import ImportQueue
from relume_server.io.import_request import remove_strays
from relume_server.io.streamed_responses import StreamedResponses
from relume_server.jobs.btf_jobs import BtfJobs
from relume_server.jobs.comparison_jobs import ComparisonJobs
from relume_server.jobs.render_jobs import RenderJob, RenderJobs, ended_message
from relume_server.jobs.webhooks import Webhooks
from relume_server.lifecycle.drain import DrainState
from relume_server.persistence.comment_store import CommentStore
from relume_server.persistence.idempotency import IdempotencyStore
from relume_server.persistence.leases import RoomLeases
from relume_server.persistence.look_store import LookStore
from relume_server.persistence.share_store import ShareStore
from relume_server.runtime.bake_pool import TransferPool
from relume_server.runtime.cache_evictor import CacheEvictor
from relume_server.runtime.disk_space import free_bytes
from relume_server.runtime.executors import Threads
from relume_server.runtime.protocols import Library
from relume_server.runtime.recent_check import RecentCheck
from relume_server.runtime.single_flight import SingleFlight
from relume_server.session.frames.bake_updates import BakeUpdates
from relume_server.session.session import SessionServices
from relume_server.settings import Settings
from relume_server.telemetry.metrics import Metrics
from relume_server.telemetry.traces import Traces, open_traces
from relume_worker.database.models import JobRow
from relume_worker.jobs.job import Quota
from relume_worker.jobs.job_ledger import count_jobs
from relume_worker.jobs.step import StepExecutor
from relume_worker.scenes import get_scene
from relume_worker.service import BakeService
from relume_worker.tasks import cached_bytes


@dataclass(frozen=True)
class Services:
    """Services for routes.

    Attributes:
        drain: whether the server is draining. access: users, roles, quotas, and the audit.
        pictures: renders thumbnails, and merges identical concurrent requests.
        responses: large responses.
        readiness: whether the server can serve.
        import_queue: runs imports, and stores their results. webhooks: messages about jobs that have ended.
    """

    settings: Settings
    metrics: Metrics
    drain: DrainState
    access: AuthServices
    bakes: BakeService
    looks: LookStore
    shares: ShareStore
    comments: CommentStore
    idempotency: IdempotencyStore
    renders: RenderJobs
    comparisons: ComparisonJobs
    btfs: BtfJobs
    threads: Threads
    transfers: TransferPool
    cache_evictor: CacheEvictor
    thumbnails: Thumbnails
    pictures: SingleFlight
    responses: StreamedResponses
    live: SessionServices
    readiness: RecentCheck
    import_queue: ImportQueue
    webhooks: Webhooks


NUM_PICTURES = 2

OpenLibrary = Callable[[int, int], Library]
OpenBakes = Callable[[Settings], BakeService]
OpenSteps = Callable[[Settings, Library, BakeService], StepExecutor]


def open_bakes(settings: Settings) -> BakeService:
    """Create the bake service."""
    return BakeService(settings.data, settings.database_url, settings.scheduler, client_weights=settings.fair_shares)


def open_steps(settings: Settings, library: Library, bakes: BakeService) -> StepExecutor:
    """Create the executor of steps, in the worker processes that bake."""
    # Imported here because they load compiled kernels, which a process that only describes the API does not need.
    from relume.image_io.ocio.active_config import config_source
    from relume_server.batch.cluster_steps import ClusterSteps
    from relume_server.batch.worker_process import ProcessSettings

    limits = settings.import_bytes, settings.import_seconds
    process = ProcessSettings(str(settings.data.resolve()), settings.batch_bytes, config_source(), *limits)
    return ClusterSteps(bakes.executors, process, settings.fair_shares)


@asynccontextmanager
async def open_services(
    settings: Settings,
    metrics: Metrics,
    drain: DrainState,
    open_library: OpenLibrary,
    bakes: OpenBakes,
    steps: OpenSteps,
    clock: Callable[[], float],
) -> AsyncIterator[Services]:
    """Open all services; close them in reverse order, also after a failure to open one."""
    settings.data.mkdir(mode=0o700, parents=True, exist_ok=True)
    remove_strays(settings.data, older_than_s=2 * settings.import_seconds)
    async with AsyncExitStack() as ends:

        def at_end(close: Callable[[], None]) -> None:
            ends.push_async_callback(asyncio.to_thread, close)

        def run_in_background(work: Coroutine[None, None, None]) -> None:
            ends.callback(asyncio.create_task(work).cancel)

        if (traces := open_traces() if settings.traces else None) is not None:
            at_end(traces.close)
        library, threads = open_library(settings.cache_bytes, settings.cache_floor_bytes), Threads()
        at_end(threads.close)
        service = await asyncio.to_thread(bakes, settings)
        at_end(service.close)
        executor, sessions = steps(settings, library, service), service.ledger.sessions
        access = AuthServices(sessions, settings)
        transfers = TransferPool(library.open_transfer, threads.long, settings.idle_seconds, clock)
        thumbnails = Thumbnails(settings.data / "thumbnails", executor.run)
        at_end(thumbnails.close)
        at_end(executor.close)
        pictures, responses = SingleFlight(NUM_PICTURES, "relume-picture"), StreamedResponses(settings.data)
        at_end(pictures.close)
        at_end(responses.close)
        cache_evictor = CacheEvictor(transfers, threads, library.trim_cache, library.cache_used_bytes)
        _watch_memory(metrics, library, transfers)
        _watch_jobs(metrics, settings, service, drain)
        webhooks = Webhooks(settings.webhook_hosts, settings.webhook_secret.get_secret_value())
        at_end(webhooks.close)
        kinds = _open_kinds(settings, service, executor, access, webhooks)
        at_end(kinds.comparisons.close)
        at_end(service.jobs.close)
        await asyncio.to_thread(service.start)
        prewarmer = Prewarmer(settings.data, service.ledger, executor.run, thumbnails, transfers.is_used)
        at_end(prewarmer.close)
        if settings.prewarm:
            prewarmer.start()
        importers = Importers()
        at_end(importers.close)
        if settings.preload_importer:
            importers.start()
        rooms, comments = (
            Rooms(settings.max_rooms, settings.max_people, settings.reconnect_seconds),
            CommentStore(sessions),
        )
        room_lease = RoomLease(rooms, RoomLeases(sessions), drain, threads.queries)
        ends.push_async_callback(room_lease.close)
        ends.callback(rooms.close)
        for work in (cache_evictor.run(), CommentSync(rooms, comments.marks, threads.queries).run(), room_lease.run()):
            run_in_background(work)
        yield Services(
            settings=settings,
            metrics=metrics,
            drain=drain,
            access=access,
            bakes=service,
            looks=LookStore(sessions),
            shares=ShareStore(sessions),
            comments=comments,
            idempotency=IdempotencyStore(sessions),
            **kinds._asdict(),
            threads=threads,
            transfers=transfers,
            cache_evictor=cache_evictor,
            thumbnails=thumbnails,
            pictures=pictures,
            responses=responses,
            live=_live(settings, metrics, traces, library, threads, service, access, drain, rooms, room_lease),
            readiness=RecentCheck(partial(_check_ready, service, access)),
            import_queue=ImportQueue(settings, service.ledger, access.quotas, importers),
            webhooks=webhooks,
        )


class _Kinds(NamedTuple):
    """Kinds of jobs."""

    renders: RenderJobs
    comparisons: ComparisonJobs
    btfs: BtfJobs


def _open_kinds(
    settings: Settings, service: BakeService, executor: StepExecutor, access: AuthServices, webhooks: Webhooks
) -> _Kinds:
    """Add the server's kinds of jobs to the service that runs the bakes."""
    jobs = service.jobs
    jobs.use_steps(executor.run, executor.num_slots, lambda error: make_problem(error).detail)
    service.ledger.quota = Quota(settings.max_queued, settings.max_queued_per_client)

    def scene_name(bake: str) -> str:
        return get_scene(service.ledger, service.ledger.bake(bake).scene).name

    def notify(job: RenderJob) -> None:
        if job.request.webhook is not None:
            webhooks.send(job.request.webhook, ended_message(job))

    def on_btf_ready(work: str, material: str, num_bytes: int) -> None:
        access.quotas.convert(("btf-job", work), ("btf", material), num_bytes)

    def on_btf_failed(work: str) -> None:
        access.quotas.set_bytes("btf-job", work, 0)

    return _Kinds(
        RenderJobs(jobs, settings.data, scene_name, service.get, partial(access.quotas.set_bytes, "render"), notify),
        ComparisonJobs(jobs, settings.data, partial(access.quotas.set_bytes, "comparison")),
        BtfJobs(jobs, settings.data, on_btf_ready, on_btf_failed),
    )


def _check_ready(service: BakeService, access: AuthServices) -> None:
    """Check that the database is readable, and that the disk has room."""
    with service.ledger.sessions() as session:
        session.execute(select(JobRow.id).limit(1))
    access.quotas.check_room()


def _live(
    settings: Settings, metrics: Metrics, traces: Traces | None, library: Library, threads: Threads,
    service: BakeService, access: AuthServices, drain: DrainState, rooms: Rooms, room_lease: RoomLease,
) -> SessionServices:  # fmt: skip
    """Create the services of live sessions."""
    return SessionServices(
        library=library,
        threads=threads,
        metrics=metrics,
        traces=traces,
        resumes=ResumeStore(settings.resume_seconds),
        rooms=rooms,
        room_lease=room_lease,
        bake_updates=BakeUpdates(service.ledger.bakes_of_scenes, threads.queries),
        access=access,
        drain=drain,
        ack_seconds=settings.ack_seconds,
        drain_seconds=settings.drain_seconds,
    )


def _watch_jobs(metrics: Metrics, settings: Settings, service: BakeService, drain: DrainState) -> None:
    """Register metrics of running and queued jobs, and of capacity."""
    metrics.watch_workers(service.executors.resident_bytes)
    metrics.watch_jobs(lambda: count_jobs(service.ledger.sessions, ("render", "comparison", "btf")))
    metrics.watch_readiness(lambda: drain.is_draining, lambda: free_bytes(settings.data), settings.min_free_bytes)


def _watch_memory(metrics: Metrics, library: Library, transfers: TransferPool) -> None:
    """Register metrics of memory in this process."""
    metrics.watch_cache(library.cache_used_bytes, library.bytes_by_owner)
    metrics.watch_owners(
        {
            "cache": library.cache_used_bytes,
            "open_bakes": lambda: live_bytes(transfers.open_bakes),
            "bake_tasks": cached_bytes,
            "environments": lambda: live_bytes(load_built_in),
        }
    )


def get_services(connection: HTTPConnection) -> Services:
    """Return the app's services, for routes."""
    app_services: Services = connection.app.state.services
    return app_services


ServicesDep = Annotated[Services, Depends(get_services)]
