"""Idle bakes are evicted, bakes in use are not, and an evicted bake reopens unchanged."""

import asyncio
import gc
import threading
import time
import weakref
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from coroutines import run_in_thread
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from session_client import open_session
from tiny_scenes import still_life

from relume.core.memory_usage import live_bytes
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume_server.app import create_app
from relume_server.runtime.bake_pool import TransferPool
from relume_server.settings import Settings
from relume_worker.scenes import register_scene

SIGMA = "/materials/Ball/terms/1/params/sigma"
IDLE_S, FLOOR_BYTES = 60.0, 2_000_000  # room for one operator: the last used entry stays
NUM_SCENES = 3
CURVE = "/materials/Ball/terms/1/curves/theta_h"


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def real_client(tmp_path: Path, clock: Clock) -> Iterator[TestClient]:
    settings = Settings(data=tmp_path, allowed_hosts=["testserver"], idle_seconds=IDLE_S, cache_floor_bytes=FLOOR_BYTES)
    with TestClient(create_app(settings, clock=clock)) as client:
        yield client


def go_round(client: TestClient) -> None:
    client.portal.call(client.app.state.services.cache_evictor.run_once)


def bake_scenes(client: TestClient, num_scenes: int = NUM_SCENES) -> list[str]:
    """Bakes of scenes that differ in the color of the ball."""
    bakes, base, bake_ids = client.app.state.services.bakes, still_life(), []
    for number in range(num_scenes):
        ball = base.materials[2]
        diffuse = {"model": "lambert", "color": [0.1 * number, 0.05, 0.05]}
        materials = [*base.materials[:2], replace(ball, terms=(diffuse, *ball.terms[1:]))]
        scene = make_scene(f"still life {number}", base.meshes, materials, base.cameras, base.environment)
        register_scene(bakes.data_dir, bakes.ledger, scene)
        bake_ids.append(bakes.submit(scene.id, Recipe("direct", ("front",), (48, 32), 60)))
    for bake in bake_ids:
        with bakes.subscribe(bake) as changes:
            assert list(changes)[-1].state == "ready"
    return bake_ids


def look_at(client: TestClient, bake: str) -> bytes:
    """Exact picture of a bake after one of its curves was frozen and edited."""
    with open_session(client, bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=CURVE)
        # shading sums in another order: the last bits would differ
        session.wait_until_ready("Ball, half angle θh")
        session.edit(1, SIGMA, 0.3, control=SIGMA)
        return session.exact(1).payload


def gauges(client: TestClient) -> dict[str, float]:
    """Each sample of /metrics by its name, or by its component if it has one."""
    families = text_string_to_metric_families(client.get("/metrics").text)
    return {s.labels.get("component", s.name): s.value for family in families for s in family.samples}


def cache_bytes(client: TestClient) -> dict[tuple[str, str], float]:
    """Cached bytes by kind and bake."""
    families = text_string_to_metric_families(client.get("/metrics").text)
    samples = [sample for family in families for sample in family.samples if sample.name == "relume_cache_bytes"]
    return {(s.labels["kind"], s.labels["bake"]): s.value for s in samples}


def test_metrics_show_cache_bytes_by_bake(real_client: TestClient) -> None:
    bakes = bake_scenes(real_client, 2)
    for bake in bakes:
        look_at(real_client, bake)
    entries = cache_bytes(real_client)
    assert {(kind, bake) for kind in ("linear operator", "shaded term") for bake in bakes} <= set(entries)
    assert all(num_bytes > 0 for num_bytes in entries.values())
    assert sum(entries.values()) == gauges(real_client)["cache"]


