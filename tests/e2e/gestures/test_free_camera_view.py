"""A view that moves, in a browser: every gesture twice in a row, editing meanwhile, keeping a camera, a reload."""

from __future__ import annotations

import re
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from editor_page import WAIT_MS, Editor, changed, opened_page, wait_until_drawn
from editor_server import Server
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, expect

MOVED_S = 90.0
MENU_PX = 310  # beside the camera's menu


@pytest.fixture
def moving(server: Server, browser: Browser, moving_scene: str) -> Iterator[Editor]:
    """The editor on it, its first picture exact."""
    with opened_page(browser) as page:
        page.goto(f"{server.url}/?scene={moving_scene}")
        wait_until_drawn(page)
        editor = Editor(page)
        editor.wait_until_exact()
        yield editor


def wait_until(holds: Callable[[], bool], else_words: str) -> None:
    """Until something holds of the picture; fails with the words where it does not come to it."""
    deadline = time.monotonic() + MOVED_S
    while not holds():
        assert time.monotonic() < deadline, else_words
        time.sleep(0.1)


def differs(editor: Editor, before: NDArray[np.int16], least: float = 0.02, after: str = "that") -> None:
    """Wait until the image has changed, and is the exact one of the stopped camera."""
    wait_until(lambda: changed(before, editor.read_pixels()) >= least, f"the picture stays as it was after: {after}")
    editor.wait_until_exact()


def settled(editor: Editor) -> NDArray[np.int16]:
    """The exact picture of a new size: until the server has it, that of the old size counts as exact."""
    pictures: list[NDArray[np.int16]] = [editor.pixels()]

    def is_still() -> bool:
        time.sleep(0.5)
        pictures.append(editor.pixels())
        before, after = pictures[-2:]
        return before.shape == after.shape and changed(before, after) == 0

    wait_until(is_still, "the picture goes on changing")
    return pictures[-1]


def comes_back(editor: Editor, before: NDArray[np.int16], left: int = 0) -> None:
    """Wait until the picture is the one that was, right of a menu of that many pixels."""
    wait_until(lambda: changed(before[:, left:], editor.pixels()[:, left:]) < 0.02, "the picture is not what it was")


@pytest.mark.slow
def test_every_gesture_moves_the_camera_twice(moving: Editor) -> None:
    page, box = moving.page, moving.canvas.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(across: float, down: float, button: str = "left") -> None:
        page.mouse.move(x, y)
        page.mouse.down(button=button)  # type: ignore[arg-type]
        page.mouse.move(x + across, y + down, steps=8)
        page.mouse.up(button=button)  # type: ignore[arg-type]

    def wheel() -> None:
        page.mouse.move(x, y)
        page.mouse.wheel(0, -120)

    def key(name: str) -> None:
        moving.canvas.focus()
        page.keyboard.press(name)

    touch = page.context.new_cdp_session(page)
    touch.send("Emulation.setTouchEmulationEnabled", {"enabled": True})

    def fingers(*ways: tuple[float, float, float, float]) -> None:
        """Each from (x, y) by (across, down), from the middle of the picture."""

        def tell(kind: str, share: float | None) -> None:
            at = [] if share is None else [(x + a + share * c, y + b + share * d) for a, b, c, d in ways]
            points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(at)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        tell("touchStart", 0.0)
        for k in range(1, 9):
            tell("touchMove", k / 8)
        tell("touchEnd", None)

    gestures = {
        "turn": lambda: drag(60, 20),
        "look around": lambda: drag(30, 10, "right"),
        "slide": lambda: drag(30, 10, "middle"),
        "wheel": wheel,
        "key turns": lambda: key("ArrowLeft"),
        "key slides": lambda: key("Shift+ArrowUp"),
        "key goes back": lambda: key("-"),
        "button": lambda: page.get_by_role("button", name="Orbit right").click(),
        "one finger turns": lambda: fingers((0, 0, -50, 0)),
        "two fingers slide": lambda: fingers((-40, 0, 0, 20), (40, 0, 0, 20)),
        "two fingers spread": lambda: fingers((-40, 0, -10, 0), (40, 0, 10, 0)),
    }
    first = moving.read_pixels()
    for name, gesture in gestures.items():
        for _ in range(2):
            before = moving.read_pixels()
            gesture()
            differs(moving, before, after=name)
        key("Home")  # each gesture begins where no wall is near
        comes_back(moving, first)


