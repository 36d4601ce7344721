"""The library and saved looks in a browser: found by words, whole names, balls that are there at once, names given."""

from __future__ import annotations

import re

from editor_page import Editor
from playwright.sync_api import expect


def test_materials_are_found_by_words_and_show_their_balls_at_once(editor: Editor) -> None:
    page = editor.page
    page.get_by_role("button", name="Library").first.click()
    balls = page.locator(".library-balls button")
    expect(balls.nth(20)).to_be_visible()
    num_all = balls.count()
    cut_off = "spans => spans.filter((s) => s.scrollWidth > s.clientWidth + 1).map((s) => s.textContent)"
    assert page.locator(".library-balls span").evaluate_all(cut_off) == []
    search = page.get_by_role("searchbox", name="Search the library")
    search.fill("paint")
    expect(balls.first).to_contain_text("paint")
    assert 0 < balls.count() < num_all
    assert all("paint" in name for name in balls.all_inner_texts())
    image = balls.first.locator("img")
    assert image.evaluate("async (image) => { await image.decode(); return image.naturalWidth; }") == 64
    search.fill("no such thing")
    expect(page.get_by_text("No matches for “no such thing”")).to_be_visible()


def test_a_look_is_named_when_it_is_saved_and_again_later(editor: Editor) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    saved = page.locator(".tiles.saved .tile")
    before = saved.count()
    page.get_by_role("button", name="Save look").click()
    name = page.get_by_role("textbox", name=re.compile("^New name of Look"))
    expect(name).to_be_focused()
    name.fill("Morning")
    name.press("Enter")
    title = page.get_by_role("button", name="Rename Morning")
    expect(title).to_be_visible()
    expect(saved).to_have_count(before + 1)  # the tile of the first name is gone, and no other moves under the pointer
    title.click()
    again = page.get_by_role("textbox", name="New name of Morning")
    again.fill("Evening")
    again.press("Escape")
    expect(title).to_be_visible()
    page.keyboard.press("Control+z")  # the name, then the look: both are steps
    expect(page.get_by_role("button", name=re.compile("^Rename Look "))).to_be_visible()
    page.keyboard.press("Control+z")
    expect(saved).to_have_count(before)