@pytest.mark.slow
def test_thumbnail_of_another_version_is_rendered_again(
    real_client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bake_scenes(real_client, 1)
    address = real_client.get("/api/scenes").json()[0]["thumbnail"]
    assert real_client.get(address).status_code == 200
    (before,) = (tmp_path / "thumbnails").iterdir()
    monkeypatch.setattr("relume_server.batch.thumbnails.image_code", lambda: "0123456789abcdef")
    assert real_client.get(address).status_code == 200
    (after,) = (tmp_path / "thumbnails").iterdir()
    assert after != before


def test_idle_bakes_are_evicted(real_client: TestClient, clock: Clock) -> None:
    pool = real_client.app.state.services.transfers
    bakes = bake_scenes(real_client)
    pictures = [look_at(real_client, bake) for bake in bakes]
    go_round(real_client)
    references = [weakref.ref(transfer) for transfer in pool.open_bakes]
    before = gauges(real_client)
    assert references
    assert before["open_bakes"] > 0
    assert before["cache"] == before["relume_frozen_cache_bytes"] > FLOOR_BYTES
    assert before["process_resident_memory_bytes"] > before["open_bakes"]

    clock.now += IDLE_S + 1
    go_round(real_client)
    gc.collect()
    assert [ref() for ref in references] == [None] * len(references)
    after = gauges(real_client)
    assert after["open_bakes"] == 0
    assert 0 < after["cache"] <= FLOOR_BYTES

    assert [look_at(real_client, bake) for bake in bakes] == pictures


def test_bakes_in_use_are_not_evicted(real_client: TestClient, clock: Clock) -> None:
    shown, left = bake_scenes(real_client, 2)
    look_at(real_client, left)
    with open_session(real_client, shown) as session:
        session.send_message(type="prepare", curve=CURVE)
        session.edit(1, "/materials/Ball/terms/1/params/sigma", 0.3)
        session.exact(1)
        (transfer,) = [
            open_bake for open_bake in real_client.app.state.services.transfers.open_bakes if shown in open_bake.key
        ]
        clock.now += 100 * IDLE_S
        go_round(real_client)
        assert real_client.app.state.services.transfers.open_bakes == [transfer]
        assert gauges(real_client)["cache"] > FLOOR_BYTES
        session.edit(2, "/materials/Ball/terms/1/params/sigma", 0.25)
        session.exact(2)
    clock.now += IDLE_S - 1
    go_round(real_client)
    assert real_client.app.state.services.transfers.open_bakes == [transfer]


@pytest.mark.slow
def test_comparisons_and_renders_continue_during_eviction(real_client: TestClient, clock: Clock) -> None:
    bake = bake_scenes(real_client)[0]
    comparison = real_client.post("/api/comparisons", json={"bake": bake, "view": "front", "passes": 2}).headers[
        "location"
    ]
    request = {"bake": bake, "view": "front", "format": "png", "looks": [{"display": {"exposure": 1.0}}] * 2}
    render = real_client.post("/api/renders", json=request).headers["location"]
    works = [comparison, render]
    for _ in range(6000):
        clock.now += IDLE_S + 1
        go_round(real_client)
        states = [real_client.get(work).json()["state"] for work in works]
        if not {"queued", "running"} & set(states):
            break
        time.sleep(0.02)
    assert states == ["ready", "ready"]
    assert real_client.app.state.services.transfers.open_bakes == []


def test_bake_opened_during_eviction_is_kept() -> None:
    """At any point of opening and closing, every caller gets a transfer, and concurrent users share it."""
    clock, may_open, opened = Clock(), threading.Event(), []

    def open_transfer(path: Path) -> Any:
        may_open.wait(30)
        opened.append(object())
        return opened[-1]

    async def use(pool: TransferPool, may_leave: asyncio.Event) -> Any:
        async with pool.acquire("one", Path("one")) as transfer:
            await may_leave.wait()
            return transfer

    async def run() -> None:
        with ThreadPoolExecutor(2) as executor:
            pool, may_leave = TransferPool(open_transfer, executor, IDLE_S, clock), asyncio.Event()
            first = asyncio.create_task(use(pool, may_leave))
            await asyncio.sleep(0)
            clock.now += 2 * IDLE_S
            assert pool.release() == (0, {Path("one")})  # it is being opened
            may_open.set()
            second = asyncio.create_task(use(pool, may_leave))
            await asyncio.sleep(0)
            may_leave.set()
            assert await first is await second is opened[0]
            clock.now += IDLE_S - 1
            assert pool.release() == (0, {Path("one")})
            clock.now += 2
            assert pool.release() == (1, set())
            assert await use(pool, may_leave) is opened[1]

    run_in_thread(run())
    assert len(opened) == 2


def test_shared_objects_are_counted_once() -> None:
    array = np.zeros(1000, np.float64)
    views = {"a": array, "b": [array[10:], array.reshape(10, 100)], "own": np.ones(5, np.uint8)}
    assert live_bytes(views) == array.nbytes + 5
    assert live_bytes(lambda: views) == array.nbytes + 5


def test_memory_mapped_files_are_not_counted(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros(1000))
    assert live_bytes(np.load(tmp_path / "map.npy", mmap_mode="r").view(np.ndarray)) == 0
