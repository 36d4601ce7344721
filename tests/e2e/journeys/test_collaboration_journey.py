"""Two people on one look: what one edits the other sees, each undoes their own; who watches edits nothing."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from editor_page import Editor, changed, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Page, expect


@pytest.fixture
def others(browser: Browser) -> Iterator[tuple[Page, Page]]:
    """Two more profiles."""
    with opened_page(browser) as bob, opened_page(browser) as vera:
        yield bob, vera


def link(editor: Editor, kind: str) -> str:
    """The link into the room, as it stands where the browser does not let pages copy."""
    page = editor.page
    page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(new Error('no')); }")
    page.get_by_role("button", name=f"Copy {kind} link").click()
    field = page.get_by_role("dialog", name="Work together").locator("input[readonly]")
    expect(field).to_be_focused()
    found = field.input_value()
    page.keyboard.press("Escape")
    return found


def people(page: Page) -> None:
    page.locator(".together > button").press("Enter")


def test_two_edit_one_look_and_a_third_watches(editor: Editor, others: tuple[Page, Page], server: Server) -> None:
    ann, (bob_page, vera_page) = editor, others
    people(ann.page)
    ann.page.get_by_role("button", name="Start live session").click()
    ann.page.get_by_label("Your name").fill("Ann")
    ann.page.keyboard.press("Enter")
    together = link(ann, "edit")
    people(ann.page)
    watch = link(ann, "view-only")
    assert ann.page.evaluate("new URLSearchParams(location.hash.slice(1)).get('room')") not in watch

    bob, vera = Editor(bob_page), Editor(vera_page)
    bob_page.goto(together)
    vera_page.goto(watch)
    bob.wait_until_exact()
    vera.wait_until_exact()
    expect(ann.page.locator(".together .chip")).to_have_count(2)
    before = bob.pixels()

    ann.choose("Ball", 1)
    ann.drag(ann.slider("Roughness σ"), 0.3, 0.8)
    ann_value = ann.slider("Roughness σ").get_attribute("aria-valuenow")
    expect(bob_page.locator(".together .chip")).to_contain_text(["Ann", "Guest"])
    expect(bob_page.locator(".together .chip").first).to_contain_text("Ball")
    bob.choose("Ball", 1)
    expect(bob.slider("Roughness σ")).to_have_attribute("aria-valuenow", str(ann_value))
    after = bob.pixels()
    assert changed(before, after) > 0.01
    assert changed(vera.pixels(), after) == 0

    # Bob edits something else, Ann undoes what is hers
    bob.choose("Floor", 0)
    bob_page.locator(".inspector input.number").first.fill("0.2")
    bob_page.keyboard.press("Enter")
    both = bob.pixels()
    assert changed(both, after) > 0.01
    assert changed(ann.pixels(), both) == 0
    ann.page.get_by_role("button", name="Undo").click()
    expect(bob_page.locator(".tile.step")).to_have_count(2)  # the start, and what is his
    ann.choose("Floor", 0)
    expect(ann.page.locator(".inspector input.number").first).to_have_value("0.200")
    undone = ann.pixels()
    assert changed(undone, both) > 0.01
    assert changed(bob.pixels(), undone) == 0

    # each has their own exposure; Vera reads that she has view-only access
    expect(vera_page.locator(".read-only")).to_contain_text("View-only link")
    ann.page.get_by_role("slider", name="Exposure").press("ArrowRight")
    assert changed(ann.pixels(), undone) > 0.01
    assert changed(bob.pixels(), undone) == 0

    # what one pins to a pixel the others see
    ann.page.keyboard.press("n")
    ann.page.get_by_role("complementary", name="Comments").get_by_role("textbox").fill("Softer here?")
    ann.page.keyboard.press("Control+Enter")
    vera_page.get_by_role("button", name="Comments 1").click()
    expect(vera_page.locator(".comment")).to_contain_text(["Ann"])
    expect(vera_page.locator(".comment").get_by_role("button", name="Resolve")).to_have_count(0)
    ann.page.get_by_role("button", name="Delete comment 1").click()
    expect(vera_page.locator(".comment")).to_have_count(0)

    # a reload comes back to the same place
    bob_page.reload()
    assert changed(bob.pixels(), undone) == 0
    expect(ann.page.locator(".together .chip")).to_have_count(2)
    bob_page.get_by_role("button", name="Undo").click()
    bob.wait_until_exact()
    expect(ann.page.locator(".inspector input.number").first).not_to_have_value("0.200")
