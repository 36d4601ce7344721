"""load.aggregate_ratio: total frames per second of 1 … 64 dragging sessions, lowest ÷ best. load.frame_cost_ratio: the
server's processor time per frame, least ÷ most over the same numbers of sessions.

A real server in its own process; the clients of all sessions are in this one (`relume_bench.slider_clients`). All
sessions are on one bake: with one slider, so that all use one operator, and with four sliders. Numbers of sessions
alternate, round after round; the ratios are of medians. The cost of a frame hardly depends on other load, and shows
whether sessions disturb each other; the rate depends on it.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.client import connect

from relume.assets.environments.studio import studio
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import OPENING, SPEAKS, BakedFolder, Server, baked_folder, serving
from relume_bench.figure import Figure
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_bench.slider_clients import SliderClient

_NAMES = ("load.aggregate_ratio", "load.frame_cost_ratio")
_SLIDERS = tuple(
    (f"/materials/{material}/terms/1/params/{name}", span)
    for name, span in (("sigma", (0.1, 0.4)), ("ior", (1.3, 2.5)))
    for material in ("Teapot", "Table")
)
_WARM_S = 1.0


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, drag with increasing numbers of clients."""
    size, num_lights, rounds, seconds = ((64, 64), 60, 1, 0.3) if tiny else ((640, 480), 1000, 5, 2.0)
    numbers = (1, 2) if tiny else (1, 2, 4, 8, 16, 32, 64)
    glossy_terms = (LAMBERT, cook_torrance(0.2))
    scene = teapot_on_table(studio(), glossy_terms, glossy_terms)
    settings = {"RELUME_MAX_SESSIONS": "256"}  # sessions that have just left still count
    variants = {"one_operator": (_SLIDERS[:1], numbers), "several": (_SLIDERS, tuple(n for n in numbers if n > 2))}
    results: dict[tuple[str, int], list[tuple[float, float]]] = {}
    with (
        baked_folder(scene, Recipe("direct", ("front",), size, num_lights)) as data_folder,
        serving(data_folder, settings) as server,
    ):
        asyncio.run(_prepare_curves(server, data_folder))
        for _ in range(rounds):
            for kind, (sliders, some) in variants.items():
                for number in some:
                    rates = asyncio.run(_measure_drag(server, data_folder, sliders, number, seconds))
                    results.setdefault((kind, number), []).append(rates)
    ratios: list[NDArray[np.float64]] = []
    context: dict[str, object] = {}
    for kind, (_, some) in variants.items():
        medians = np.array([np.median(results[kind, number], axis=0) for number in some]).reshape(-1, 2)
        if len(medians):
            ratios.append(medians.min(axis=0) / medians.max(axis=0))
        context |= {f"{kind}_fps": medians[:, 0].tolist(), f"{kind}_ms_a_frame": medians[:, 1].tolist()}
    context |= {"sessions": list(numbers), "rounds": rounds, "seconds": seconds, "size": list(size)}
    return [
        Figure(name, float(ratio), "ratio", context) for name, ratio in zip(_NAMES, np.min(ratios, axis=0), strict=True)
    ]


async def _prepare_curves(server: Server, data_folder: BakedFolder) -> None:
    """Do one-time work: default images, and the operator of each slider."""
    async with _open_slider_clients(server, data_folder, _SLIDERS, len(_SLIDERS)) as slider_clients:
        for slider_client in slider_clients:
            await slider_client.drag()
            await asyncio.sleep(_WARM_S)
            await slider_client.release()


async def _measure_drag(
    server: Server,
    data_folder: BakedFolder,
    sliders: Sequence[tuple[str, tuple[float, float]]],
    number: int,
    seconds: float,
) -> tuple[float, float]:
    """Total frames per second of so many clients, and the server's processor time per frame in milliseconds."""
    async with _open_slider_clients(server, data_folder, sliders, number) as slider_clients:
        await asyncio.gather(*(slider_client.drag() for slider_client in slider_clients))
        await asyncio.sleep(min(_WARM_S, seconds))
        frames, spent_s, start_time = _frames(slider_clients), _spent_s(server), time.perf_counter()
        await asyncio.sleep(seconds)
        frames, spent_s = _frames(slider_clients) - frames, _spent_s(server) - spent_s
        return frames / (time.perf_counter() - start_time), 1e3 * spent_s / max(1, frames)


@asynccontextmanager
async def _open_slider_clients(
    server: Server, data_folder: BakedFolder, sliders: Sequence[tuple[str, tuple[float, float]]], number: int
) -> AsyncIterator[list[SliderClient]]:
    """Open the sessions; a failed client raises here."""
    async with AsyncExitStack() as stack:
        slider_clients = []
        for k in range(number):
            session = connect(server.session(data_folder.bake), subprotocols=[SPEAKS], max_size=None, compression=None)
            slider, span = sliders[k % len(sliders)]
            connection = await stack.enter_async_context(session)
            await connection.send(OPENING)
            slider_clients.append(SliderClient(connection, slider, span, 0.618 * k))
        reading = [asyncio.create_task(slider_client.run()) for slider_client in slider_clients]
        try:
            yield slider_clients
            for task in reading:
                if task.done():
                    task.result()
        finally:
            for task in reading:
                task.cancel()


def _frames(slider_clients: Sequence[SliderClient]) -> int:
    return sum(slider_client.num_frames for slider_client in slider_clients)


def _spent_s(server: Server) -> float:
    """Processor time of the server's process so far; 0 if the system does not report it."""
    stat = Path(f"/proc/{server.pid}/stat")
    if not stat.is_file():
        return 0.0
    user, system = stat.read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
