"""Placing a camera in a browser: moved by hand and by keys, kept under a name, baked from, moved again and deleted."""

from __future__ import annotations

import urllib.request
from collections.abc import Iterator

import pytest
from editor_page import WAIT_MS, Editor
from editor_server import Server
from playwright.sync_api import Locator, Page, expect

SEEN = "canvas => canvas.toDataURL()"


@pytest.fixture
def dialog(editor: Editor, server: Server) -> Iterator[Locator]:
    """The finder, opened from the bake menu, its first picture drawn."""
    editor.page.locator(".menu > button", has_text="×").click()
    editor.page.get_by_role("button", name="Place a camera…").click()
    finder = editor.page.get_by_role("dialog")
    expect(finder.locator("canvas")).to_be_visible()
    editor.page.wait_for_function("() => document.querySelector('.finder canvas').width === 960")
    yield finder
    (scene,) = server.call("/api/scenes")
    cameras = f"/api/scenes/{scene['id']}/cameras"
    for camera in server.call(cameras):
        if camera["is_placed"]:
            request = urllib.request.Request(f"{server.url}{cameras}/{camera['name']}", method="DELETE")
            urllib.request.urlopen(request, timeout=30).close()


def moved(page: Page, canvas: Locator, before: str) -> str:
    """Wait until the picture is another one and rests; returns it."""
    page.wait_for_function(
        "before => document.querySelector('.finder canvas').width === 960"
        " && document.querySelector('.finder canvas').toDataURL() !== before",
        arg=before,
        timeout=WAIT_MS,
    )
    return str(canvas.evaluate(SEEN))


def test_every_gesture_moves_the_camera_twice(editor: Editor, dialog: Locator) -> None:
    page, canvas = editor.page, dialog.locator("canvas")
    box = canvas.bounding_box()
    assert box is not None
    x, y, seen = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, str(canvas.evaluate(SEEN))
    for _ in range(2):
        for button, shift in (("left", False), ("left", True), ("right", False)):
            if shift:
                page.keyboard.down("Shift")
            page.mouse.move(x, y)
            page.mouse.down(button=button)
            page.mouse.move(x + 25, y + 12, steps=4)
            page.mouse.up(button=button)
            if shift:
                page.keyboard.up("Shift")
            seen = moved(page, canvas, seen)
        page.mouse.wheel(0, -120)
        seen = moved(page, canvas, seen)
        page.mouse.click(x + 30, y + 20)
        seen = moved(page, canvas, seen)
        for key in ("ArrowLeft", "Shift+ArrowUp", "+", "-"):
            canvas.press(key)
            seen = moved(page, canvas, seen)
        for name in ("Turn right", "Turn down", "Nearer", "See everything"):
            dialog.get_by_role("button", name=name).click()
            seen = moved(page, canvas, seen)
        editor.drag(dialog.get_by_role("slider", name="Angle"), 0.6, 0.8)
        seen = moved(page, canvas, seen)


def test_a_camera_is_kept_baked_moved_and_deleted(editor: Editor, dialog: Locator, server: Server) -> None:
    page, canvas = editor.page, dialog.locator("canvas")
    seen = str(canvas.evaluate(SEEN))
    canvas.press("ArrowRight")
    moved(page, canvas, seen)
    dialog.get_by_label("Name").fill("front")
    dialog.get_by_role("button", name="Keep camera").click()
    expect(dialog.get_by_role("alert")).to_contain_text("own cameras")
    dialog.get_by_label("Name").fill("Aside")
    dialog.get_by_role("button", name="Keep camera").click()
    expect(dialog).to_be_hidden()
    menu = page.locator(".menu-body")
    expect(menu.get_by_label("Aside", exact=True)).to_be_checked()

    (scene,) = server.call("/api/scenes")
    url = f"/api/scenes/{scene['id']}/cameras"
    before = next(camera for camera in server.call(url) if camera["name"] == "Aside")
    menu.get_by_role("button", name="Move Aside").click()
    page.wait_for_function("() => document.querySelector('.finder canvas')?.width === 960")
    canvas.press("ArrowUp")
    dialog.get_by_role("button", name="Keep camera").click()
    expect(dialog).to_be_hidden()
    after = next(camera for camera in server.call(url) if camera["name"] == "Aside")
    assert after["to_world"] != before["to_world"]

    for own in ("front", "left"):
        menu.get_by_label(own, exact=True).uncheck()
    queued = [bake["id"] for bake in server.call("/api/bakes")]
    menu.get_by_role("button", name="Bake", exact=True).first.click()
    page.wait_for_function(
        "known => fetch('/api/bakes').then((all) => all.json())"
        ".then((all) => all.some(({id, state}) => !known.includes(id) && state === 'ready'))",
        arg=queued,
        timeout=WAIT_MS,
    )
    editor.wait_until_exact()
    (baked,) = [bake for bake in server.call("/api/bakes") if bake["id"] not in queued]
    assert baked["recipe"]["cameras"] == [{key: after[key] for key in ("name", "to_world", "yfov")}]

    page.locator(".menu > button", has_text="×").click()
    menu.get_by_role("button", name="Delete Aside").click()
    expect(menu.get_by_label("Aside", exact=True)).to_have_count(0)
    page.get_by_role("button", name="Undo", exact=True).last.click()
    expect(menu.get_by_label("Aside", exact=True)).to_have_count(1)
