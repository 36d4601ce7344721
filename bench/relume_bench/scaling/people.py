"""Simulated people: each thinks, then moves a slider in a burst of edits, over a WebSocket of its own."""

from __future__ import annotations

import asyncio
import json
import random
import struct
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass, field

from websockets.asyncio.client import ClientConnection, connect

from relume.core.errors import PlanError
from relume_bench.baked_server import SPEAKS
from relume_bench.scaling.fakes import SLIDER

ROOM_SIZE = 4
_PREFIX = 8


@dataclass(frozen=True)
class Habits:
    """Habits of a person.

    Attributes:
        think_s: mean time between bursts, exponentially distributed. burst: edits of a burst. rate: edits a second in
            it. in_rooms: fraction of people in rooms of `ROOM_SIZE`.
    """

    think_s: float = 25.0
    burst: int = 10
    rate: float = 10.0
    in_rooms: float = 0.2


@dataclass(frozen=True)
class Workplace:
    """Session of a person: port of the server, bake, token, and room if any."""

    port: int
    bake: str
    token: str
    room: str | None = None


@dataclass
class Experience:
    """Answers that all people together had.

    Attributes:
        edit_s: seconds from each edit to a frame that shows it. num_frames, num_bytes: received since `begin`.
        num_refused: edits or sessions that were refused.
    """

    edit_s: list[float] = field(default_factory=list)
    num_frames: int = 0
    num_bytes: int = 0
    num_edits: int = 0
    num_refused: int = 0
    loop_lag_s: float = 0.0

    def begin(self) -> None:
        """Forget what was before."""
        self.edit_s.clear()
        self.num_frames = self.num_bytes = self.num_edits = 0


class _Person:
    """One person with one session."""

    def __init__(self, connection: ClientConnection, habits: Habits, experience: Experience, seed: int) -> None:
        self._connection, self._habits, self._experience = connection, habits, experience
        self._random, self._revision = random.Random(seed), 0
        self._unanswered: dict[int, float] = {}

    async def read(self) -> None:
        """Acknowledge frames until canceled."""
        experience = self._experience
        while True:
            message = await self._connection.recv()
            if isinstance(message, str):
                experience.num_refused += json.loads(message)["type"] == "problem"
                continue
            (length,) = struct.unpack_from("<I", message)
            header = json.loads(message[4 : 4 + length])
            await self._send_message(type="ack", frame=header["frame"])
            now_s = time.perf_counter()
            experience.num_frames += 1
            experience.num_bytes += len(message)
            for revision in [each for each in self._unanswered if each <= header["revision"]]:
                experience.edit_s.append(now_s - self._unanswered.pop(revision))

    async def work(self) -> None:
        """Think and edit until canceled."""
        habits = self._habits
        while True:
            await asyncio.sleep(self._random.expovariate(1 / habits.think_s))
            for _ in range(habits.burst):
                await self._edit()
                await asyncio.sleep(1 / habits.rate)

    async def _edit(self) -> None:
        self._revision += 1
        self._experience.num_edits += 1
        self._unanswered[self._revision] = time.perf_counter()
        patch = [{"op": "replace", "path": SLIDER, "value": round(self._random.uniform(0.1, 0.4), 5)}]
        await self._send_message(type="edit", revision=self._revision, patch=patch, active_control=SLIDER)

    async def _send_message(self, **message: object) -> None:
        await self._connection.send(json.dumps(message))


class Crowd:
    """People with open sessions; an asynchronous context.

    Args:
        workplaces: one for each person. habits: of all. together: sessions that open at a time.
    """

    def __init__(self, workplaces: Sequence[Workplace], habits: Habits, together: int = 16) -> None:
        self._workplaces, self._habits, self._opening = workplaces, habits, asyncio.Semaphore(together)
        self.experience = Experience()
        self._people: list[_Person] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Crowd:
        await asyncio.gather(*(self._open(workplace, seed) for seed, workplace in enumerate(self._workplaces)))
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._tasks:
            task.cancel()
        await self._stack.aclose()

    async def _open(self, workplace: Workplace, seed: int) -> None:
        prefix = "" if workplace.room is None else f"?room_prefix={workplace.room[:_PREFIX]}"
        url = f"ws://127.0.0.1:{workplace.port}/api/bakes/{workplace.bake}/session{prefix}"
        headers = {"Authorization": f"Bearer {workplace.token}"}
        room = {} if workplace.room is None else {"room": workplace.room}
        options = {"max_size": None, "compression": None, "open_timeout": 60, "ping_interval": None, "proxy": None}
        async with self._opening:
            connection = await connect(url, subprotocols=[SPEAKS], additional_headers=headers, **options)  # type: ignore[arg-type]
            self._stack.push_async_callback(connection.close)
            await connection.send(json.dumps({"type": "open", **room}))
            person = _Person(connection, self._habits, self.experience, seed)
            self._tasks.append(asyncio.create_task(person.read()))
            self._people.append(person)
            start_s, before = time.perf_counter(), self.experience.num_frames
            while self.experience.num_frames == before and time.perf_counter() < start_s + 10:
                await asyncio.sleep(0.02)

    async def work(self, seconds: float) -> None:
        """Let everybody work. Raises PlanError if a session ended."""
        working = [asyncio.create_task(person.work()) for person in self._people]
        until_s = time.perf_counter() + seconds
        while time.perf_counter() < until_s:
            start_s = time.perf_counter()
            await asyncio.sleep(0.1)
            self.experience.loop_lag_s = max(self.experience.loop_lag_s, time.perf_counter() - start_s - 0.1)
        for task in working:
            task.cancel()
        ended = [task for task in self._tasks if task.done()]
        if ended:
            raise PlanError(f"{len(ended)} sessions ended: {ended[0].exception()}")
