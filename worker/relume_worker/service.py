"""Bake service for server and command line; all that must survive its threads is in ledger and stores."""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from relume.core.errors import NotFoundError, StorageError
from relume.core.source_hash import bake_code
from relume.store.bake_protocol import BakeMethod, Plan, Recipe
from relume.store.reader import read_code
from relume_worker.backup.restore import refuse_unfinished
from relume_worker.bake_kind import BakeKind
from relume_worker.budget import check_budget
from relume_worker.database import open_database
from relume_worker.database.failures import DatabaseError
from relume_worker.executor import Executors, is_tiny
from relume_worker.idle_timer import idle_seconds
from relume_worker.jobs.job import BAKE
from relume_worker.jobs.job_service import JobService
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path, scene_path
from relume_worker.run_marker import delete_run, get_run
from relume_worker.runner import check_published
from relume_worker.status import BakeStatus, bake_id
from relume_worker.status_bus import StatusBus, Subscription
from relume_worker.storage import get_storage, is_in_storage, push
from relume_worker.storage.partial_uploads import delete_partial
from relume_worker.task_notes import delete_note
from relume_worker.tasks import idle_timer, load_registered_scene

log = logging.getLogger(__name__)

CLOSE_S = 10.0
IDLE_CHECK_S = 1.0
STOPPED_RETENTION_S = 7 * 86_400.0  # lifetime of the finished tasks of a failed or canceled bake


