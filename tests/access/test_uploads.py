"""Uploads reserve space before their bodies are read and while they unpack; one user cannot use another's space."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from server_fakes import tiny_scene
from starlette.types import Message, Receive, Scope, Send

from relume.assets.environments.environment import Environment
from relume.core.folder_size import folder_bytes
from relume.scene.scene_folder import make_scene
from relume_server.auth import quotas as quotas_module
from relume_server.auth.reservations import Reservation
from relume_server.auth.roles import KEY, Caller, Role
from relume_server.auth.services import AuthServices
from relume_server.errors import NearlyFullError
from relume_server.io import upload_middleware
from relume_server.io.fair_slots import Slots
from relume_server.io.import_processes import ImportTooLargeError
from relume_server.io.import_request import ImportRequest, _write_scene
from relume_server.io.upload_middleware import UploadMiddleware
from relume_server.settings import Settings
from relume_worker.jobs.job import QuotaError

Bearer = Callable[..., dict[str, str]]
SCENE = {"scene": ("triangle.glb", b"which nobody reads")}
CALLER = Caller("Ann", Role.EDIT, "", "token")


def some_scene(request: ImportRequest) -> str:
    """Each name gives another scene."""
    scene = tiny_scene(request.name)
    light = Environment("gray", np.full((4, 8, 3), float(request.name.removeprefix("n")), np.float32))
    return _write_scene(request, make_scene(request.name, scene.meshes, scene.materials, scene.cameras, light))


@pytest.fixture
def _imports(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client.app.state.services.import_queue.importers, "run", some_scene)


class Body:
    """A request body in pieces, and the response."""

    def __init__(self, app: Callable[..., Any], pieces: list[bytes], length: int | None = None) -> None:
        headers = [] if length is None else [(b"content-length", str(length).encode())]
        self.scope = {
            "type": "http", "method": "POST", "path": "/api/scenes", "query_string": b"", "headers": headers,
            KEY: CALLER,
        }  # fmt: skip
        self.pieces, self.num_read, self.sent = pieces, 0, list[Message]()
        self._app = app

    async def __call__(self) -> int:
        await self._app(self.scope, self._receive, self._send)
        return int(self.sent[0]["status"])

    async def _receive(self) -> Message:
        self.num_read += 1
        left = self.num_read < len(self.pieces)
        return {"type": "http.request", "body": self.pieces[self.num_read - 1], "more_body": left}

    async def _send(self, message: Message) -> None:
        self.sent.append(message)


async def read_all(scope: Scope, receive: Receive, send: Send) -> None:
    """A route that reads the whole body and turns any error into its own response, as FastAPI does."""
    try:
        while (await receive())["more_body"]:
            pass
        status = 201
    except Exception:
        status = 400
    await send({"type": "http.response.start", "status": status, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def upload_middleware_for(access: AuthServices, app: Callable[..., Any] = read_all, each: int = 8) -> UploadMiddleware:
    return UploadMiddleware(app, access=lambda: access, max_per_user=each, weights={})


class TestBodies:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.max_bytes_per_user = 100_000
        return settings

    def test_body_with_too_large_content_length_is_not_read(self, access: AuthServices) -> None:
        body = Body(upload_middleware_for(access), [b"x"], length=100_001)
        assert run_in_thread(body()) == 429
        assert body.num_read == 0
        assert access.quotas.used_bytes("Ann") == 0

    def test_body_without_content_length_is_read_up_to_the_quota(
        self, access: AuthServices, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(upload_middleware, "STEP_BYTES", 10_000)
        body = Body(upload_middleware_for(access), [b"x" * 10_000] * 50)
        assert run_in_thread(body()) == 429
        assert body.num_read <= 10
        assert access.quotas.used_bytes("Ann") == 0

    def test_concurrent_bodies_share_the_quota(self, access: AuthServices) -> None:
        reading = asyncio.Event()
        waiting: list[bool] = []

        async def slow(scope: Scope, receive: Receive, send: Send) -> None:
            waiting.append(True)
            await reading.wait()
            await read_all(scope, receive, send)

        async def all_at_once() -> list[int]:
            whole = upload_middleware_for(access, slow)
            tasks = [asyncio.create_task(Body(whole, [b"x"], length=30_000)()) for _ in range(5)]
            while sum(task.done() for task in tasks) < 2 or len(waiting) < 3:
                await asyncio.sleep(0)
            assert access.quotas.used_bytes("Ann") == 90_000
            reading.set()
            return sorted(await asyncio.gather(*tasks))

        assert run_in_thread(all_at_once()) == [201, 201, 201, 429, 429]
        assert access.quotas.used_bytes("Ann") == 0

    def test_concurrent_uploads_per_user_are_limited(self, access: AuthServices) -> None:
        now, peak = [0], [0]

        async def slow(scope: Scope, receive: Receive, send: Send) -> None:
            now[0] += 1
            peak[0] = max(peak[0], now[0])
            await asyncio.sleep(0.01)
            now[0] -= 1
            await read_all(scope, receive, send)

        async def all_at_once() -> list[int]:
            whole = upload_middleware_for(access, slow, each=2)
            return list(await asyncio.gather(*(Body(whole, [b"x"], length=1)() for _ in range(6))))

        assert run_in_thread(all_at_once()) == [201] * 6
        assert peak == [2]

    def test_disconnected_client_releases_its_reservation(self, access: AuthServices) -> None:
        async def disconnect(scope: Scope, receive: Receive, send: Send) -> None:
            assert access.quotas.used_bytes("Ann") == 5
            raise asyncio.CancelledError

        with pytest.raises(asyncio.CancelledError):
            run_in_thread(Body(upload_middleware_for(access, disconnect), [b"x"], length=5)())
        assert access.quotas.used_bytes("Ann") == 0


@pytest.mark.usefixtures("_imports")
class TestUnpacking:
    def test_ten_concurrent_imports_stay_within_the_quota(
        self, client: TestClient, bearer: Bearer, access: AuthServices, settings: Settings
    ) -> None:
        ann = bearer("edit", "Ann")

        def send(number: int) -> int:
            return client.post("/api/scenes", files=SCENE, data={"name": f"n{number}"}, headers=ann).status_code

        assert send(0) == 201
        scene_bytes = access.quotas.used_bytes("Ann")
        settings.max_bytes_per_user = int(3.5 * scene_bytes) + 1_000
        with ThreadPoolExecutor(10) as threads:
            answers = [*threads.map(send, range(1, 11))]
        assert sorted({*answers}) == [201, 429]
        stored_bytes = folder_bytes(settings.data / "scenes")
        assert scene_bytes < stored_bytes <= settings.max_bytes_per_user
        assert access.quotas.used_bytes("Ann") == stored_bytes
        assert not list(settings.data.glob("upload-*"))

    def test_unpacking_stops_at_the_remaining_quota(
        self,
        client: TestClient,
        bearer: Bearer,
        access: AuthServices,
        settings: Settings,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        asked: list[int] = []

        def unpack(request: ImportRequest) -> str:
            asked.append(request.max_file_bytes)
            raise ImportTooLargeError("too large")

        settings.max_bytes_per_user = 5_000
        access.quotas.assign_owner("Ann", "scene", "another", 3_000)
        monkeypatch.setattr(client.app.state.services.import_queue.importers, "run", unpack)
        refused = client.post("/api/scenes", files=SCENE, headers=bearer("edit", "Ann"))
        assert (refused.status_code, asked) == (429, [2_000])
        assert "unpacks to more than the 2 kB" in refused.json()["detail"]
        assert access.quotas.used_bytes("Ann") == 3_000


class TestDisk:
    @pytest.fixture(autouse=True)
    def _disk(self, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
        settings.min_free_bytes = 1_000
        for name in ("quotas", "reservations"):
            monkeypatch.setattr(f"relume_server.auth.{name}.free_bytes", lambda _: 10_000)

    def test_uploads_leave_disk_space_for_the_ledger(self, access: AuthServices) -> None:
        quotas = access.quotas
        ann, bob = Reservation(quotas, "Ann"), Reservation(quotas, "Bob")
        ann.reserve(3_000)
        with pytest.raises(NearlyFullError, match="besides other uploads"):
            bob.reserve(3_000)
        bob.reserve(1_000)
        ann.release()
        bob.reserve(4_000)

    def test_imports_leave_disk_space_for_the_ledger(self, access: AuthServices) -> None:
        reservation = Reservation(access.quotas, "Ann")
        assert reservation.max_import_bytes() == (10_000 - 1_000) // 2  # another import may unpack at the same time
        assert isinstance(reservation.too_large_error(4_500), NearlyFullError)

    def test_reservations_of_a_killed_server_expire(
        self, access: AuthServices, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        Reservation(access.quotas, "Ann").reserve(4_000)
        assert access.quotas.used_bytes("Ann") == 4_000
        monkeypatch.setattr(quotas_module.time, "time", lambda: 1e10)
        Reservation(access.quotas, "Bob").reserve(4_000)
        assert access.quotas.used_bytes("Ann") == 0

    def test_reservation_remains_when_an_increase_is_rejected(self, access: AuthServices, settings: Settings) -> None:
        settings.max_bytes_per_user = 2_000
        reservation = Reservation(access.quotas, "Ann")
        reservation.reserve(1_500)
        with pytest.raises(QuotaError, match=r"you have 0 bytes of at most 2 kB, and this takes 2.5 kB"):
            reservation.reserve(2_500)
        assert (reservation.bytes, access.quotas.used_bytes("Ann")) == (1_500, 1_500)


class TestSlots:
    def order_of(self, slots: Slots, who: str) -> str:
        """The order in which waiting clients get the slot of the first one."""
        got: list[str] = []

        async def take(client: str) -> None:
            async with slots.acquire(client):
                got.append(client)
                await asyncio.sleep(0)

        async def run_all() -> None:
            await asyncio.gather(*map(take, who))

        run_in_thread(run_all())
        return "".join(got)

    def test_slots_alternate_between_users(self) -> None:
        assert self.order_of(Slots(1, 1, {}), "aaaabb") == "ababaa"

    def test_one_user_cannot_take_every_slot(self) -> None:
        assert self.order_of(Slots(2, 1, {}), "aab") == "aba"

    def test_canceled_waiter_releases_the_slot(self) -> None:
        async def cancel_waiter() -> None:
            slots = Slots(1, 1, {})
            async with slots.acquire("a"):
                waiting = asyncio.create_task(slots.acquire("b").__aenter__())
                await asyncio.sleep(0)
                waiting.cancel()
                await asyncio.gather(waiting, return_exceptions=True)
            async with slots.acquire("c"):
                pass

        run_in_thread(cancel_waiter())
