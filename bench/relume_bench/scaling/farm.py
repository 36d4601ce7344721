"""A simulated farm: worker machines, as threads of one process, that take bakes and jobs from a ledger.

`python -m relume_bench.scaling.farm '{"ledger": URL, "folder": …, …}'`: a line on its input starts it; when all bakes
are ready it prints a line of JSON.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Collection
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import update

from relume.store.bake_protocol import Recipe
from relume_bench.scaling.fakes import SleepingMethod, ThreadExecutors, small_scene
from relume_bench.scaling.ledger_calls import LedgerCalls
from relume_worker.database.models import JobRow
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

NOT_TINY_RAYS = 1_000_000_000
_LONGEST_S = 100.0
CLIENTS = (("many", 3), ("some", 1), ("few", 1))
"""Clients, and their parts of the bakes; the first client submits all of its bakes before the others."""


@dataclass(frozen=True)
class FarmPlan:
    """Work of a farm.

    Attributes:
        ledger: URL. folder: data directory; with an object storage each machine has one of its own in it.
        is_shared: whether machines share the folder. num_machines: machines. num_bakes: bakes, twice the machines or
            more. num_tasks, task_s, shard_bytes: see `SleepingMethod`.
    """

    ledger: str
    folder: str
    is_shared: bool
    num_machines: int
    num_bakes: int
    num_tasks: int
    task_s: float
    shard_bytes: int


class _Claims:
    """Times of all claims, and durations of all bakes."""

    def __init__(self) -> None:
        self._lock, self._times = threading.Lock(), dict[str, float]()
        self.bake_s: list[float] = []

    def watch(self, service: BakeService) -> None:
        """Record the successful claims of a machine, and the ends of its bakes."""
        claim, finish = service.ledger.claim, service.ledger.finish

        def finished(identity: str, *args: Any, **fields: Any) -> bool:
            with self._lock:
                self.bake_s.append(time.monotonic() - self._times[identity])
            return finish(identity, *args, **fields)

        def recorded(identity: str) -> bool:
            has_claimed = claim(identity)
            if has_claimed:
                with self._lock:
                    self._times.setdefault(identity, time.monotonic())
            return has_claimed

        service.ledger.claim, service.ledger.finish = recorded, finished  # type: ignore[method-assign]

    def by_time(self) -> list[tuple[float, str]]:
        """Times and ids, earliest first."""
        with self._lock:
            return sorted((at_s, identity) for identity, at_s in self._times.items())


def run(plan: FarmPlan) -> dict[str, Any]:
    """Queue all bakes at once for idle machines, and wait until they are ready.

    Returns:
        claim_s: seconds from queueing to each of the first `num_machines` claims. fairness: see `fairness`.
        bake_s: mean seconds from the claim of a bake to its end.
        cpu_s, wall_s, calls: of the time from queueing to the last bake.
    """
    method = SleepingMethod(plan.num_tasks, plan.task_s, plan.shard_bytes, NOT_TINY_RAYS)
    claims = _Claims()
    with ExitStack() as stack:
        machines = []
        for number in range(plan.num_machines):
            folder = Path(plan.folder) / ("" if plan.is_shared else f"machine{number}")
            service = BakeService(folder, plan.ledger, methods={"direct": method})
            service.executors = service.kind.executors = ThreadExecutors(1)
            claims.watch(service)
            machines.append(service)
        first = machines[0]
        scene = register_scene(first.data_dir, first.ledger, small_scene(65535))
        costs = first.plan(scene, Recipe("direct", ("front",), (64, 48), 10))
        num_lights = iter(range(10, 10 + plan.num_bakes))
        clients = {}
        for client, fraction in CLIENTS:
            for _ in range(plan.num_bakes * fraction // sum(fraction for _, fraction in CLIENTS)):
                recipe = Recipe("direct", ("front",), (64, 48), next(num_lights))
                clients[first.ledger.submit(scene, recipe, costs, client)] = client
        _set_states(first, clients, "canceled")
        for service in machines:
            stack.enter_context(service)
        time.sleep(1.5)  # all of them poll
        before, cpu_s, start_s = calls.read(), time.process_time(), time.monotonic()
        _set_states(first, clients, "queued")
        while clients.keys() - set(first.ledger.ready_bakes()) and time.monotonic() < start_s + _LONGEST_S:
            time.sleep(0.5)
        wall_s, spent_s, after = time.monotonic() - start_s, time.process_time() - cpu_s, calls.read()
        ready = set(first.ledger.ready_bakes()) & clients.keys()
    order = [(at_s, identity) for at_s, identity in claims.by_time() if identity in clients]
    first_wave = order[: plan.num_machines]
    statements = {
        kind: number - before["statements"].get(kind, 0)
        for kind, number in after["statements"].items()
        if number > before["statements"].get(kind, 0)
    }
    return {
        "claim_s": [at_s - start_s for at_s, _ in first_wave],
        "fairness": fairness([clients[identity] for _, identity in first_wave], list(clients.values())),
        "wall_s": wall_s,
        "cpu_s": spent_s,
        "bake_s": sum(claims.bake_s) / max(1, len(claims.bake_s)),
        "ready": len(ready),
        "bakes": len(clients),
        "statements": statements,
        "lock_errors": after["lock_errors"] - before["lock_errors"],
        "plan": {key: value for key, value in asdict(plan).items() if key not in ("ledger", "folder")},
    }


def _set_states(service: BakeService, bakes: Collection[str], state: str) -> None:
    """Queue bakes, or cancel them, by one statement."""
    with service.ledger.sessions.begin() as session:
        session.execute(update(JobRow).where(JobRow.id.in_(bakes)).values(state=state))


def fairness(served: list[str], submitted: list[str]) -> float:
    """Smallest ratio, over clients, of turns that a client got to those that it was due.

    Turns due are equal for all clients, or as many as a client has bakes.

    Args:
        served: client of each turn. submitted: client of each bake.
    """
    due, left, waiting = dict.fromkeys(submitted, 0), len(served), dict.fromkeys(submitted, 0)
    for client in submitted:
        waiting[client] += 1
    while left > 0 and any(waiting.values()):
        for client in due:
            if left > 0 and waiting[client] > 0:
                due[client], waiting[client], left = due[client] + 1, waiting[client] - 1, left - 1
    return min(served.count(client) / num for client, num in due.items() if num > 0)


if __name__ == "__main__":
    calls = LedgerCalls()
    farm_plan = FarmPlan(**json.loads(sys.argv[1]))
    print("ready", flush=True)
    sys.stdin.readline()
    print(json.dumps(run(farm_plan)), flush=True)
