"""The history in a browser: what makes a step, and what is never lost from it."""

from __future__ import annotations

from editor_page import Editor
from playwright.sync_api import expect

SIGMA = "Roughness σ"


def steps(editor: Editor) -> list[str | None]:
    """Names of the steps; the first is the opened look."""
    return [name.get_attribute("title") for name in editor.page.locator(".tile.step .tile-name").all()][1:]


def test_a_typed_number_is_one_step(editor: Editor) -> None:
    editor.choose("Ball", 1)
    page, slider = editor.page, editor.slider(SIGMA)
    expect(page.locator(".tile.step img")).to_have_count(1)  # taken when the hand has rested a while
    slider.focus()
    page.keyboard.type("0.35")
    expect(page.get_by_role("textbox", name=f"{SIGMA} value")).to_have_value("0.35")
    assert steps(editor) == []
    page.keyboard.press("Enter")
    expect(slider).to_have_attribute("aria-valuenow", "0.35")
    assert steps(editor) == [f"Ball · {SIGMA}"]
    expect(page.locator(".tile.step img")).to_have_count(2)

    page.get_by_role("button", name=f"{SIGMA}: 0.350; type a value").click()
    page.keyboard.type("0.35")
    page.keyboard.press("Enter")
    assert steps(editor) == [f"Ball · {SIGMA}"]

    red = page.get_by_role("textbox", name="Color, red, linear")
    red.click()
    page.keyboard.type("0.35")
    page.keyboard.press("Tab")
    page.keyboard.type("0.2")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert steps(editor) == [f"Ball · {SIGMA}", "Ball · Color", "Ball · Color"]


def test_a_swap_after_going_back_takes_no_step_away(editor: Editor) -> None:
    editor.choose("Ball", 1)
    page, slider = editor.page, editor.slider(SIGMA)
    slider.press("End")
    page.keyboard.press("a")
    page.keyboard.press(".")
    made = steps(editor)
    largest = slider.get_attribute("aria-valuenow")
    page.get_by_role("button", name="Go to step 0: Opened").click()
    opened = slider.get_attribute("aria-valuenow")
    assert opened != largest
    page.keyboard.press("x")
    expect(slider).to_have_attribute("aria-valuenow", str(largest))
    assert steps(editor) == [*made, "Back to the start", "Swap A and B"]
    expect(page.get_by_text("Your redo steps are kept")).to_be_visible()
    page.keyboard.press("Control+z")
    expect(slider).to_have_attribute("aria-valuenow", str(opened))
    page.keyboard.press("Control+z")
    expect(slider).to_have_attribute("aria-valuenow", str(largest))
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("x")
    expect(slider).to_have_attribute("aria-valuenow", str(opened))


def test_a_is_the_kept_picture_and_b_the_live_one(editor: Editor) -> None:
    page = editor.page
    page.keyboard.press("w")
    wipe = page.get_by_role("slider", name="Wipe between A and B (live)")
    expect(wipe).to_be_visible()
    hold = page.get_by_role("button", name="Show A", exact=True)
    page.keyboard.down("b")
    expect(hold).to_have_attribute("aria-pressed", "false")
    page.keyboard.up("b")
    page.keyboard.down("c")
    expect(hold).to_have_attribute("aria-pressed", "true")
    page.keyboard.up("c")
    expect(hold).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("?")
    compare = page.get_by_role("dialog", name="Keyboard shortcuts").locator("dl", has_text="Compare")
    expect(compare).to_contain_text("Hold to show AC")
    expect(compare).to_contain_text("Swap A and BX")
