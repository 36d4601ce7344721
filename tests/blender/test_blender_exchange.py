"""A send that fails or is canceled leaves no new scene on the server."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

from relume_blender.background_task import BackgroundTask
from relume_blender.exchange import BakeSettings, send
from relume_blender.glb import Glb
from relume_blender.snapshot import Snapshot
from relume_client import AsyncClient, JobFailedError

SNAPSHOT = Snapshot("Scene", Glb({}, b""), Path("w.exr"), {"lights": {}}, ("cam",), {}, {}, "key", "world", ())


class FakeServer:
    """Scenes by id; `upload` and `wait` run within an import and a bake."""

    id = "new"

    def __init__(self, upload: Callable[[], Any], wait: Callable[[], Any], former: tuple[str, ...] = ()) -> None:
        self.names = [*former]
        self._upload, self._wait, self._former = upload, wait, former
        self.recipe: dict[str, Any] = {}

    async def scenes(self) -> list[Any]:
        return [type("SceneEntry", (), {"id": name}) for name in self.names]

    async def import_scene(self, path: Path, **options: Any) -> FakeServer:
        assert path.read_bytes()[:4] == b"glTF"
        await self._upload()
        self.names.append("new")
        return self

    async def bake(self, method: str, **options: Any) -> FakeServer:
        self.recipe = {"method": method, **options}
        return self

    async def wait(self, progress: Any) -> None:
        progress({"progress": 0.5})
        await self._wait()

    async def delete(self) -> None:
        self.names.remove("new")


def running(server: FakeServer) -> BackgroundTask[Any]:
    client = cast(AsyncClient, server)
    return BackgroundTask(lambda report: send(client, "http://a", SNAPSHOT, BakeSettings(), report))


async def nothing() -> None:
    return None


@pytest.mark.parametrize("moment", ["upload", "bake"])
def test_canceled_send_leaves_nothing(moment: str) -> None:
    started, released = threading.Event(), threading.Event()

    async def pause() -> None:
        started.set()
        while not released.is_set():
            await asyncio.sleep(0.01)

    upload, wait = (pause, nothing) if moment == "upload" else (nothing, pause)
    server = FakeServer(upload, wait)
    task = running(server)
    assert started.wait(10)
    task.cancel()
    released.set()
    with pytest.raises(asyncio.CancelledError):
        task.result()
    assert server.names == []
    assert task.text == "Canceling"


@pytest.mark.parametrize("former", [(), ("new",)])
def test_failed_bake_deletes_only_a_new_scene(former: tuple[str, ...]) -> None:
    async def fail() -> None:
        raise JobFailedError("too many lights")

    server = FakeServer(nothing, fail, former)
    with pytest.raises(JobFailedError, match="too many lights"):
        running(server).result()
    assert server.names == [*former, *(["new"] if former else [])]
    assert server.recipe == {"method": "gather", "preset": "good", "views": ("cam",)}
