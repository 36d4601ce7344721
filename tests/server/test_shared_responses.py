"""Large responses, thumbnails and events: concurrent requests share one computation, and slow clients delay nobody."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from session_client import Baked

from relume.core.cache import Cache
from relume.core.filesystem import atomic_write
from relume_server.io import streamed_responses as answers_module
from relume_server.io.streamed_responses import StreamedResponses
from relume_server.runtime.single_flight import SingleFlight


async def sent(response: Any) -> bytes:
    return b"".join([piece async for piece in response.body_iterator])


class TestAnswers:
    @pytest.fixture
    def answers(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
        monkeypatch.setattr(answers_module, "PIECE_BYTES", 1_000)
        with closing(StreamedResponses(tmp_path)) as new_answers:
            yield new_answers

    def test_slow_readers_share_one_file_that_is_deleted_after_them(
        self, answers: StreamedResponses, tmp_path: Path
    ) -> None:
        made: list[int] = []
        content = np.arange(10_000, dtype="<f4").reshape(-1, 4)

        def make() -> np.ndarray[Any, Any]:
            made.append(1)
            return content

        async def scenario() -> None:
            slow = [await answers.stream("points", make, "application/octet-stream", {}) for _ in range(60)]
            first = [await anext(response.body_iterator) for response in slow]
            assert {len(piece) for piece in first} == {1_000}
            assert slow[0].headers["content-length"] == "40000"
            assert [first[0] + await sent(slow[0]), first[59] + await sent(slow[59])] == 2 * [content.tobytes()]
            for response in slow:
                await response.body_iterator.aclose()
            slow.clear()
            again = await answers.stream("points", make, "application/octet-stream", {})
            assert await sent(again) == content.tobytes()

        run_in_thread(scenario())
        assert len(made) == 2  # the first was deleted with its last reader
        assert list(tmp_path.iterdir()) == []

    def test_early_requests_wait_for_the_same_computation(self, answers: StreamedResponses) -> None:
        made: list[int] = []
        may_end = threading.Event()

        def make() -> bytes:
            made.append(1)
            may_end.wait()
            return b"it"

        async def scenario() -> list[bytes]:
            asking = [asyncio.create_task(answers.stream("it", make, "text/plain", {})) for _ in range(5)]
            while not made:
                await asyncio.sleep(0)
            may_end.set()
            return [await sent(response) for response in await asyncio.gather(*asking)]

        assert run_in_thread(scenario()) == [b"it"] * 5
        assert made == [1]

    def test_failures_are_reported_and_retried(self, answers: StreamedResponses) -> None:
        async def scenario() -> bytes:
            with pytest.raises(ZeroDivisionError):
                await answers.stream("it", lambda: bytes(1 // 0), "text/plain", {})
            return await sent(await answers.stream("it", lambda: b"", "text/plain", {}))

        assert run_in_thread(scenario()) == b""


class TestOnce:
    def test_canceled_request_does_not_cancel_the_others(self) -> None:
        may_end, made = threading.Event(), list[int]()

        def work() -> int:
            made.append(1)
            may_end.wait()
            return 7

        async def scenario() -> int:
            once = SingleFlight(1, "test")
            first, second = (asyncio.create_task(once.run("it", work)) for _ in range(2))
            while not made:
                await asyncio.sleep(0)
            first.cancel()
            may_end.set()
            result = await second
            once.close()
            return result

        assert (run_in_thread(scenario()), made) == (7, [1])

    def test_failure_without_waiters_logs_no_warning(self, caplog: pytest.LogCaptureFixture) -> None:
        async def scenario() -> None:
            once, begun = SingleFlight(1, "test"), threading.Event()
            asking = asyncio.create_task(once.run("it", lambda: begun.wait() and 1 // 0))
            await asyncio.sleep(0)
            asking.cancel()
            begun.set()
            await asyncio.gather(asking, return_exceptions=True)
            once.close()
            await asyncio.sleep(0)

        run_in_thread(scenario())
        assert caplog.records == []


class TestThumbnails:
    def test_eight_requests_render_one_thumbnail_and_do_not_delay_joining_a_room(
        self, client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        services: Any = client.app.state.services  # type: ignore[attr-defined]
        may_end, painted = threading.Event(), list[str]()

        def paint(bake: str, *, is_first: bool) -> None:
            painted.append(bake)
            may_end.wait()
            services.thumbnails.path(bake).parent.mkdir(exist_ok=True)
            with atomic_write(services.thumbnails.path(bake)) as path:  # requests still arrive
                path.write_bytes(b"it")

        monkeypatch.setattr(services.thumbnails, "paint", paint)
        url = f"/api/scenes/{baked.scene}/thumbnail.webp"
        with ThreadPoolExecutor(8) as threads:
            asking = [threads.submit(client.get, url) for _ in range(8)]
            while not painted:
                pass
            assert client.portal is not None
            entered = client.portal.start_task_soon(_enter, services.live.room_lease)
            assert entered.result(60)
            assert not any(each.done() for each in asking)
            may_end.set()
            assert [each.result().content for each in asking] == [b"it"] * 8
        assert painted == [baked.bake]

    def test_leases_have_their_own_threads(
        self, client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """All threads for slow work are busy, and so are those of the loop and of the routes."""
        services: Any = client.app.state.services  # type: ignore[attr-defined]
        may_end = threading.Event()

        async def crowd() -> list[asyncio.Future[Any]]:
            loop = asyncio.get_running_loop()
            slow = [loop.run_in_executor(None, may_end.wait) for _ in range(100)]
            return slow + [loop.run_in_executor(services.threads.long, may_end.wait) for _ in range(100)]

        assert client.portal is not None
        client.portal.call(crowd)
        try:
            assert client.portal.start_task_soon(_enter, services.live.room_lease).result(60)
        finally:
            may_end.set()


async def _enter(rooms: Any) -> bool:
    async with rooms.hold("a room"):
        return True


def test_result_larger_than_the_cache_is_computed_once_for_concurrent_requests() -> None:
    memory, made = Cache(10), list[int]()
    begun, may_end = threading.Event(), threading.Event()

    def make() -> np.ndarray[Any, Any]:
        made.append(1)
        begun.set()
        may_end.wait()
        return np.zeros(100)

    with ThreadPoolExecutor(4) as threads:
        asking = [threads.submit(memory.get_value, ("scene", "finder"), make) for _ in range(4)]
        begun.wait()
        while len(threads._threads) < 4 or memory._state.computations[("scene", "finder")] is None:
            pass
        threading.Event().wait(0.2)  # all wait at the lock; a late one may compute it again
        may_end.set()
        identities = {id(each.result()) for each in asking}
    assert len(identities) == 1
    assert made == [1]
    memory.get_value(("scene", "finder"), make)
    assert made == [1, 1]  # it was not cached
