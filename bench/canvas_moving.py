"""surface.canvas_fps: pictures a second that this machine's browser draws itself while the eye moves.

The editor on the Cornell box, 40k points, 640×480; the mouse drags round and round. Headless Chromium without a GPU
draws by its software rasteriser, with one sample a pixel, on the same cores as everything else; a browser like that is
given to the server by itself, whose pictures a second over the same drag stand beside (`server_fps`), as do the bytes
that came over the network for each picture.
"""

from __future__ import annotations

import math
import shutil
from typing import Any
from urllib.parse import urlencode

from bench.canvas import ARGUMENTS, BROWSERS
from bench.figure import Figure, skipped
from bench.house import baked_house, serving
from relume.bake import Recipe
from relume.scene.built_in import built_in
from server.settings import Settings

_NAME = "surface.canvas_fps"
_READY_MS = 120_000
_CHOOSE = "localStorage.setItem('relume.drawnBy', '{}')"


def measure(tiny: bool) -> list[Figure]:
    """Bake, serve, open the editor twice, drag."""
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        return skipped((_NAME,), "frames/s", "there is no Chromium on this machine")
    if not (Settings().client / "index.html").is_file():
        return skipped((_NAME,), "frames/s", "the editor is not built; run make setup")
    size, points, moves = ((64, 48), 2000, 20) if tiny else ((640, 480), 40_000, 300)
    scene = built_in("cornell_box")
    views = (scene.cameras[0].name,)
    recipe = Recipe("surface", views, size, 100 if tiny else 500, num_points=points)
    with baked_house(scene, recipe) as house, serving(house) as server:
        place = urlencode({"scene": house.scene, "bake": house.bake, "view": views[0]})
        url = f"http://127.0.0.1:{server.port}/?{place}"
        here, there = (_drag(browser, url, who, moves) for who in ("browser", "server"))
    context = {
        "size": list(size),
        "points": points,
        "bytes_a_picture": here["bytes"] / max(1, here["pictures"]),
        "server_fps": there["fps"],
        "server_bytes_a_picture": there["bytes"] / max(1, there["pictures"]),
        "graphics": here["graphics"],
    }
    return [Figure(_NAME, here["fps"], "frames/s", context)]


def _drag(browser: str, url: str, who: str, moves: int) -> dict[str, Any]:
    """Turn the eye round and round, drawn by one of both."""
    from playwright.sync_api import sync_playwright

    received = [0, 0]

    def count(message: Any) -> None:
        received[0] += isinstance(message, bytes) and b'"kind":"picture"' in message[:600]
        received[1] += len(message)

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser, args=ARGUMENTS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        page.on("websocket", lambda socket: socket.on("framereceived", count))
        page.add_init_script(_CHOOSE.format(who))
        page.goto(url)
        page.locator(".exactness.is-exact").wait_for(timeout=_READY_MS)
        page.wait_for_timeout(1000)
        box: Any = page.locator(".picture canvas").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        if who == "browser":  # what it draws with is compiled with the first picture
            page.mouse.move(x + 20, y)
            page.wait_for_function("() => window.relumeStats.drawnHere > 1", timeout=_READY_MS)
            page.wait_for_timeout(1000)
        _turn(page, x, y, moves // 5)
        received[:] = [0, 0]
        drawn, start = page.evaluate("[window.relumeStats.drawnHere, performance.now()]")
        _turn(page, x, y, moves)
        drawn_after, end = page.evaluate("[window.relumeStats.drawnHere, performance.now()]")
        page.mouse.up()
        graphics = page.evaluate(
            "(() => { const gl = new OffscreenCanvas(1, 1).getContext('webgl2');"
            " const info = gl.getExtension('WEBGL_debug_renderer_info');"
            " return gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER); })()"
        )
        chromium.close()
    pictures = drawn_after - drawn if who == "browser" else received[0]
    return {
        "pictures": pictures,
        "fps": 1e3 * pictures / (end - start),
        "bytes": received[1],
        "graphics": graphics,
    }


def _turn(page: Any, x: float, y: float, moves: int) -> None:
    """Move the mouse about a place."""
    for k in range(moves):
        page.mouse.move(x + 60 * math.sin(k / 10), y + 10 * math.cos(k / 7))
        page.wait_for_timeout(1000 / 60)
