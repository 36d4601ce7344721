"""Placing a camera in a browser: moved by hand and by keys, kept under a name, baked from, moved again and deleted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from editor_page import WAIT_MS, Editor, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Page, expect

PIXEL_HASH = "canvas => canvas.toDataURL()"


@pytest.fixture
def scene(server: Server) -> Iterator[str]:
    """A scene of its own, which is gone afterwards with its bakes: they would be opened instead of the others'."""
    identity = server.call("/api/example-scenes/cornell_box", {})["id"]
    yield identity
    server.delete(f"/api/scenes/{identity}")


@pytest.fixture
def page(server: Server, scene: str, browser: Browser) -> Iterator[Page]:
    """The start page with the scene's bake dialog open, after the first image of its placement viewport."""
    with opened_page(browser) as page:
        page.goto(server.url)
        page.locator(".scene-card", has_text="Cornell box").get_by_role("button", name="Bake…").click()
        page.get_by_role("button", name="New camera…").click()
        moved(page, "")
        yield page


def moved(page: Page, before: str) -> str:
    """Wait until the placement viewport shows another image and stops; return it."""
    page.wait_for_function(
        """before => {
          const canvas = document.querySelector('.placement canvas');
          if (canvas?.width !== 960) return false;
          const { data } = canvas.getContext('2d').getImageData(480, 360, 1, 1);
          return data[3] === 255 && canvas.toDataURL() !== before;
        }""",
        arg=before,
        timeout=WAIT_MS,
    )
    return str(page.locator(".placement canvas").evaluate(PIXEL_HASH))


@pytest.mark.slow
def test_every_gesture_moves_the_camera_twice(page: Page) -> None:
    dialog = page.get_by_role("dialog")
    canvas = dialog.locator("canvas")
    box = canvas.bounding_box()
    assert box is not None
    x, y, previous = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, str(canvas.evaluate(PIXEL_HASH))
    for _ in range(2):
        for button in ("left", "right"):
            page.mouse.move(x, y)
            page.mouse.down(button=button)
            page.mouse.move(x + 25, y + 12, steps=4)
            page.mouse.up(button=button)
            previous = moved(page, previous)
        page.mouse.wheel(0, -120)
        previous = moved(page, previous)
        page.mouse.click(x + 30, y + 20)
        previous = moved(page, previous)
        for key in ("ArrowLeft", "Shift+ArrowUp", "+"):
            canvas.press(key)
            previous = moved(page, previous)
        for name in ("Orbit right", "Show all"):
            dialog.get_by_role("button", name=name).click()
            previous = moved(page, previous)
        Editor(page).drag(dialog.get_by_role("slider", name="Field of view"), 0.6, 0.8)
        previous = moved(page, previous)


def test_a_camera_is_kept_moved_deleted_and_baked(page: Page, server: Server, scene: str) -> None:
    dialog, views = page.get_by_role("dialog"), page.locator(".bake-views")
    canvas, url = dialog.locator("canvas"), f"/api/scenes/{scene}/cameras"
    canvas.press("ArrowRight")
    dialog.get_by_label("Name").fill("front")
    dialog.get_by_role("button", name="Save camera").click()
    expect(dialog.get_by_role("alert")).to_contain_text("camera of the scene file")
    previous = str(canvas.evaluate(PIXEL_HASH))
    canvas.press("ArrowRight")
    moved(page, previous)  # a picture that comes after the refusal takes nothing of it away
    expect(dialog.get_by_role("alert")).to_contain_text("camera of the scene file")
    dialog.get_by_label("Name").fill("Aside")
    dialog.get_by_label("Name").press("Enter")
    expect(dialog).to_be_hidden()
    expect(views.get_by_label("Aside", exact=True)).to_be_checked()
    before = placed(server.call(url))

    views.get_by_role("button", name="Move or rename Aside").click()
    previous = moved(page, "")
    canvas.press("ArrowUp")
    moved(page, previous)
    dialog.get_by_label("Name").fill("Beside")
    dialog.get_by_role("button", name="Save camera").click()
    expect(dialog).to_be_hidden()
    views.get_by_label("front", exact=True).uncheck()  # at once: what is chosen meanwhile stays chosen
    after = placed(server.call(url))
    assert after["to_world"] != before["to_world"]

    views.get_by_role("button", name="Delete Beside").click()
    expect(views.get_by_label("Beside", exact=True)).to_have_count(0)
    expect(views.get_by_label("front", exact=True)).to_be_checked()
    page.get_by_role("button", name="Undo", exact=True).click()
    expect(views.get_by_label("Beside", exact=True)).to_be_checked()
    assert placed(server.call(url)) == after

    views.get_by_label("front", exact=True).uncheck()
    page.get_by_role("button", name="Open and bake").first.click()
    Editor(page).wait_until_exact()
    (bake,) = server.call(f"/api/bakes?scene={scene}")
    assert bake["recipe"]["views"] == ["Beside"]
    assert bake["recipe"]["cameras"] == [{key: after[key] for key in ("name", "to_world", "yfov", "near", "lens")}]


def placed(cameras: list[dict[str, Any]]) -> dict[str, Any]:
    """The one that somebody placed."""
    (camera,) = [camera for camera in cameras if camera["is_placed"]]
    return camera
