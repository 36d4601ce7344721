"""Names, focus and roles: what a keyboard and a screen reader need."""

from __future__ import annotations

from editor_page import NAMELESS, VIEWPORT, WAIT_MS, Editor
from editor_server import Server
from playwright.sync_api import Browser, Page, expect

FOCUSED = """() => {
  const e = document.activeElement;
  if (e === null || e === document.body) return null;
  const boxes = [getComputedStyle(e), getComputedStyle(e, "::after")];
  if (e.closest("label")) boxes.push(getComputedStyle(e.closest("label")));
  const visible = boxes.some((s) => s.outlineStyle !== "none" && parseFloat(s.outlineWidth) > 0)
    || e.querySelector("circle") !== null;
  return [e.outerHTML.slice(0, 160), visible];
}"""


OUTSIDE_LANDMARKS = """() => [...document.querySelectorAll("button, input, select, canvas, [tabindex]")]
  .filter((e) => e.checkVisibility())
  .filter((e) => !e.closest(".editor > header, main, nav, aside, footer, section[aria-label], [role=dialog]"))
  .map((e) => e.outerHTML.slice(0, 200))"""
# Contrast of text with the panel behind it, as WCAG 2.2 counts it; groups that let the panel through included.
CONTRAST = """(e) => {
  const channels = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (rgb) => {
    const [r, g, b] = rgb.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  let opacity = 1;
  for (let outer = e; outer !== null; outer = outer.parentElement) opacity *= Number(getComputedStyle(outer).opacity);
  const back = channels(getComputedStyle(e.closest(".filmstrip")).backgroundColor);
  const front = channels(getComputedStyle(e).color).map((v, c) => opacity * v + (1 - opacity) * back[c]);
  const [dark, bright] = [light(front), light(back)].sort((a, b) => a - b);
  return (bright + 0.05) / (dark + 0.05);
}"""

SMALL_TARGETS = """() => "button,select,input:not([type=file]),[role=slider],[role=separator]".split(",")
  .flatMap((kind) => [...document.querySelectorAll(kind)])
  .filter((e) => e.checkVisibility() && !(e instanceof SVGElement))
  .filter((e) => {
    const [box, more] = [e.getBoundingClientRect(), getComputedStyle(e, "::after")];
    const beyond = more.content === "none" ? 0 : -2 * (parseFloat(more.left) || 0);
    return Math.max(box.width, box.width + beyond) < 24 || box.height < 24;
  }).map((e) => e.outerHTML.slice(0, 160))"""


def assert_focus_is_visible(page: Page, num_stops: int) -> None:
    """Tab through the page; every stop shows where it is."""
    stops = []
    for _ in range(num_stops):
        page.keyboard.press("Tab")
        stop = page.evaluate(FOCUSED)
        if stop is not None:
            stops.append(stop)
    assert len({html for html, _ in stops}) > num_stops / 2
    assert [html for html, visible in stops if not visible] == []


def test_every_control_of_the_editor_can_be_read_found_and_reached_by_keys(
    editor: Editor,
) -> None:
    announced = editor.page.locator(".announce[role=status]")
    assert announced.get_attribute("aria-live") == "polite"
    assert "Connected" in announced.inner_text()
    for term in (0, 1):
        editor.choose("Ball", term)
        assert editor.page.evaluate(NAMELESS) == []
    editor.page.get_by_role("separator").wait_for()
    assert editor.page.evaluate(OUTSIDE_LANDMARKS) == []
    points = editor.page.locator(".plot [role=slider]")
    points.first.wait_for(timeout=WAIT_MS)
    assert points.count() >= 2
    for point in points.all():
        low, now, high = (float(point.get_attribute(f"aria-value{end}") or "nan") for end in ("min", "now", "max"))
        assert low <= now <= high
        assert "degrees" in (point.get_attribute("aria-valuetext") or "")
    editor.page.locator("body").click(position={"x": 640, "y": 2})
    assert_focus_is_visible(editor.page, 60)
    editor.page.reload()  # nothing has the focus
    editor.wait_until_exact()
    editor.page.keyboard.press(".")
    editor.page.keyboard.press("Control+z")
    caption = editor.page.locator(".tile.step.undone .tile-name")
    assert caption.evaluate(CONTRAST) >= 4.5


def test_start_page_has_names_and_visible_focus(server: Server, browser: Browser) -> None:
    page = browser.new_page()
    page.goto(server.url)
    page.locator(".scene-card img").wait_for(timeout=WAIT_MS)
    assert page.evaluate(NAMELESS) == []
    assert_focus_is_visible(page, 5)
    page.close()


def test_the_focus_comes_back_from_a_field_that_a_key_has_closed(editor: Editor) -> None:
    page = editor.page
    slider = page.get_by_role("slider", name="Environment brightness")
    for key in ("Enter", "Escape"):
        slider.focus()
        page.keyboard.press("5")
        page.get_by_role("textbox", name="Environment brightness value").wait_for()
        page.keyboard.press(key)
        assert slider.evaluate("e => e === document.activeElement"), key
    page.get_by_role("button", name="Save look").click()
    page.get_by_role("textbox", name="New name of").wait_for()
    page.keyboard.press("Enter")
    name = page.get_by_role("button", name="Rename ").first
    for key in ("Enter", "Escape"):
        name.focus()
        page.keyboard.press("Enter")
        page.get_by_role("textbox", name="New name of").wait_for()
        page.keyboard.press(key)
        assert name.evaluate("e => e === document.activeElement"), key
    page.keyboard.press("Control+z")
    expect(page.locator(".tiles.saved .tile")).to_have_count(0)


def test_a_finger_finds_what_it_presses(server: Server, browser: Browser) -> None:
    """Targets of at least 24 × 24 CSS pixels, WCAG 2.2's criterion 2.5.8; what reaches past its box counts whole."""
    (scene,) = server.call("/api/scenes")
    with browser.new_context(has_touch=True, viewport=VIEWPORT) as context:
        page = context.new_page()
        page.goto(f"{server.url}/?scene={scene['id']}")
        Editor(page).wait_until_exact()
        page.get_by_role("listbox", name="Materials").get_by_role("option").first.tap()
        page.get_by_role("separator").first.wait_for()
        assert page.evaluate(SMALL_TARGETS) == []