class BakeService:
    """Queues, runs and follows bakes. Several services may share a data directory and a ledger.

    Attributes:
        jobs: runs the bakes, and jobs of other kinds that are added before `start`. kind: the bakes among them.
    """

    def __init__(
        self,
        data_dir: Path,
        ledger_url: str | None = None,
        scheduler: str | None = None,
        num_workers: int | None = None,
        methods: Mapping[str, BakeMethod] | None = None,
        client_weights: Mapping[str, float] | None = None,
    ) -> None:
        """
        Args:
            data_dir: folder of scenes and bakes; created if missing.
            ledger_url: SQLite or PostgreSQL; None: relume.db in the data directory.
            scheduler: address of a Dask scheduler; None: an embedded cluster, started by the first bake that needs it.
            num_workers: processes of the embedded cluster; None: one per core.
            methods: available methods by name; None: relume's registry.
            client_weights: weights of some clients, see `relume_worker.jobs.fair_share.FairShare`.
        """
        get_storage()  # fail early if its address is invalid
        bake_code()  # of the running version: its files may be replaced meanwhile
        self.data_dir = data_dir.resolve()
        self.data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
        refuse_unfinished(self.data_dir)
        self.ledger = Ledger(open_database(ledger_url or f"sqlite:///{self.data_dir / 'relume.db'}"))
        self.executors = Executors(scheduler, num_workers)
        self._status_bus = StatusBus(self.get)
        self.jobs = JobService(self.ledger, client_weights or {})
        on_change, is_closing = self._status_bus.notify_change, lambda: self.jobs.is_closing
        self.kind = BakeKind(self.data_dir, self.ledger, self.executors, methods, on_change, is_closing)
        self.jobs.add_kind(self.kind)
        self._closing = threading.Event()
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Start running bakes and other jobs: queued ones, and those that a dead process left."""
        self._delete_orphans()
        self.jobs.start()
        works = {"relume-idle": self._stop_idle_processes}
        if get_storage() is not None:
            works["relume-storage"] = self._store_all
        for name, work in works.items():
            self._threads.append(threading.Thread(target=work, name=name, daemon=True))
            self._threads[-1].start()

    def close(self) -> None:
        """Stop running bakes; an unfinished one resumes at the next start."""
        self._closing.set()
        self._status_bus.notify_change()
        self.jobs.close()
        for thread in self._threads:
            thread.join(CLOSE_S)
        self.executors.close()
        idle_timer.end()
        self._status_bus.close()
        self.ledger.close()

    def __enter__(self) -> BakeService:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def plan(self, scene_id: str, recipe: Recipe) -> Plan:
        """Cost of a bake, checked against this machine's memory and disk.

        If the upper bound of its disk space is large, a small part is baked: a second for the first plan of a scene.

        Raises:
            NotFoundError: there is no such scene.
            PlanError: the recipe does not fit the scene; MemoryBudgetError: it does not fit the machine.
            ParameterError: there is no such method.
        """
        from relume.methods.disk import estimate_disk

        identity = self._resolve_scene_id(scene_id)
        with idle_timer.keep_awake():
            scene = recipe.add_cameras(load_registered_scene(self.data_dir, identity))
            method = self.kind.method(recipe.method)
            plan = method.plan(scene, recipe)
            disk = estimate_disk(method, scene, recipe, plan)
        plan = replace(plan, disk_bytes=disk.store, scratch_bytes=disk.scratch)
        processes = 1 if is_tiny(plan) else 0 if self.executors.scheduler else self.executors.num_workers
        check_budget(plan, self.data_dir, processes)
        return plan

    def submit(self, scene_id: str, recipe: Recipe, client: str = "") -> str:
        """Queue a bake of `scene_id` for a client, and return its id; raises what `plan` raises.

        The same recipe under the same code is the same bake: a queued, running or ready one is unchanged, a failed or
        canceled one resumes.
        """
        identity = bake_id(scene_id, recipe)
        if self._is_ready(identity):
            return identity
        self.ledger.submit(scene_id, recipe, self.plan(scene_id, recipe), client)
        self._notify_change()
        return identity

    def get(self, bake_id: str) -> BakeStatus:
        """Return a bake. Raises NotFoundError."""
        return self.kind.blocked.with_reason(self.ledger.bake(bake_id))

    def bakes(self, scene_id: str | None = None) -> list[BakeStatus]:
        """All bakes, or those of a scene; newest first."""
        return [self.kind.blocked.with_reason(status) for status in self.ledger.bakes(scene_id)]

    def subscribe(self, bake_id: str) -> Subscription:
        """Follow a bake, whichever process runs it. Raises NotFoundError."""
        return Subscription(self._status_bus, bake_id)

    def cancel(self, bake_id: str) -> bool:
        """Cancel a bake; finished tasks are saved for a resume. False if it is neither queued nor running."""
        self.get(bake_id)
        is_canceled = self.ledger.cancel(bake_id)
        self._notify_change()
        return is_canceled

    def delete(self, bake_id: str) -> None:
        """Delete a bake in any state, with its store. Raises NotFoundError, StorageError."""
        from relume_worker.scenes import delete_bakes

        self.get(bake_id)
        delete_bakes(self.data_dir, self.ledger, [bake_id])
        self._notify_change()

    def store_path(self, bake_id: str) -> Path:
        """Path of the published store of a bake. Raises NotFoundError if the id is malformed."""
        return bake_path(self.data_dir, bake_id)

    def estimate_seconds(self, plan: Plan) -> float | None:
        """Estimate the seconds of a bake from finished bakes, with the start of processes; None if there are none."""
        return self.kind.estimate_seconds(plan)

    def _resolve_scene_id(self, scene_id: str) -> str:
        from relume_worker.scenes import get_scene

        return get_scene(self.ledger, scene_id).id

    def _is_ready(self, identity: str) -> bool:
        """True if a bake is finished and its store is usable; a lost or damaged store is queued again."""
        try:
            state = self.ledger.bake(identity).state
        except NotFoundError:
            return False
        if state != "ready":
            return False
        if check_published(self.store_path(identity)) or is_in_storage(self.store_path(identity)):
            return True
        self.ledger.delete_tasks(identity)
        self.ledger.requeue_bake(identity, ("ready",))
        return False

    def _notify_change(self) -> None:
        self._status_bus.notify_change()
        self.jobs.wake()

    def _stop_idle_processes(self) -> None:
        while not self._closing.wait(IDLE_CHECK_S):
            self.executors.stop_idle_cluster(idle_seconds())

    def _store_all(self) -> None:
        """Upload local data that the storage lacks: from before it was configured, or from an outage."""
        try:
            statuses = self.ledger.bakes()
            scenes = [scene_path(self.data_dir, scene) for scene in dict.fromkeys(bake.scene for bake in statuses)]
            ready_paths = [bake_path(self.data_dir, status.id) for status in statuses if status.state == "ready"]
            for path in (path for path in (*scenes, *ready_paths) if path.exists()):
                if self._closing.is_set():
                    return
                push(path)
        except Exception as error:  # bakes continue
            DatabaseError(log, "the data directory cannot be uploaded to the object storage").report_failure(error)

    def _delete_orphans(self) -> None:
        """Delete unfinished stores that no bake in the ledger can resume, and those of bakes that were stopped long
        ago.
        """
        folders = list((self.data_dir / "bakes" / "staging").glob("*.zarr"))
        # queried after listing: another process inserts the row before it creates the folder
        states = {status.id: status.state for status in self.ledger.bakes()}
        for folder in folders:
            identity = folder.name.removesuffix(".zarr")
            state = states.get(identity, "ready")
            is_stopped = state in ("failed", "canceled")
            if state == "ready" or (
                is_stopped and (read_code(folder) != bake_code() or _age_s(folder) > STOPPED_RETENTION_S)
            ):
                with suppress(NotFoundError, StorageError):  # deleted meanwhile; leftovers are deleted with the bake
                    # otherwise its tasks are another machine's
                    if is_stopped and get_run(folder) == self.ledger.get(BAKE, identity).run:
                        self.ledger.delete_tasks(identity)
                        delete_partial(identity)
                shutil.rmtree(folder, ignore_errors=True)
                delete_note(folder)
                delete_run(folder)


def _age_s(folder: Path) -> float:
    """Seconds since the last write in a folder."""
    latest = max((path.stat().st_mtime for path in (folder, *folder.rglob("*")) if path.exists()), default=0.0)
    return time.time() - latest