def test_the_camera_is_reset_and_a_reload_keeps_it(moving: Editor) -> None:
    page, first = moving.page, moving.read_pixels()
    moving.canvas.focus()
    page.keyboard.press("ArrowLeft")
    differs(moving, first)
    aside = moving.read_pixels()
    page.reload()
    wait_until_drawn(page)
    differs(moving, first)
    comes_back(moving, aside)
    moving.canvas.focus()
    page.keyboard.press("Home")
    differs(moving, aside)
    comes_back(moving, first)


def test_a_material_is_selected_by_a_click_and_edited_after_the_camera_moved(moving: Editor) -> None:
    page, first = moving.page, moving.read_pixels()
    moving.canvas.focus()
    page.keyboard.press("ArrowRight")
    differs(moving, first)
    before, box = moving.read_pixels(), moving.canvas.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(page.locator(".inspector .card").first).to_be_visible()
    fit = "While the camera moves: 1 of 36 basis functions, error less than 1 %"
    expect(page.locator(".in-motion").first).to_contain_text(fit)
    page.get_by_role("slider", name="Brightness").focus()
    for _ in range(5):
        page.keyboard.press("PageUp")
    differs(moving, before)
    edited = moving.read_pixels()
    page.keyboard.press("Control+z")
    differs(moving, edited)
    moving.canvas.focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("footer.status")).to_contain_text(re.compile("Approximate|exact image of this camera"))
    differs(moving, edited)


@pytest.mark.slow
def test_the_camera_has_an_angle_a_size_and_names(moving: Editor, server: Server, moving_scene: str) -> None:
    page, first = moving.page, moving.read_pixels()
    page.get_by_role("button", name="Options ▾").click()
    menu = page.get_by_role("dialog", name="Camera options")
    menu.get_by_role("slider", name="Field of view").focus()
    page.keyboard.press("PageDown")
    differs(moving, first)
    for side, pixels in (("Width", "90"), ("Height", "160")):
        menu.get_by_label(f"{side}, pixels").fill(pixels)
        page.keyboard.press("Enter")
    expect(page.get_by_role("button", name="90×160, free camera")).to_be_visible()
    there = settled(moving)
    menu.get_by_role("button", name="Save this camera").click()
    page.wait_for_function("() => document.activeElement?.matches('input:not([type=range]):not([type=number])')")
    page.keyboard.type("Near")  # its name is open for typing
    page.keyboard.press("Enter")
    expect(menu.get_by_role("button", name="Rename Near")).to_be_visible()
    moving.canvas.focus()
    page.keyboard.press("ArrowLeft")
    differs(moving, there)
    aside = moving.read_pixels()
    menu.get_by_role("button", name="Go to Near").click()
    differs(moving, aside)
    comes_back(moving, there, MENU_PX)

    def names() -> list[str]:
        return [camera["name"] for camera in server.call(f"/api/scenes/{moving_scene}/cameras") if camera["is_placed"]]

    assert names() == ["Near"]
    menu.get_by_role("button", name="Delete Near").click()
    expect(menu.get_by_role("button", name="Go to Near")).to_have_count(0)
    page.get_by_role("button", name="Undo", exact=True).last.click()
    page.get_by_role("button", name="Options ▾").click()
    expect(menu.get_by_role("button", name="Go to Near")).to_be_visible()
    assert names() == ["Near"]


@pytest.mark.slow
def test_a_turntable_from_the_current_camera_is_removed(moving: Editor, tmp_path: Path) -> None:
    page, first = moving.page, moving.read_pixels()
    moving.canvas.focus()
    page.keyboard.press("ArrowUp")
    differs(moving, first)
    page.get_by_role("button", name="More export formats").click()
    with page.expect_download(timeout=WAIT_MS) as download:
        page.get_by_role("button", name="Turntable, fast").click()
    download.value.save_as(tmp_path / "round.zip")
    with zipfile.ZipFile(tmp_path / "round.zip") as archive:
        frames = [np.asarray(Image.open(archive.open(name)), np.float64) for name in sorted(archive.namelist())]
    assert len(frames) == 72
    assert frames[0].shape == (120, 120, 3)
    for k in (1, 18, 36, 71):
        assert np.abs(frames[k] - frames[0]).mean() > 1
    assert np.abs(frames[36] - frames[0]).mean() > np.abs(frames[1] - frames[0]).mean()
