"""Small and zoomed windows: every control can be reached, none is cut off, and nothing scrolls sideways."""

from __future__ import annotations

import pytest
from editor_page import WAIT_FOR_FRAMES, WAIT_MS, Editor
from editor_server import Server
from playwright.sync_api import Browser, Page, expect

pytestmark = pytest.mark.slow  # by themselves they take minutes of a browser

# the last is a window of 1280×800 at 200 %
SIZES = [(1280, 800), (1024, 768), (900, 600), (640, 400)]
# Controls that are outside the window, or outside something that does not scroll them into view.
CUT_OFF = """() => {
  const inside = (element, low, high, over, length) => {
    let box = element.getBoundingClientRect();
    for (let outer = element.parentElement; outer !== null; outer = outer.parentElement) {
      const style = getComputedStyle(outer), bounds = outer.getBoundingClientRect();
      if (/auto|scroll/.test(style[over])) box = bounds;
      else if (style[over] !== "visible" && (box[low] < bounds[low] - 1 || box[high] > bounds[high] + 1)) return false;
      if (style.position === "fixed") break;
    }
    return box[low] > -1 && box[high] < length + 1;
  };
  const seen = (e) =>
    inside(e, "left", "right", "overflowX", innerWidth) && inside(e, "top", "bottom", "overflowY", innerHeight);
  const controls = "button, input:not([type=file]), select, canvas, summary, [role=slider], [role=separator]";
  const cut = [...document.querySelectorAll(controls)]
    .filter((e) => e.checkVisibility() && e.closest("svg") === null)
    .filter((e) => !seen(e))
    .map((e) => e.outerHTML.slice(0, 160));
  return document.documentElement.scrollWidth > innerWidth ? [...cut, "the page scrolls sideways"] : cut;
}"""
SHARE = "Share: copy a link to this look"
TOP_BAR = ["All scenes", "Undo", "Redo", "front", "left", "Swap", "PNG", "EXR", SHARE, "Inspector"]


def assert_nothing_is_cut_off(page: Page, where: str) -> None:
    page.evaluate(WAIT_FOR_FRAMES)
    assert page.evaluate(CUT_OFF) == [], f"{where} at {page.viewport_size}"


def assert_top_bar_is_whole(page: Page) -> None:
    """Items that do not fit the row are in its menu."""
    bar = page.locator(".top-bar")
    more = bar.get_by_role("button", name="More", exact=True)
    if more.count():
        more.click()
        assert_nothing_is_cut_off(page, "the menu of the rest")
    for name in TOP_BAR:
        expect(bar.get_by_role("button", name=name, exact=True)).to_be_visible()
    expect(bar.get_by_role("slider", name="Exposure")).to_be_visible()
    if more.count():
        page.keyboard.press("Escape")
        expect(more).to_have_attribute("aria-expanded", "false")


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_everything_in_the_editor_can_be_reached(editor: Editor, size: tuple[int, int]) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    assert_nothing_is_cut_off(page, "the editor")
    assert_top_bar_is_whole(page)
    panels = page.get_by_role("group", name="Panels")
    for name, panel in (("Scene panel", ".outline"), ("Inspector", ".inspector")):
        if page.locator(panel).count() == 0:
            panels.get_by_role("button", name=name).click()
        expect(page.locator(panel)).to_be_visible()
        assert_nothing_is_cut_off(page, name)
    page.get_by_role("button", name="Library").click()
    page.locator(".library-balls button").first.wait_for(timeout=WAIT_MS)
    assert_nothing_is_cut_off(page, "the library")
    page.locator(".library").get_by_role("button", name="Close").click()
    expect(page.locator(".inspector")).to_be_visible()  # it comes back where it had made room

    ask = page.get_by_role("button", name="Compare with reference")
    ask.click()
    expect(page.get_by_role("complementary", name="Compare with reference")).to_be_visible()
    assert_nothing_is_cut_off(page, "the comparison with brute force")
    ask.click()

    page.keyboard.press("?")
    keys = page.get_by_role("dialog", name="Keyboard shortcuts")
    keys.get_by_text("Side-by-side view").scroll_into_view_if_needed()
    assert_nothing_is_cut_off(page, "the keyboard map")
    page.keyboard.press("Escape")
    page.locator(".top-bar .menu > button", has_text="direct light").click()
    expect(page.locator(".presets .plan").first).to_contain_text("memory", timeout=WAIT_MS)
    assert_nothing_is_cut_off(page, "the bake menu")
    page.keyboard.press("Escape")
    page.keyboard.press("e")
    page.keyboard.press("h")
    page.keyboard.press("v")
    expect(page.locator(".cell")).to_have_count(2)
    assert_nothing_is_cut_off(page, "two views")
    legend, canvas = page.locator(".legend").bounding_box(), page.locator(".cells").bounding_box()
    assert legend is not None
    assert canvas is not None
    assert legend["y"] >= canvas["y"] + canvas["height"]
    assert canvas["height"] > 60


def test_everything_on_the_start_page_can_be_reached(server: Server, browser: Browser) -> None:
    page = browser.new_page()
    page.goto(server.url)
    page.get_by_role("button", name="Bake…").first.click()
    expect(page.locator(".presets .plan").first).to_contain_text("memory", timeout=WAIT_MS)
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        assert_nothing_is_cut_off(page, "the start page")
    picture, card = page.locator(".scene-card img").bounding_box(), page.locator(".scene-card").bounding_box()
    assert picture is not None
    assert card is not None
    assert [picture[key] for key in ("x", "y", "width")] == [card[key] for key in ("x", "y", "width")]
    page.close()


def test_the_status_bar_stands_at_the_bottom_when_only_the_picture_is_shown(editor: Editor) -> None:
    editor.page.keyboard.press("\\")
    expect(editor.page.locator(".filmstrip")).to_have_count(0)
    status = editor.page.locator(".status").bounding_box()
    assert status is not None
    assert status["y"] + status["height"] == 800
