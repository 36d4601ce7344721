"""Free-camera views drawn by the browser: as the server does, without a byte per camera move; edits and rest."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from editor_page import WAIT_FOR_FRAMES, WAIT_MS, Editor, changed, opened_page, wait_until_drawn
from editor_server import Server
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, WebSocketRoute, expect
from scipy.ndimage import maximum_filter, minimum_filter

DRAWN_MS = 60_000
BAR_PX, WINDOW_PX, SPAN = 60, 25, 16
Pixels = NDArray[np.int16]
KEEP_CONTEXTS = """
  window.contexts = [];
  const make = OffscreenCanvas.prototype.getContext;
  OffscreenCanvas.prototype.getContext = function (...args) {
    const made = make.apply(this, args);
    window.contexts.push(made);
    return made;
  };
"""


def never_at_rest(page: Page, sizes: list[int]) -> None:
    """Ask for no exact picture, and take note of the sizes of all frames."""

    def connect(socket: WebSocketRoute) -> None:
        server = socket.connect_to_server()

        def down(message: Any) -> None:
            if isinstance(message, bytes):
                sizes.append(len(message))
            socket.send(message)

        socket.on_message(lambda text: server.send(str(text).replace('"refine":"exact"', '"refine":"none"')))
        server.on_message(down)

    page.route_web_socket(re.compile(".*"), connect)


@pytest.fixture
def moving(server: Server, browser: Browser, moving_scene: str) -> Iterator[tuple[Editor, list[int]]]:
    """The editor, its eye a step aside of where it began, drawn by the server; and the sizes of frames so far."""
    with opened_page(browser) as page:
        sizes: list[int] = []
        never_at_rest(page, sizes)
        page.add_init_script(KEEP_CONTEXTS)
        page.goto(f"{server.url}/?scene={moving_scene}")
        wait_until_drawn(page)
        editor = Editor(page)
        editor.canvas.focus()
        page.keyboard.press("ArrowLeft")
        settled(editor)
        yield editor, sizes


def settled(editor: Editor) -> Pixels:
    """The picture once it has stopped changing, without the ring of the focus."""
    editor.page.evaluate("document.activeElement.blur()")
    expect(editor.page.locator("footer.status")).to_contain_text("Refining", timeout=WAIT_MS)
    editor.page.evaluate(WAIT_FOR_FRAMES)  # what was done has become an edit
    editor.page.wait_for_function("() => window.relumeStats.waiting.length === 0", timeout=DRAWN_MS)
    whole = editor.page.get_by_text("Approximate while moving")  # else it says that it previews
    before, alike = editor.read_pixels(), 0
    deadline = time.monotonic() + DRAWN_MS / 1e3
    while time.monotonic() < deadline:
        editor.page.wait_for_timeout(500)
        after = editor.read_pixels()
        alike = alike + 1 if whole.is_visible() and changed(before, after) == 0 else 0
        if alike == 2:  # on a busy machine what is found finely comes a while after what is found first
            return after
        before = after
    raise AssertionError("the picture does not come to rest")


def num_drawn(page: Page) -> int:
    return int(page.evaluate("window.relumeStats.drawnHere"))


def choose(page: Page, who: str) -> None:
    page.get_by_role("button", name="Options ▾").click()
    page.get_by_label("Renderer").select_option(who)
    page.keyboard.press("Escape")


def draw_here(page: Page) -> None:
    before = num_drawn(page)
    choose(page, "client")
    page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=before, timeout=DRAWN_MS)


def beside_edges(one: Pixels) -> NDArray[np.bool_]:
    """Pixels away from edges, which the server antialiases and a processor that draws does not. (height, width)"""
    window = (WINDOW_PX, WINDOW_PX, 1)  # several pixels of the picture
    span = maximum_filter(one, window) - minimum_filter(one, window)
    inside = np.asarray(span.max(axis=2) < SPAN, np.bool_)
    inside[-BAR_PX:] = False  # under the bar that says who draws
    return inside


def test_it_shows_what_the_server_does(moving: tuple[Editor, list[int]]) -> None:
    editor, _ = moving
    by_server = settled(editor)
    draw_here(editor.page)
    by_browser = settled(editor)
    inside = beside_edges(by_server)
    assert inside.mean() > 0.3
    off = np.abs(by_server - by_browser).max(axis=2)
    assert (off[inside] > 2).mean() < 2e-3
    assert np.abs(by_server - by_browser).mean() < 1
    choose(editor.page, "server")
    assert changed(by_server[:-BAR_PX], settled(editor)[:-BAR_PX]) == 0
    draw_here(editor.page)
    assert changed(by_browser[:-BAR_PX], settled(editor)[:-BAR_PX]) == 0


def test_a_camera_move_costs_no_frames_on_the_network_twice(moving: tuple[Editor, list[int]]) -> None:
    editor, sizes = moving
    page, box = editor.page, editor.canvas.bounding_box()
    assert box is not None
    draw_here(page)
    before = settled(editor)
    for across in (50, -90):
        sizes.clear()
        drawn, x, y = num_drawn(page), box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        for k in range(10):
            page.mouse.move(x + across * k / 9, y)
            page.wait_for_timeout(60)
        page.mouse.up()
        after = settled(editor)
        assert num_drawn(page) > drawn + 3
        assert max(sizes, default=0) < 2000
        assert changed(before, after) > 0.05
        before = after


@pytest.mark.slow
def test_a_context_that_is_lost_in_a_drag_is_made_anew_twice(moving: tuple[Editor, list[int]]) -> None:
    editor, _ = moving
    page, box = editor.page, editor.canvas.bounding_box()
    assert box is not None
    draw_here(page)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(2):
        page.mouse.move(x + 20 + 40 * k, y)
        drawn = num_drawn(page)
        page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=drawn, timeout=DRAWN_MS)
        before = page.evaluate("window.contexts.length")
        page.evaluate("window.contexts.at(-1).getExtension('WEBGL_lose_context').loseContext()")
        page.mouse.move(x + 40 + 40 * k, y)
        page.wait_for_function("n => window.contexts.length > n", arg=before, timeout=DRAWN_MS)
        drawn = num_drawn(page)
        page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=drawn, timeout=DRAWN_MS)
    page.mouse.up()
    here = settled(editor)
    choose(page, "server")
    assert np.abs(here - settled(editor)).mean() < 1


@pytest.mark.slow
def test_materials_and_lights_follow_twice(moving: tuple[Editor, list[int]]) -> None:
    editor, _ = moving
    page = editor.page
    draw_here(page)
    page.get_by_role("option", name="Red wall").click()
    for name, key in (("Brightness", "PageDown"), ("Rotation", "PageUp")):
        for _ in range(2):
            before, drawn = settled(editor), num_drawn(page)
            page.get_by_role("slider", name=name).first.focus()
            for _ in range(4):
                page.keyboard.press(key)
            page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=drawn, timeout=DRAWN_MS)
            here = settled(editor)
            assert changed(before, here) > 0.003
    choose(page, "server")
    there = settled(editor)
    assert np.abs(here - there).mean() < 1


@pytest.mark.slow
@pytest.mark.parametrize("model", ["blinn_phong", "ggx"])  # one that the in-basis tells, and one that is a lobe alone
def test_highlights_are_where_the_server_has_them(moving: tuple[Editor, list[int]], model: str) -> None:
    editor, _ = moving
    page = editor.page
    draw_here(page)
    dull = settled(editor)
    for name in ("Floor", "Tall block"):
        drawn = num_drawn(page)
        page.get_by_role("option", name=name).click()
        page.get_by_label("Add a layer").select_option(model)
        page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=drawn, timeout=DRAWN_MS)
    here = settled(editor)
    assert changed(dull, here) > 0.05
    choose(page, "server")
    there = settled(editor)
    inside = beside_edges(there)
    assert inside.mean() > 0.3
    assert (np.abs(there - here).max(axis=2)[inside] > 2).mean() < 2e-3


@pytest.mark.slow
def test_the_exact_image_takes_over_when_the_camera_stops_twice(
    server: Server, browser: Browser, moving_scene: str
) -> None:
    with opened_page(browser) as page:
        page.add_init_script("localStorage.setItem('relume.drawnBy', 'client')")
        page.goto(f"{server.url}/?scene={moving_scene}")
        editor = Editor(page)
        editor.wait_until_exact()
        for _ in range(2):
            page.wait_for_timeout(500)
            drawn, before = num_drawn(page), editor.pixels()
            editor.canvas.focus()
            page.keyboard.press("ArrowLeft")
            page.wait_for_function("n => window.relumeStats.drawnHere > n", arg=drawn, timeout=DRAWN_MS)
            editor.page.wait_for_timeout(500)
            assert changed(before, editor.pixels()) > 0.05


@pytest.fixture
def ball_on_a_floor(server: Server) -> Iterator[str]:
    """Its scene; it is gone afterwards."""
    identity = server.ball_on_a_floor()
    yield identity
    server.delete(f"/api/scenes/{identity}")


def assert_drawn_as_by_the_server(server: Server, browser: Browser, scene: str) -> None:
    """The browser's own picture of a turned camera has the values of the server's, beside edges."""
    with opened_page(browser) as page:
        never_at_rest(page, [])
        page.goto(f"{server.url}/?scene={scene}")
        wait_until_drawn(page)
        editor = Editor(page)
        editor.canvas.focus()
        page.keyboard.press("ArrowLeft")
        by_server = settled(editor)
        draw_here(page)
        off = np.abs(by_server - settled(editor)).max(axis=2)
        inside = beside_edges(by_server)
        assert inside.mean() > 0.3
        assert (off[inside] > 2).mean() < 0.01


@pytest.mark.slow
def test_reflections_turn_between_points_as_the_server_has_them(
    server: Server, browser: Browser, ball_on_a_floor: str
) -> None:
    """A floor in a metal ball: without gradients a tenth of all pixels would differ
    (docs/free-camera.md#highlights)."""
    assert_drawn_as_by_the_server(server, browser, ball_on_a_floor)


@pytest.fixture
def panel_from_behind(server: Server) -> Iterator[str]:
    """Its scene; it is deleted afterwards."""
    identity = server.panel_from_behind()
    yield identity
    server.delete(f"/api/scenes/{identity}")


@pytest.mark.slow
def test_one_sided_surfaces_emit_nothing_from_behind(server: Server, browser: Browser, panel_from_behind: str) -> None:
    """As the server has it; with emission, the panel would be white."""
    assert_drawn_as_by_the_server(server, browser, panel_from_behind)
