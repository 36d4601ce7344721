"""Comments by keys alone: pinned, kept with a picture, resolved, deleted, had back."""

from __future__ import annotations

from editor_page import Editor
from playwright.sync_api import expect


def test_a_comment_is_pinned_written_resolved_and_deleted_without_a_pointer(editor: Editor) -> None:
    page = editor.page
    page.keyboard.press("n")
    panel = page.get_by_role("complementary", name="Comments")
    words = panel.get_by_role("textbox")
    expect(words).to_be_focused()
    expect(panel.get_by_role("status")).to_have_text("Comment on “front” at 160, 120")
    pin = page.locator(".pin.new")
    pin.press("ArrowRight")
    pin.press("Shift+ArrowUp")
    expect(panel.get_by_role("status")).to_have_text("Comment on “front” at 161, 110")
    words.fill("Too <b>bright</b>\nhere")
    words.press("Control+Enter")
    entry = panel.locator(".comment")
    expect(entry.locator(".comment-text")).to_have_text("Too <b>bright</b>\nhere", use_inner_text=True)
    expect(entry.locator(".comment-head")).to_contain_text("Guest")
    expect(entry.locator("img")).to_be_visible()
    assert entry.locator("img").evaluate("async (e) => (await e.decode(), e.naturalWidth)") == 320
    expect(page.get_by_role("button", name="Comment 1 by Guest")).to_have_attribute("aria-pressed", "true")

    page.reload()
    editor.wait_until_exact()
    page.get_by_role("button", name="Comments 1").press("Enter")
    page.get_by_role("button", name="Comment 1 by Guest").press("Enter")
    expect(entry).to_have_class("comment selected ")
    panel.get_by_role("button", name="Resolve").press("Enter")
    expect(entry).to_have_count(0)
    panel.get_by_role("checkbox").press(" ")
    expect(entry).to_contain_text("Resolved by somebody")
    panel.get_by_role("button", name="Reopen").press("Enter")
    expect(page.locator(".pin")).to_have_count(1)

    panel.get_by_role("button", name="Delete comment 1").press("Enter")
    expect(page.locator(".pin")).to_have_count(0)
    page.locator(".toast").get_by_role("button", name="Undo").press("Enter")
    expect(page.locator(".pin")).to_have_count(1)
    expect(entry.locator("img")).to_be_visible()
    panel.get_by_role("button", name="Delete comment 1").press("Enter")
    expect(panel).to_contain_text("No comments yet.")


def test_words_go_on_after_a_click_that_pins_them_elsewhere(editor: Editor) -> None:
    page = editor.page
    page.keyboard.press("n")
    words = page.get_by_role("complementary", name="Comments").get_by_role("textbox")
    words.fill("Too bright")
    editor.canvas.click(position={"x": 200, "y": 200})
    expect(words).to_be_focused()
    expect(words).to_have_value("Too bright")


def test_who_shares_a_look_has_one_name_everywhere(editor: Editor) -> None:
    """In the list of people, and as the author of a comment: where nobody logs in, the server names them."""
    page = editor.page
    page.locator(".together > button").press("Enter")
    page.get_by_role("button", name="Start live session").click()
    name = page.locator(".people .who").inner_text()
    page.keyboard.press("Escape")
    page.keyboard.press("n")
    panel = page.get_by_role("complementary", name="Comments")
    panel.get_by_role("textbox").fill("whose?")
    panel.get_by_role("textbox").press("Control+Enter")
    assert name.startswith("Guest ")
    expect(panel.locator(".comment-head")).to_contain_text(name)
    panel.get_by_role("button", name="Delete comment 1").press("Enter")
    expect(panel.locator(".comment")).to_have_count(0)
