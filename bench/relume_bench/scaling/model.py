"""The capacity model: what people, servers and worker machines cost the ledger and the cores. See docs/scaling.md.

Intervals are those of the code; unit costs are measured by `relume_bench.scaling.simulation` and `.unit_costs`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from relume_server.auth.tokens import TOKEN_CACHE_S
from relume_server.collaboration.comment_sync import POLL_INTERVAL_S as COMMENT_POLL_S
from relume_server.collaboration.room_lease import RENEW_INTERVAL_S
from relume_server.runtime.shared_poll import JITTER
from relume_server.session.audit_edits import WRITE_INTERVAL_S
from relume_server.session.frames.bake_updates import POLL_S as SCENE_POLL_S
from relume_worker.jobs.job_service import POLL_INTERVAL_S as JOB_POLL_S
from relume_worker.lease import HEARTBEAT_S, RENEW_S

_MEAN_INTERVAL = 1 - JITTER / 2
CALLS_PER_BAKE, CALLS_PER_TASK = 28, 4
"""Claim, expected work, start, phases, publishing and end; of a task: renew the lease, read and write its row, record
progress.
"""


@dataclass(frozen=True)
class Population:
    """Who uses one ledger at a time.

    Attributes:
        servers: server processes. machines: of a farm. people: with a session each. servers_with_rooms: of the servers.
        editing: fraction of the people that edit at least once a minute.
    """

    servers: int
    machines: int
    people: int
    servers_with_rooms: int
    editing: float = 1.0


def calls_per_s(who: Population) -> dict[str, float]:
    """Statements a second, without opening sessions and without bakes, by cause."""
    return {
        "queue": (who.servers + who.machines) / JOB_POLL_S,
        "bakes of open scenes": who.servers / (_MEAN_INTERVAL * SCENE_POLL_S),
        "tokens": who.servers / (_MEAN_INTERVAL * TOKEN_CACHE_S),
        "rooms": who.servers_with_rooms * (3 / RENEW_INTERVAL_S + 1 / COMMENT_POLL_S),
        "audit": who.people * who.editing / WRITE_INTERVAL_S,
    }


def bake_calls(num_tasks: int, seconds: float) -> float:
    """Statements of one bake. seconds: from claim to ready."""
    return CALLS_PER_BAKE + CALLS_PER_TASK * num_tasks + seconds * (1 / HEARTBEAT_S + 1 / RENEW_S)


@dataclass(frozen=True)
class UnitCosts:
    """Processor seconds of a server: for each second, for each second of a session, to open one, for a frame."""

    idle: float
    session: float
    opening: float
    frame: float

    def cpu_s(self, servers: int, people: int, seconds: float, num_frames: int) -> float:
        """Processor seconds of all servers while nobody opens a session.

        Args:
            servers: number of servers. people: number of people. seconds: duration. num_frames: frames of all people.
        """
        return seconds * (servers * self.idle + people * self.session) + num_frames * self.frame


def people_per_core(costs: UnitCosts, frames_per_s: float, use: float = 0.7) -> float:
    """People that a core serves.

    Args:
        costs: of the server. frames_per_s: of a person, on average. use: of the core; above it, queues grow.
    """
    return use / (costs.session + frames_per_s * costs.frame)


def people_per_database(calls_per_person_s: float, calls_per_core_s: float, cores: int, use: float = 0.7) -> float:
    """People that a database serves.

    Args:
        calls_per_person_s: statements per second of a person. calls_per_core_s: statements per second of a core.
        cores: cores of the database. use: used part of the cores; above it, queues grow.
    """
    return use * cores * calls_per_core_s / calls_per_person_s


def total(parts: Mapping[str, float]) -> float:
    """Sum of all causes."""
    return sum(parts.values())
