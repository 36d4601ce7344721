"""scaling.*: three servers, one ledger, an object store, a crowd of people, and a farm; and the model against them.

Servers are processes with everything but the pictures: those are made up, and cost `_FRAME_S` of a core. People are
asynchronous clients in this process (`people`); the machines of the farm are threads of one process (`farm`), whose
tasks sleep. Few people on one server give the unit costs; the model (`model`) predicts from them what many cost.

Both ledgers are measured, one after another; the figures are of PostgreSQL if it is installed. Processor times and
statements hardly depend on other load on the machine; the times of people do, and the context has the load.
"""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.errors import PlanError
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure
from relume_bench.scaling.fakes import SIZE, SleepingMethod, small_scene
from relume_bench.scaling.farm import FarmPlan
from relume_bench.scaling.ledgers import TemporaryLedger, has_postgresql, temporary_ledger
from relume_bench.scaling.model import Population, UnitCosts, bake_calls, calls_per_s, total
from relume_bench.scaling.object_store import LocalStore, local_store
from relume_bench.scaling.people import ROOM_SIZE, Crowd, Experience, Habits, Workplace
from relume_server.auth.tables import TokenRow
from relume_server.auth.tokens import TokenStore, _digest
from relume_server.session.audit_edits import WRITE_INTERVAL_S
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

NUM_SERVERS = 3
_FRAME_S = 0.001
_STILL = Habits(think_s=1e9)
_BUSY = Habits(think_s=0.05)


@dataclass(frozen=True)
class _Sizes:
    """Sizes of a simulation: people, seconds of their work, of the calibration, and the farm."""

    people: int
    seconds: float
    calibration_s: float
    machines: int
    bakes: int
    tasks: int
    task_s: float
    people_a_scene: int = 10


_TINY = _Sizes(6, 1.0, 0.3, 3, 6, 2, 0.01)
_ONE_MACHINE = _Sizes(60, 20.0, 4.0, 4, 12, 2, 0.3)
_MANY_MACHINES = _Sizes(300, 30.0, 4.0, 50, 100, 2, 0.3)


def measure(tiny: bool) -> list[Figure]:
    """Simulate on each kind of ledger; small in tests."""
    sizes = {"sqlite": _TINY if tiny else _ONE_MACHINE}
    if has_postgresql() and not tiny:
        sizes["postgresql"] = _MANY_MACHINES
    kinds = list(sizes)
    results = {kind: _simulate(kind, each) for kind, each in sizes.items()}
    context: dict[str, Any] = {f"on_{kind}": result for kind, result in results.items()}
    last = results[kinds[-1]]
    values = {
        "scaling.cpu_prediction": (last["predicted_cpu_s"] / last["cpu_s"], "ratio"),
        "scaling.calls_prediction": (last["predicted_calls"] / last["calls"], "ratio"),
        "scaling.farm_calls_prediction": (last["predicted_farm_calls"] / last["farm_calls"], "ratio"),
        "scaling.calls_per_person": (last["calls_per_person_s"], "statements/s"),
        "scaling.calls_per_bake": (last["farm_calls"] / max(1, last["farm"]["ready"]), "statements"),
        "scaling.server_frame_ms": (1e3 * (last["unit_costs"]["frame"] - _FRAME_S), "ms"),
        "scaling.edit_ms.p50": (last["edit_ms"]["p50"], "ms"),
        "scaling.edit_ms.p95": (last["edit_ms"]["p95"], "ms"),
        "scaling.claim_s": (last["claim_s"]["p95"], "s"),
        "scaling.fairness": (last["farm"]["fairness"], "ratio"),
        "scaling.lock_errors": (float(sum(result["lock_errors"] for result in results.values())), "errors"),
    }
    elsewhere = {"see": "scaling.cpu_prediction"}
    return [
        Figure(name, float(value), unit, context if name == elsewhere["see"] else elsewhere)
        for name, (value, unit) in values.items()
    ]


