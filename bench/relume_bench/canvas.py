"""canvas.edit_to_pixels_ms: from the pointer event to the frame on the canvas, in headless Chromium on this machine.

The editor on the built-in scene at 640×480; the slider of the teapot's highlight width ("Exponent along" of its
ashikhmin_shirley term) is dragged. Both ends are on the browser's clock, recorded by the editor itself
(`window.relumeStats`): the input event, and the drawing of the frame. The browser, its software rasterizer and the
server share the cores.
"""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlencode

from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import BakedFolder, baked_folder, serving
from relume_bench.figure import Figure, skipped
from relume_bench.timing import percentiles
from relume_server.settings import Settings

_NAMES = ("canvas.edit_to_pixels_ms.p50", "canvas.edit_to_pixels_ms.p95")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Chromium on a machine without a GPU: its own compositor, WebGL by SwiftShader if enabled
ARGUMENTS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking"]
_READY_TIMEOUT_S = 90.0
_AT_ONCE_MS, _QUIET_MS = 500, 100
_QUIET_LOOKS = 20
_SLIDER, _COUNT = "Exponent along", "window.relumeStats.latencies.length"


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, open the editor, drag."""
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        return skipped(_NAMES, "ms", "there is no Chromium on this machine")
    if not (Settings().client / "index.html").is_file():
        return skipped(_NAMES, "ms", "the editor is not built; run make setup")
    size, num_lights, num_moves = ((64, 48), 60, 5) if tiny else ((640, 480), 2000, 120)
    recipe = Recipe("direct", ("front",), size, num_lights)
    with baked_folder(demo_scene(), recipe) as data_folder, serving(data_folder) as server:
        latencies = _drag(browser, f"http://127.0.0.1:{server.port}/?{_make_editor_query(data_folder)}", num_moves)
        at_socket = server.edit_ms()[-num_moves:]
    p50, p95 = percentiles(latencies)
    context = {
        "edits": len(latencies),
        "size": list(size),
        "max_ms": max(latencies),
        "edit_to_socket_ms_p50": percentiles(at_socket)[0],
        "browser": "headless Chromium",
    }
    return [Figure(_NAMES[0], p50, "ms", context), Figure(_NAMES[1], p95, "ms", context)]


def _make_editor_query(data_folder: BakedFolder) -> str:
    return urlencode(
        {"scene": data_folder.scene, "bake": data_folder.bake, "view": "front", "material": "Teapot", "term": 1}
    )


def _drag(browser: str, url: str, num_moves: int) -> list[float]:
    """Milliseconds of each edit that was drawn."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser, args=ARGUMENTS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        page.goto(url)
        slider = page.get_by_role("slider", name=_SLIDER)
        slider.wait_for(timeout=1000 * _READY_TIMEOUT_S)
        box: Any = slider.bounding_box()
        y, middle = box["y"] + box["height"] / 2, box["x"] + box["width"] / 2
        page.mouse.move(middle, y)
        page.mouse.down()
        _wait_until_frozen(page, lambda k: page.mouse.move(middle + 3 + k % 2, y))
        _wait_until_quiet(page)
        before = page.evaluate(_COUNT)
        for k in range(num_moves):
            page.mouse.move(middle + 0.3 * box["width"] * math.sin(2 * math.pi * k / 60), y)
            page.wait_for_timeout(1000 / 60)
        page.wait_for_timeout(1000)
        page.mouse.up()
        latencies = page.evaluate("window.relumeStats.latencies.map((one) => one.drawnTime - one.inputTime)")
        chromium.close()
    return [float(ms) for ms in latencies[before:]]


def _wait_until_frozen(page: Any, move: Callable[[int], None]) -> None:
    """Drag in small steps until frames come at once, because the operator of the slider is ready.

    The page's policy forbids evaluating strings, so the wait is done here.
    """
    deadline, k, in_a_row = time.monotonic() + _READY_TIMEOUT_S, 0, 0
    while in_a_row < 3:
        if time.monotonic() > deadline:
            raise TimeoutError("the editor draws no frames when the slider is moved")
        moved = page.evaluate("performance.now()")
        move(k)
        page.wait_for_timeout(_AT_ONCE_MS)
        drawn = page.evaluate("window.relumeStats.latencies.at(-1)?.inputTime ?? -1")
        in_a_row = in_a_row + 1 if drawn >= moved else 0
        k += 1


def _wait_until_quiet(page: Any) -> None:
    """Wait until the server has finished all shading and precomputing, which would slow frames down."""
    deadline, in_a_row = time.monotonic() + _READY_TIMEOUT_S, 0
    while in_a_row < _QUIET_LOOKS:
        if time.monotonic() > deadline:
            raise TimeoutError("the server does not become idle")
        in_a_row = in_a_row + 1 if page.locator("footer progress").count() == 0 else 0
        page.wait_for_timeout(_QUIET_MS)
