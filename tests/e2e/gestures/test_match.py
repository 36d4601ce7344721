"""The Match tool in a browser: lights follow the brush; a stroke is one step; Escape cancels; locks hold."""

from __future__ import annotations

import os

from editor_page import Editor, changed
from playwright.sync_api import expect
from test_lights import add_by_click


def open_match(editor: Editor) -> None:
    editor.page.keyboard.press("u")
    expect(editor.page.get_by_role("group", name="Match lights").get_by_role("status")).to_contain_text("Paint over")


def paint(editor: Editor, *, release: bool = True) -> None:
    """Paint over the middle of the image."""
    box, mouse = editor.canvas.bounding_box(), editor.page.mouse
    assert box is not None
    x, y = box["x"] + 0.45 * box["width"], box["y"] + 0.7 * box["height"]
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 0.1 * box["width"], y, steps=8)
    status = editor.page.get_by_role("group", name="Match lights").get_by_role("status")
    expect(status).to_contain_text("Residual")
    if release:
        mouse.up()


def test_lights_follow_the_brush_and_undo_is_one_step(editor: Editor) -> None:
    add_by_click(editor, "Point")
    before = editor.pixels()
    open_match(editor)
    paint(editor)
    if (folder := os.environ.get("RELUME_SCREENSHOTS")) is not None:
        editor.page.screenshot(path=f"{folder}/match.png")
    editor.page.keyboard.press("u")
    after = editor.pixels()
    assert changed(before, after) > 0.1
    assert after.mean() > before.mean()
    editor.page.keyboard.press("Control+z")
    assert changed(before, editor.pixels()) == 0


def test_escape_cancels_the_stroke_and_then_closes_the_tool(editor: Editor) -> None:
    before = editor.pixels()
    open_match(editor)
    paint(editor, release=False)
    editor.page.keyboard.press("Escape")
    bar = editor.page.get_by_role("group", name="Match lights")
    expect(bar.get_by_role("status")).to_contain_text("Canceled")
    editor.page.mouse.up()
    editor.page.keyboard.press("Escape")
    expect(bar).to_have_count(0)
    assert changed(before, editor.pixels()) == 0


def test_a_locked_environment_stays_and_the_bar_says_that_the_stroke_cannot_be_reached(editor: Editor) -> None:
    before = editor.pixels()
    open_match(editor)
    bar = editor.page.get_by_role("group", name="Match lights")
    bar.get_by_role("button", name="Lock environment").click()
    paint(editor)
    expect(bar.get_by_role("status")).to_contain_text("the lights there are locked")
    editor.page.keyboard.press("u")
    assert changed(before, editor.pixels()) == 0