def _simulate(kind: str, sizes: _Sizes) -> dict[str, Any]:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ledger = stack.enter_context(temporary_ledger(kind, folder))
        store = stack.enter_context(local_store(folder))
        bakes, tokens = _prepare(folder / "data", ledger.url, sizes)
        servers = [stack.enter_context(_Server(folder / "data", ledger.url)) for _ in range(NUM_SERVERS)]
        farm = stack.enter_context(_Farm(folder, ledger.url, sizes, store))
        return asyncio.run(_run(ledger, store, servers, farm, bakes, tokens, sizes))


def _prepare(data: Path, url: str, sizes: _Sizes) -> tuple[list[str], list[str]]:
    """Bake small scenes, and add a token for each person."""
    bakes = []
    with BakeService(data, url, methods={"direct": SleepingMethod()}) as service:
        for number in range(max(NUM_SERVERS, sizes.people // sizes.people_a_scene)):
            scene = register_scene(service.data_dir, service.ledger, small_scene(number))
            bakes.append(service.submit(scene, Recipe("direct", ("front",), SIZE, 10)))
        until_s = time.monotonic() + 120
        while set(bakes) - set(service.ledger.ready_bakes()):
            if time.monotonic() > until_s:
                raise PlanError("the scenes of the simulation were not baked")
            time.sleep(0.1)
        tokens = _add_tokens(service, sizes.people + 16)
    return bakes, tokens


def _add_tokens(service: BakeService, number: int) -> list[str]:
    """Tokens of people; `TokenStore.add` reads all others for each."""
    texts = []
    with service.ledger.sessions.begin() as session:
        for person in range(number):
            identity, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
            row = {"id": identity, "name": f"person{person}", "role": "edit", "digest": _digest(secret)}
            session.add(TokenRow(**row, created=time.time(), expires=None, revoked=None))
            texts.append(f"relume_{identity}_{secret}")
    assert TokenStore(service.ledger.sessions).authenticate(texts[0]) is not None
    return texts


async def _run(
    ledger: TemporaryLedger, store: LocalStore | None, servers: list[_Server], farm: _Farm,
    bakes: list[str], tokens: list[str], sizes: _Sizes,
) -> dict[str, Any]:  # fmt: skip
    """Calibrate, then let everybody work at once."""
    costs, calls_to_open = await _calibrate(servers[0], bakes[: max(1, len(bakes) // 8)], tokens[-16:], sizes)
    workplaces = _workplaces(servers, bakes, tokens, sizes, Habits().in_rooms)
    crowd = Crowd(workplaces, Habits())
    async with crowd:
        await asyncio.sleep(1.0)
        crowd.experience.begin()
        before, database_s, store_s = [server.read() for server in servers], ledger.cpu_s(), _spent(store)
        requests = Counter[str]() if store is None else store.requests()
        start_s = time.monotonic()
        farm.begin()
        await crowd.work(sizes.seconds)
        after, seconds = [server.read() for server in servers], time.monotonic() - start_s
        result = _people_result(before, after, crowd.experience, workplaces, costs, seconds)
        connections = ledger.num_connections()
        farm_result = await asyncio.to_thread(farm.result)
        whole_s = time.monotonic() - start_s
        at_end = [server.read() for server in servers]
    all_calls = sum(_statements(first, last).total() for first, last in zip(before, at_end, strict=True))
    farm_calls = sum(farm_result["statements"].values())
    polls = calls_per_s(Population(0, sizes.machines, 0, 0))["queue"] * farm_result["wall_s"]
    predicted_farm = polls + farm_result["ready"] * bake_calls(sizes.tasks, farm_result["bake_s"])
    database_s = ledger.cpu_s() - database_s
    return {
        **result,
        "sizes": asdict(sizes),
        "unit_costs": asdict(costs),
        "calls_to_open": calls_to_open,
        "claim_s": _percentiles(farm_result.pop("claim_s")),
        "farm": farm_result,
        "farm_calls": farm_calls,
        "predicted_farm_calls": predicted_farm,
        "lock_errors": farm_result["lock_errors"] + sum(state["lock_errors"] for state in at_end),
        "connections": connections,
        "database_cpu_s": database_s,
        "calls_per_database_cpu_s": (all_calls + farm_calls) / database_s if database_s else None,
        "whole_s": whole_s,
        "store_requests": {} if store is None else dict(store.requests() - requests),
        "store_cpu_s": _spent(store) - store_s,
        "load": list(os.getloadavg()),
    }


def _spent(store: LocalStore | None) -> float:
    return 0.0 if store is None else store.cpu_s()


async def _calibrate(server: _Server, bakes: list[str], tokens: list[str], sizes: _Sizes) -> tuple[UnitCosts, float]:
    """Unit costs of one server, and its statements to open a session, from few people that sit, then edit."""
    states = [server.read()]
    await asyncio.sleep(sizes.calibration_s)
    states.append(server.read())
    number = min(len(tokens), sizes.people)
    workplaces = [Workplace(server.port, bakes[k % len(bakes)], tokens[k]) for k in range(number)]
    async with Crowd(workplaces, _STILL) as crowd:
        states.append(server.read())
        await crowd.work(sizes.calibration_s)
        states.append(server.read())
    idle = (states[1]["cpu_s"] - states[0]["cpu_s"]) / (states[1]["time_s"] - states[0]["time_s"])
    opening_s = states[2]["time_s"] - states[1]["time_s"]
    opening = (states[2]["cpu_s"] - states[1]["cpu_s"] - idle * opening_s) / number
    still_s = states[3]["time_s"] - states[2]["time_s"]
    session = (states[3]["cpu_s"] - states[2]["cpu_s"] - idle * still_s) / (number * still_s)
    async with Crowd(workplaces, _BUSY) as crowd:
        await crowd.work(min(1.0, sizes.calibration_s))
        crowd.experience.begin()
        states.append(server.read())
        await crowd.work(sizes.calibration_s)
        states.append(server.read())
        num_frames = crowd.experience.num_frames
    busy_s = states[5]["time_s"] - states[4]["time_s"]
    sitting_s = busy_s * (idle + number * max(0.0, session))
    frame = (states[5]["cpu_s"] - states[4]["cpu_s"] - sitting_s) / max(1, num_frames)
    calls = _statements(states[1], states[2]).total() / number
    return UnitCosts(idle, max(0.0, session), max(0.0, opening), max(1e-9, frame)), calls


def _workplaces(
    servers: list[_Server], bakes: list[str], tokens: list[str], sizes: _Sizes, in_rooms: float
) -> list[Workplace]:
    """Everybody's server, bake and room, as a balancer would choose: by the bake, or by the room."""
    workplaces = []
    num_together = int(sizes.people * in_rooms) // ROOM_SIZE * ROOM_SIZE
    for person in range(sizes.people):
        if person < num_together:
            group = person // ROOM_SIZE
            server, bake, room = servers[group % len(servers)], bakes[group % len(bakes)], f"room{group:04d}" + "x" * 24
        else:
            number = person % len(bakes)
            server, bake, room = servers[number % len(servers)], bakes[number], None
        workplaces.append(Workplace(server.port, bake, tokens[person], room))
    return workplaces


def _people_result(
    before: list[dict[str, Any]], after: list[dict[str, Any]], experience: Experience, workplaces: list[Workplace],
    costs: UnitCosts, seconds: float,
) -> dict[str, Any]:  # fmt: skip
    """Costs of the servers while people worked, measured and predicted."""
    statements = sum((_statements(*pair) for pair in zip(before, after, strict=True)), Counter[str]())
    with_rooms = {workplace.port for workplace in workplaces if workplace.room is not None}
    editing = 0.0 if seconds < WRITE_INTERVAL_S else 1.0  # the audit writes at the end of its interval
    who = Population(len(before), 0, len(workplaces), len(with_rooms), editing)
    parts = calls_per_s(who)
    polled = parts["queue"]
    return {
        "seconds": seconds,
        "cpu_s": sum(last["cpu_s"] - first["cpu_s"] for first, last in zip(before, after, strict=True)),
        "predicted_cpu_s": costs.cpu_s(len(before), len(workplaces), seconds, experience.num_frames),
        "calls": statements.total(),
        "predicted_calls": total(parts) * seconds,
        "predicted_parts": {name: value * seconds for name, value in parts.items()},
        "calls_per_person_s": (statements.total() / seconds - polled) / len(workplaces),
        "statements": dict(statements),
        "population": asdict(who),
        "edits": experience.num_edits,
        "refused": experience.num_refused,
        "frames": experience.num_frames,
        "bytes_a_frame": experience.num_bytes / max(1, experience.num_frames),
        "edit_ms": {name: 1e3 * value for name, value in _percentiles(experience.edit_s).items()},
        "client_lag_ms": 1e3 * experience.loop_lag_s,
        "peak_mb": [round(state["peak_kb"] / 1024) for state in after],
    }


def _percentiles(values: list[float]) -> dict[str, float]:
    return dict(zip(("p50", "p95"), np.percentile(values or [0.0], (50, 95)).tolist(), strict=True))


def _statements(before: Mapping[str, Any], after: Mapping[str, Any]) -> Counter[str]:
    """Statements between two states of a server."""
    return Counter(after["statements"]) - Counter(before["statements"])


class _Server:
    """A server process; a context."""

    def __init__(self, data: Path, url: str) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = int(free.getsockname()[1])
        settings = {
            "DATA": str(data), "DATABASE": url, "PORT": str(self.port), "LOGIN": "true", "MAX_SESSIONS": "1000",
            "MAX_ROOMS": "1000", "PREWARM": "false", "PRELOAD_IMPORTER": "false", "ACK_SECONDS": "600",
            "REQUESTS_AT_ONCE": "100000",
        }  # fmt: skip
        self._environment = {**os.environ, **{f"RELUME_{name}": value for name, value in settings.items()}}

    def __enter__(self) -> _Server:
        command = [sys.executable, "-m", "relume_bench.scaling.server", str(_FRAME_S)]
        self._process = _start(command, self._environment)
        for _ in range(3000):
            if self._process.poll() is not None:
                raise PlanError("a simulated server did not start; see its message above")
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1).close()
                return self
            except OSError:
                time.sleep(0.02)
        raise PlanError("a simulated server did not start in a minute")

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(60)
        except subprocess.TimeoutExpired:
            self._process.kill()
        _close(self._process)

    def read(self) -> dict[str, Any]:
        """State of the process, see `relume_bench.scaling.server`."""
        return _ask(self._process)


class _Farm:
    """The process of a farm; a context."""

    def __init__(self, folder: Path, url: str, sizes: _Sizes, store: LocalStore | None) -> None:
        farm_folder = folder / ("data" if store is None else "farm")
        plan = FarmPlan(
            url, str(farm_folder), store is None, sizes.machines, sizes.bakes, sizes.tasks, sizes.task_s, 1 << 16
        )
        self._environment = {**os.environ, **({} if store is None else store.environment)}
        self._plan = json.dumps(asdict(plan))

    def __enter__(self) -> _Farm:
        self._process = _start([sys.executable, "-m", "relume_bench.scaling.farm", self._plan], self._environment)
        assert self._process.stdout is not None
        self._process.stdout.readline()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        _close(self._process)

    def begin(self) -> None:
        """Queue the bakes."""
        assert self._process.stdin is not None
        self._process.stdin.write("begin\n")
        self._process.stdin.flush()

    def result(self) -> dict[str, Any]:
        """Figures of the farm, when all bakes are ready."""
        return _answer(self._process)


def _start(command: list[str], environment: Mapping[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _close(process: subprocess.Popen[str]) -> None:
    """Wait for the end of a process, and close its pipes."""
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()


def _ask(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdin is not None
    process.stdin.write("read\n")
    process.stdin.flush()
    return _answer(process)


def _answer(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise PlanError("a simulated process ended; see its message above")
    answer: dict[str, Any] = json.loads(line)
    return answer
