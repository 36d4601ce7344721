"""The keyboard's place: passing by selects nothing, and the focus stays near when what had it goes."""

from __future__ import annotations

import pytest
from editor_page import WAIT_FOR_FRAMES, Editor
from playwright.sync_api import Page, expect


def add_light(page: Page, kind: str) -> None:
    page.get_by_role("button", name="Add light").press("Enter")
    page.get_by_role("group", name="Light type").get_by_role("button", name=kind).press("Enter")
    page.get_by_role("button", name="Place in center").press("Enter")
    expect(page.locator(".light.selected .name", has_text=kind)).to_be_focused()


@pytest.mark.slow
def test_the_focus_passes_a_handle_and_enter_takes_it(editor: Editor) -> None:
    """A selected light deselects the material; deleting it focuses the other."""
    page = editor.page
    for kind in ("Panel", "Sun"):
        editor.choose("Floor", 0)
        add_light(page, kind)
        expect(page.locator(".materials [aria-selected=true]")).to_have_count(0)
        expect(page.locator(".light.selected")).to_have_count(1)
    title = page.locator(".inspector h2").first
    editor.choose("Ball", 0)
    panel, sun = (page.locator(".light-handle.move", has=page.locator("svg")).nth(k) for k in range(2))
    for handle, name in ((panel, "Panel"), (sun, "Sun")):
        editor.choose("Ball", 0)
        handle.focus()
        expect(title).to_have_text("Ball")
        page.keyboard.press("Enter")
        expect(title).to_contain_text(name)
    assert panel.locator("path").get_attribute("d") != sun.locator("path").get_attribute("d")
    page.keyboard.press("Delete")
    expect(page.locator(".light-handle.move")).to_be_focused()
    page.keyboard.press("Control+z")


@pytest.mark.parametrize("name", ["Evening", "Morning"])
def test_a_look_that_is_named_or_deleted_leaves_the_focus_in_the_strip(editor: Editor, name: str) -> None:
    page = editor.page
    page.keyboard.press("Control+s")
    field = page.locator(".filmstrip input")
    expect(field).to_be_focused()
    field.fill(name)
    page.keyboard.press("Enter")
    expect(page.get_by_label(f"Show {name}")).to_be_focused()
    page.get_by_label(f"Delete {name}").press("Enter")
    expect(page.get_by_label(f"Show {name}")).to_have_count(0)
    expect(page.locator(".filmstrip :focus")).to_have_count(1)


def test_what_closes_gives_the_focus_back(editor: Editor) -> None:
    page = editor.page
    comments = page.get_by_role("button", name="Comments", exact=True)
    for _ in range(2):
        comments.press("Enter")
        page.get_by_role("complementary", name="Comments").get_by_role("button", name="Close").press("Enter")
        expect(comments).to_be_focused()
        page.keyboard.press("?")
        expect(page.get_by_role("dialog", name="Keyboard shortcuts")).to_be_focused()
        page.keyboard.press("Escape")
        expect(comments).to_be_focused()


def test_a_point_in_the_tail_moves_by_a_share_of_its_value(editor: Editor) -> None:
    """By keys, twice there and twice back, as the one at the peak does."""
    page = editor.page
    editor.choose("Ball", 1)
    points = page.locator(".plot [role=slider]")
    expect(points.first).to_be_visible()
    values = [float(point.get_attribute("aria-valuenow") or "nan") for point in points.all()]
    tail = min(value for value in values if value > 0)
    assert max(values) > 20 * tail
    for start in (max(values), tail):
        point = points.nth(values.index(start))
        point.focus()
        for key, factor in (("ArrowUp", 1.02), ("ArrowUp", 1.02**2), ("ArrowDown", 1.02), ("ArrowDown", 1.0)):
            page.keyboard.press(key)
            page.evaluate(WAIT_FOR_FRAMES)
            value = float(point.get_attribute("aria-valuenow") or "nan")
            assert value == pytest.approx(start * factor, rel=1e-3)
