"""Names, focus and roles: what a keyboard and a screen reader need."""

from __future__ import annotations

import pytest
from editor_page import WAIT_MS, Editor
from editor_server import Server
from playwright.sync_api import Browser, Page

NAMELESS = """() => {
  const controls = "button, input, select, canvas:not([aria-hidden]), a, [role=slider], [role=option], [tabindex='0']";
  const text = (e) => [e.getAttribute("aria-label"), ...[...(e.labels ?? [])].map((l) => l.textContent), e.innerText,
    e.querySelector?.("img[alt]:not([alt=''])")?.alt].map((t) => (t ?? "").trim()).filter(Boolean);
  return [...document.querySelectorAll(controls)]
    .filter((e) => e.checkVisibility() && text(e).length === 0).map((e) => e.outerHTML.slice(0, 200));
}"""
FOCUSED = """() => {
  const e = document.activeElement;
  if (e === null || e === document.body) return null;
  const boxes = [getComputedStyle(e), getComputedStyle(e, "::after")];
  if (e.closest("label")) boxes.push(getComputedStyle(e.closest("label")));
  const visible = boxes.some((s) => s.outlineStyle !== "none" && parseFloat(s.outlineWidth) > 0)
    || e.querySelector("circle") !== null;
  return [e.outerHTML.slice(0, 160), visible];
}"""


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


@pytest.mark.parametrize("term", [0, 1])
def test_every_control_of_the_editor_has_a_name(editor: Editor, term: int) -> None:
    editor.choose("Ball", term)
    assert editor.page.evaluate(NAMELESS) == []


def test_focus_is_visible_in_the_editor(editor: Editor) -> None:
    editor.choose("Ball", 1)
    editor.page.locator(".plot [role=slider]").first.wait_for(timeout=WAIT_MS)
    editor.page.locator("body").click(position={"x": 640, "y": 2})
    assert_focus_is_visible(editor.page, 60)


def test_start_page_has_names_and_visible_focus(server: Server, browser: Browser) -> None:
    page = browser.new_page()
    page.goto(server.url)
    page.locator(".scene-card img").wait_for(timeout=WAIT_MS)
    assert page.evaluate(NAMELESS) == []
    assert_focus_is_visible(page, 5)
    page.close()


def test_curve_points_are_sliders(editor: Editor) -> None:
    editor.choose("Ball", 1)
    points = editor.page.locator(".plot [role=slider]")
    points.first.wait_for(timeout=WAIT_MS)
    assert points.count() >= 2
    for point in points.all():
        low, now, high = (float(point.get_attribute(f"aria-value{end}") or "nan") for end in ("min", "now", "max"))
        assert low <= now <= high
        assert "degrees" in (point.get_attribute("aria-valuetext") or "")


def test_what_happens_is_announced(editor: Editor) -> None:
    announced = editor.page.locator(".announce[role=status]")
    assert announced.get_attribute("aria-live") == "polite"
    assert "Connected" in announced.inner_text()
