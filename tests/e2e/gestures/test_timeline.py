"""The time line in a browser: looks put on it, gone through and played twice, kept, closed, found again by a reload."""

from __future__ import annotations

import pytest
from editor_page import Editor, changed
from playwright.sync_api import expect

SIGMA = "Roughness σ"


@pytest.mark.slow
def test_looks_play_one_after_another_and_leave_the_look_as_it_was(editor: Editor) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    page.keyboard.press("m")

    def sigma() -> str | None:
        return editor.slider(SIGMA).get_attribute("aria-valuenow")

    sigmas = [sigma()]
    add = page.get_by_label("Add a look to the timeline")
    add.select_option("live")
    expect(page.locator(".timeline-hint")).to_have_text("Add another look, or choose what rotates.")
    moves = page.get_by_label("Motion")
    moves.select_option("environment")
    time = page.get_by_role("slider", name="Time")
    expect(page.get_by_role("button", name="Play", exact=True)).to_be_enabled()
    turned = []
    for place in ("Home", "PageUp", "Home", "PageUp"):  # the environment turns, under one look
        time.focus()
        page.keyboard.press(place)
        editor.wait_until_exact()
        turned.append(editor.pixels())
    assert changed(turned[0], turned[1]) > 0.02
    assert changed(turned[0], turned[2]) == changed(turned[1], turned[3]) == 0
    moves.select_option("still")
    editor.drag(editor.slider(SIGMA), 0.3, 0.9)
    add.select_option("live")
    expect(page.locator(".keyframe")).to_have_count(2)
    rough = editor.pixels()
    sigmas.append(sigma())
    assert sigmas[0] != sigmas[1]
    for _ in range(2):
        before = time.get_attribute("aria-valuetext")
        page.get_by_role("button", name="Play", exact=True).click()
        expect(time).not_to_have_attribute("aria-valuetext", before or "")
        page.get_by_role("button", name="Pause").click()
    shown = []
    for place in ("Home", "End", "Home", "End"):
        time.focus()
        page.keyboard.press(place)
        shown.append(editor.pixels())
    assert changed(shown[0], shown[1]) > 0.005
    assert changed(shown[0], shown[2]) == changed(shown[1], shown[3]) == 0
    assert changed(shown[1], rough) < 0.005
    page.get_by_role("button", name="Key 1", exact=True).click()
    assert sigma() == sigmas[0]
    page.get_by_label("Close timeline").click()
    expect(page.locator(".timeline")).to_have_count(0)
    assert sigma() == sigmas[1]
    page.reload()
    editor.wait_until_exact()
    page.keyboard.press("m")
    expect(page.locator(".keyframe")).to_have_count(2)
    assert changed(editor.pixels(), rough) < 0.005
    page.get_by_role("button", name="Key 1", exact=True).click()
    page.get_by_role("button", name="Use this look").click()
    assert changed(editor.pixels(), shown[0]) < 0.005
    page.keyboard.press("Control+z")
    assert changed(editor.pixels(), rough) < 0.005
