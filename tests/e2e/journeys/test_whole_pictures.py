"""The canvas while images replace each other: each is complete, of one light, and labeled."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editor_page import WAIT_MS, Editor
from editor_server import Server
from environment_files import dusk, write_map
from playwright.sync_api import Browser, Page, expect
from tiny_scenes import still_life

from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

pytestmark = pytest.mark.slow  # by themselves they take minutes of a browser

# Of every picture that is drawn: its mean, and which shares of its pixels are red and blue. The surround is left out.
RECORD = """() => {
  const draw = WebGL2RenderingContext.prototype.drawArrays;
  window.draws = [];
  WebGL2RenderingContext.prototype.drawArrays = function (...call) {
    draw.apply(this, call);
    const { width, height } = this.canvas;
    const pixels = new Uint8Array(4 * width * height);
    this.readPixels(0, 0, width, height, this.RGBA, this.UNSIGNED_BYTE, pixels);
    let [sum, count, red, blue] = [0, 0, 0, 0];
    for (let i = 0; i < pixels.length; i += 4 * 7) {
      const [r, g, b] = pixels.subarray(i, i + 3);
      if (r === 20 && g === 20 && b === 20) continue;
      sum += r + g + b;
      count += 1;
      if (r > b + 12) red += 1;
      if (b > r + 12) blue += 1;
    }
    if (count > 0) window.draws.push({ mean: sum / count / 3, red: red / count, blue: blue / count });
  };
}"""


def draws(page: Page) -> list[dict[str, float]]:
    """Draw calls since the last call."""
    found: list[dict[str, float]] = page.evaluate("window.draws.splice(0)")
    return found


def test_exchanged_light_comes_to_background_and_objects_at_once(editor: Editor, tmp_path: Path) -> None:
    page = editor.page
    white = dusk() / [1.0, 0.4, 0.2]
    for name, tint in (("red", [1, 0, 0]), ("blue", [0, 0, 1])):
        page.get_by_label("Environment file").set_input_files(write_map(tmp_path / f"{name}.exr", white * tint))
        expect(page.get_by_role("radio", name=name, exact=True)).to_be_checked()
        editor.wait_until_exact()
    mark, words = page.locator(".limits p", has_text="Baked for a different environment"), page.locator(".exactness")
    expect(mark).to_be_visible()
    expect(words).to_have_text("Exact (this bake) ✓")
    page.evaluate(RECORD)
    for name in ("red", "blue"):
        page.get_by_role("radio", name=name, exact=True).click()
        page.wait_for_function("(of) => window.draws.at(-1)?.[of] > 0.3", arg=name)
        editor.wait_until_exact()
    drawn = draws(page)
    assert len(drawn) >= 2  # both are known already, and come back without a preview
    assert max(min(each["red"], each["blue"]) for each in drawn) < 0.01, "a picture of two lights"
    page.get_by_role("radio", name="Original").click()
    editor.wait_until_exact()
    expect(mark).to_have_count(0)
    expect(page.locator(".limits p")).to_have_text("Direct light only")  # which is exact for this bake as well


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, str]]:
    """A server of its own with a coarse bake of the scene, and the scene's id: others would see the finer bake too."""
    data = tmp_path_factory.mktemp("crossover")
    scene, ledger = still_life(), Ledger(open_database(f"sqlite:///{data / 'relume.db'}"))
    register_scene(data, ledger, scene)
    ledger.close()
    server = Server(data)
    server.start()
    try:
        bake(server, scene.id, (96, 72))
        yield server, scene.id
    finally:
        server.kill()


def bake(server: Server, scene: str, size: tuple[int, int]) -> str:
    """Bake two views, wait, and say its id."""
    made = server.call(
        "/api/bakes", {"scene": scene, "method": "direct", "views": ["front", "left"], "size": size, "lights": 200}
    )
    deadline = time.monotonic() + WAIT_MS / 1e3
    while made["state"] != "ready":
        assert time.monotonic() < deadline
        assert made["state"] in ("queued", "running"), made["problem"]
        time.sleep(0.1)
        made = server.call(f"/api/bakes/{made['id']}")
    return str(made["id"])


def darkest(drawn: list[dict[str, float]]) -> float:
    """Mean of the darkest picture, in units of that of the last."""
    means = np.array([each["mean"] for each in drawn])
    return float(means.min() / means[-1])


def test_the_bake_that_an_address_names_stays_where_finer_ones_are_ready(
    coarse: tuple[Server, str], browser: Browser
) -> None:
    server, scene = coarse
    named, finer = (bake(server, scene, size) for size in ((96, 72), (120, 90)))
    page: Any = browser.new_page(viewport={"width": 1280, "height": 800})
    try:
        editor = Editor(page)

        def is_news(text: str | bytes) -> bool:
            return isinstance(text, str) and '"type":"bake"' in text.replace(" ", "") and finer in text

        with page.expect_websocket() as opened:
            page.goto(f"{server.url}/?scene={scene}&bake={named}")
        with opened.value.expect_event("framereceived", is_news):
            pass
        editor.wait_until_exact()
        assert f"bake={named}" in page.url
        expect(page.get_by_text("New bake loaded.")).to_have_count(0)
        with page.expect_websocket() as opened:
            bake(server, scene, (140, 105))
        page.get_by_text("New bake loaded.").wait_for(timeout=WAIT_MS)
    finally:
        page.close()


def test_finer_bake_and_other_view_come_when_they_are_whole(coarse: tuple[Server, str], browser: Browser) -> None:
    server, scene = coarse
    page: Any = browser.new_page(viewport={"width": 1280, "height": 800})
    try:
        editor = Editor(page)
        page.goto(f"{server.url}/?scene={scene}")
        editor.wait_until_exact()
        page.evaluate(RECORD)
        bake(server, scene, (480, 360))
        page.get_by_text("New bake loaded.").wait_for(timeout=WAIT_MS)
        editor.wait_until_exact()
        drawn = draws(page)
        assert len(drawn) >= 1
        assert darkest(drawn) > 0.9
        page.get_by_role("button", name="left").click()
        page.wait_for_function("() => window.draws.length > 0")
        editor.wait_until_exact()
        assert darkest(draws(page)) > 0.9
        expect(page.locator(".limits p")).to_have_text(["Direct light only"])  # nothing else is said of it
    finally:
        page.close()
