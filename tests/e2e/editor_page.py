"""Actions of a person in the editor."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, ViewportSize

WAIT_MS = 120_000
VIEWPORT: ViewportSize = {"width": 1280, "height": 800}
# A patch is sent within one animation frame, the status bar follows within another.
WAIT_FOR_FRAMES = """() => new Promise((done) => {
  let left = 4;
  const tick = () => (left-- > 0 ? requestAnimationFrame(tick) : done());
  tick();
})"""
# Messages lie over the picture's foot for some seconds.
WITHOUT_MESSAGES = ".toasts, .limits { visibility: hidden !important }"  # nor what a corner says of the picture
# Controls that a screen reader has no word for.
NAMELESS = """() => {
  const controls = "button, input, select, canvas:not([aria-hidden]), a, [role=slider], [role=option], [tabindex='0']";
  const text = (e) => [e.getAttribute("aria-label"), ...[...(e.labels ?? [])].map((l) => l.textContent), e.innerText,
    e.querySelector?.("img[alt]:not([alt=''])")?.alt].map((t) => (t ?? "").trim()).filter(Boolean);
  return [...document.querySelectorAll(controls)]
    .filter((e) => e.checkVisibility() && text(e).length === 0).map((e) => e.outerHTML.slice(0, 200));
}"""


class Editor:
    """The open editor."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.canvas = page.locator(".picture canvas")

    def wait_until_exact(self) -> None:
        """Until the status bar says that the picture equals the look."""
        self.page.locator(".exactness").wait_for(timeout=WAIT_MS)
        self.page.evaluate(WAIT_FOR_FRAMES)
        self.page.locator(".exactness.is-exact", has_text="exact").wait_for(timeout=WAIT_MS)

    def pixels(self) -> NDArray[np.int16]:
        """The canvas as it is on the screen, once it is exact. (height, width, 3)"""
        self.wait_until_exact()
        return self.read_pixels()

    def read_pixels(self) -> NDArray[np.int16]:
        """The canvas as it is on the screen, exact or not. (height, width, 3)"""
        self.page.mouse.move(2, 2)  # a pointer over the picture outlines what it is over
        self.page.evaluate(WAIT_FOR_FRAMES)
        with Image.open(io.BytesIO(self.canvas.screenshot(style=WITHOUT_MESSAGES))) as image:
            return np.asarray(image.convert("RGB")).astype(np.int16)

    def choose(self, material: str, term: int) -> None:
        """Select a material in the list and unfold one of its terms."""
        self.page.get_by_role("option", name=material).click()
        fold = self.page.locator(".card .fold").nth(term)
        if fold.get_attribute("aria-expanded") != "true":
            fold.click()
        self.wait_until_exact()

    def slider(self, name: str) -> Locator:
        """A parameter's slider in the inspector."""
        return self.page.locator(".inspector").get_by_role("slider", name=name, exact=True)

    def drag(self, slider: Locator, start: float, stop: float) -> None:
        """Drag along a slider's track, between fractions of its length."""
        box = slider.bounding_box()
        assert box is not None
        x, y = (lambda at: box["x"] + at * box["width"]), box["y"] + box["height"] / 2
        self.page.mouse.move(x(start), y)
        self.page.mouse.down()
        self.page.mouse.move(x(stop), y, steps=12)
        self.page.mouse.up()


def wait_until_drawn(page: Page) -> None:
    """Wait for the first image of a free-camera view."""
    page.locator(".camera-bar").wait_for(timeout=WAIT_MS)
    page.wait_for_function("() => document.querySelector('.zoom')?.textContent.includes('%')", timeout=WAIT_MS)


@contextmanager
def opened_page(browser: Browser) -> Iterator[Page]:
    """A page in a fresh browser profile, at 1280×800; no script on it may fail."""
    context = browser.new_context(viewport=VIEWPORT)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield page
    context.close()
    assert errors == []


def clear_storage(page: Page, url: str) -> None:
    """Leave the editor, and make the profile of its page as fresh as it was."""
    page.goto(f"{url}/readyz")  # of the same origin, and without scripts that would keep something
    page.evaluate("localStorage.clear(), sessionStorage.clear()")
    page.unroute_all()
    page.context.clear_cookies()
    page.context.clear_permissions()
    page.set_viewport_size(VIEWPORT)


def changed(before: NDArray[np.int16], after: NDArray[np.int16]) -> float:
    """Share of the pixels that differ visibly."""
    return float((np.abs(before - after).max(axis=2) > 2).mean())
