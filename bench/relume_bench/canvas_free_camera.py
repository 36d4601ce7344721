"""probes.canvas_fps: frames per second that this machine's browser renders itself while the camera moves.

The editor on the Cornell box, 40k probes, 640×480; the mouse orbits. Headless Chromium without a GPU renders with its
software rasterizer, one sample per pixel, on the same cores as everything else; by default the server renders for such
a browser. The server's frames per second over the same drag are in the context (`server_fps`), as are the network bytes
per frame, seconds and bytes from opening the editor to the first frame rendered by the browser (`first_s`,
`first_bytes`), and the bytes of each frame while the environment is rotated and afterwards (`turn_bytes`,
`turned_bytes`).
"""

from __future__ import annotations

import math
import shutil
from typing import Any
from urllib.parse import urlencode

from relume.scene.examples.catalog import built_in
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import baked_folder, serving
from relume_bench.canvas import ARGUMENTS, BROWSERS
from relume_bench.figure import Figure, skipped
from relume_server.settings import Settings

_NAME = "probes.canvas_fps"
_READY_TIMEOUT_MS = 120_000
_NUM_ROTATIONS = 10
_CHOOSE = "localStorage.setItem('relume.drawnBy', '{}')"

_LOADED = (
    "[performance.now(), performance.getEntriesByType('resource').reduce((sum, one) => sum + one.transferSize, 0)]"
)
_GRAPHICS = (
    "(() => { const gl = new OffscreenCanvas(1, 1).getContext('webgl2');"
    " const info = gl.getExtension('WEBGL_debug_renderer_info');"
    " return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER); })()"
)


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, open the editor twice, drag."""
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        return skipped((_NAME,), "frames/s", "there is no Chromium on this machine")
    if not (Settings().client / "index.html").is_file():
        return skipped((_NAME,), "frames/s", "the editor is not built; run make setup")
    size, num_probes, moves = ((64, 48), 2000, 20) if tiny else ((640, 480), 40_000, 150)
    scene = built_in("cornell_box")
    views = (scene.cameras[0].name,)
    recipe = Recipe("probes", views, size, 100 if tiny else 500, num_probes=num_probes)
    with baked_folder(scene, recipe) as data_folder, serving(data_folder) as server:
        query = urlencode({"scene": data_folder.scene, "bake": data_folder.bake, "view": views[0]})
        url = f"http://127.0.0.1:{server.port}/?{query}"
        browser_result, server_result = (_drag(browser, url, renderer, moves) for renderer in ("client", "server"))
    context = {
        "size": list(size),
        "probes": num_probes,
        "bytes_a_picture": browser_result["bytes"] / max(1, browser_result["pictures"]),
        **browser_result["first"],
        **browser_result["turn"],
        "server_fps": server_result["fps"],
        "server_bytes_a_picture": server_result["bytes"] / max(1, server_result["pictures"]),
        "graphics": browser_result["graphics"],
    }
    return [Figure(_NAME, browser_result["fps"], "frames/s", context)]


class _Received:
    """Messages since the last `clear`: frame sizes by kind, total bytes, and whether the last one had all functions."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        self.frames: dict[str, list[int]] = {"picture": [], "scene_update": []}
        self.num_bytes, self.is_converged = 0, False

    def count(self, message: Any) -> None:
        self.num_bytes += len(message)
        for kind, sizes in self.frames.items():
            if isinstance(message, bytes) and f'"kind":"{kind}"'.encode() in message[:600]:
                sizes.append(len(message))
                self.is_converged = b'"fidelity":"approximate"' in message[:600]  # no longer the quick approximation


def _drag(browser: str, url: str, renderer: str, moves: int) -> dict[str, Any]:
    """Orbit the camera with one of both renderers; with the browser's, rotate the environment as well."""
    from playwright.sync_api import sync_playwright

    received = _Received()
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser, args=ARGUMENTS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        page.on("websocket", lambda socket: socket.on("framereceived", received.count))
        page.add_init_script(_CHOOSE.format(renderer))
        page.goto(url)
        first = _first(page, received) if renderer == "client" else {}
        page.locator(".exactness.is-exact").wait_for(timeout=_READY_TIMEOUT_MS)
        page.wait_for_timeout(1000)
        box: Any = page.locator(".picture canvas").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        _orbit_camera(page, x, y, moves // 5)
        received.clear()
        drawn, start = page.evaluate("[window.relumeStats.drawnHere, performance.now()]")
        _orbit_camera(page, x, y, moves)
        drawn_after, end = page.evaluate("[window.relumeStats.drawnHere, performance.now()]")
        pictures = drawn_after - drawn if renderer == "client" else len(received.frames["picture"])
        result = {
            "pictures": pictures,
            "fps": 1e3 * pictures / (end - start),
            "bytes": received.num_bytes,
            "first": first,
        }
        page.mouse.up()
        result["turn"] = _rotate_environment(page, received) if renderer == "client" else {}
        result["graphics"] = page.evaluate(_GRAPHICS)
        chromium.close()
    return result


def _first(page: Any, received: _Received) -> dict[str, float]:
    """Seconds and bytes until the browser has rendered a frame, on the page's own clock."""
    page.wait_for_function("() => window.relumeStats && window.relumeStats.drawnHere > 0", timeout=_READY_TIMEOUT_MS)
    current_ms, loaded = page.evaluate(_LOADED)
    return {"first_s": current_ms / 1e3, "first_bytes": loaded + received.num_bytes}


def _rotate_environment(page: Any, received: _Received) -> dict[str, float]:
    """Drag the slider of the rotation, and release it: largest frame during and after the drag."""
    slider = page.get_by_role("slider", name="Rotation").first
    slider.scroll_into_view_if_needed()
    page.wait_for_timeout(1000)
    box: Any = slider.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    received.clear()
    for k in range(_NUM_ROTATIONS):
        page.mouse.move(x + 2 * k, y)
        page.wait_for_timeout(200)
    meanwhile = max(received.frames["scene_update"], default=0)
    received.clear()
    page.mouse.up()
    for _ in range(_READY_TIMEOUT_MS // 100):
        if received.is_converged:
            break
        page.wait_for_timeout(100)
    return {"turn_bytes": meanwhile, "turned_bytes": max(received.frames["scene_update"], default=0)}


def _orbit_camera(page: Any, x: float, y: float, moves: int) -> None:
    """Move the mouse in circles."""
    for k in range(moves):
        page.mouse.move(x + 60 * math.sin(k / 10), y + 10 * math.cos(k / 7))
        page.wait_for_timeout(1000 / 60)
