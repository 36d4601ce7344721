"""Make the pictures of the guide: `docs/images/guide/<task>.png`, one for each page.

Starts `relume serve` on a temporary data directory with two built-in scenes, drives the editor in headless chromium at
1280×800, and takes one picture for each page of `docs/guide`. The bakes are small: each takes less than a minute.

Usage:
    .venv/bin/python scripts/make_guide_pictures.py [--only TASK ...] [--output DIR]

Elements are located by role, CSS class and keyboard shortcut where possible, so that a changed label breaks little.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from playwright.sync_api import Browser, Locator, Page, ViewportSize, sync_playwright

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "docs" / "images" / "guide"
VIEWPORT: ViewportSize = {"width": 1280, "height": 800}
WAIT_MS = 120_000
START_S = 240.0
CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM_ARGUMENTS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking"]
STILL_LIFE_BAKE = ("--method", "gather", "--view", "front", "--size", "480x360", "--lights", "300")
FREE_CAMERA_BAKE = ("--size", "480x480", "--lights", "100")
MATERIAL = "Teapot"
WAIT_FOR_FRAMES = """() => new Promise((done) => {
  let left = 4;
  const tick = () => (left-- > 0 ? requestAnimationFrame(tick) : done());
  tick();
})"""


class Relume:
    """The relume command and a server, on one data directory."""

    def __init__(self, command: str, data: Path) -> None:
        self._command, self._data = command, data
        self._process: subprocess.Popen[bytes] | None = None
        with socket.socket() as free_port:
            free_port.bind(("127.0.0.1", 0))
            self._port: int = free_port.getsockname()[1]
        self.url = f"http://127.0.0.1:{self._port}"

    def run(self, *arguments: str) -> str:
        """Run a command; returns its last line on stdout, the id of a scene or a bake."""
        command = [self._command, *arguments, "--data", str(self._data)]
        finished = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)  # noqa: S603
        return finished.stdout.split()[-1]

    def start(self) -> None:
        """Start the server and wait until it answers.

        Raises:
            RuntimeError: it does not start; the message has its log.
        """
        command = [self._command, "serve", "--data", str(self._data), "--port", str(self._port)]
        log_file = self._data / "server.txt"
        with log_file.open("ab") as log:
            environment = os.environ | {"RELUME_OCIO": "none", "RELUME_PREWARM": "false"}
            self._process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=ROOT)  # noqa: S603
        deadline = time.monotonic() + START_S
        while True:
            try:
                urllib.request.urlopen(f"{self.url}/readyz", timeout=2).close()  # noqa: S310
                return
            except OSError:
                if time.monotonic() > deadline or self._process.poll() is not None:
                    raise RuntimeError(f"the server did not start: {log_file.read_text()}") from None
                time.sleep(0.2)

    def stop(self) -> None:
        """Stop the server; kill it after 20 seconds."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Setup(NamedTuple):
    """Browser, address and scene ids for the pictures."""

    browser: Browser
    url: str
    still_life: str
    free_camera: str | None
    output: Path


@contextmanager
def new_page(browser: Browser) -> Iterator[Page]:
    """A page in a fresh browser profile."""
    context = browser.new_context(viewport=VIEWPORT)
    page = context.new_page()
    page.set_default_timeout(WAIT_MS)
    yield page
    context.close()


def save_picture(setup: Setup, page: Page, task: str) -> None:
    """Take the picture of a page of the guide, without messages."""
    time.sleep(1.5)  # for thumbnails
    page.evaluate(WAIT_FOR_FRAMES)
    page.screenshot(path=setup.output / f"{task}.png", style=".toasts { visibility: hidden !important }")


def wait_until_exact(page: Page) -> None:
    """Wait until the status bar reports an exact picture."""
    page.locator(".exactness").wait_for()
    page.evaluate(WAIT_FOR_FRAMES)
    page.locator(".exactness.is-exact", has_text=re.compile("exact", re.IGNORECASE)).wait_for()


@contextmanager
def open_editor(setup: Setup, **selection: str) -> Iterator[Page]:
    """The editor on the still life, its picture exact; `selection` is material, term, curve."""
    with new_page(setup.browser) as page:
        query = "".join(f"&{name}={value}" for name, value in selection.items())
        page.goto(f"{setup.url}/?scene={setup.still_life}{query}")
        wait_until_exact(page)
        yield page


def canvas_point(page: Page, u: float, v: float) -> tuple[float, float]:
    """Screen coordinates of a point of the picture, (u, v) in [0, 1] from the top left."""
    box = page.locator(".picture canvas").first.bounding_box()
    if box is None:
        raise RuntimeError("the picture is not visible")
    return box["x"] + u * box["width"], box["y"] + v * box["height"]


def drag_slider(page: Page, slider: Locator, start: float, stop: float) -> None:
    """Drag along a slider's track, between fractions of its length."""
    box = slider.bounding_box()
    if box is None:
        raise RuntimeError("the slider is not visible")
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + stop * box["width"], y, steps=12)
    page.mouse.up()
    time.sleep(1.0)


def set_color(page: Page, color: str) -> None:
    """Set the color of the expanded layer, without the browser's color picker."""
    script = "(field, color) => { field.value = color; field.dispatchEvent(new Event('input', { bubbles: true })); }"
    page.locator(".inspector input[type=color]").first.evaluate(script, color)
    time.sleep(1.0)
    wait_until_exact(page)


def show_control(page: Page, name: str) -> Locator:
    """A group of the top bar; opens the overflow menu if the bar has no room for it."""
    control = page.locator(f".control.{name}")
    if control.count() == 0:
        page.locator(".overflow .more > button").click()
    control.wait_for()
    return control


def open_scene(setup: Setup) -> None:
    """The start page with the built-in scenes."""
    with new_page(setup.browser) as page:
        page.goto(setup.url)
        page.locator(".built-ins li, .example-scenes li").first.wait_for()
        page.wait_for_load_state("networkidle")
        save_picture(setup, page, "open-a-scene")


def place_camera(setup: Setup) -> None:
    """A free-camera view, its camera menu open."""
    if setup.free_camera is None:
        return
    with new_page(setup.browser) as page:
        page.goto(f"{setup.url}/?scene={setup.free_camera}")
        bar = page.locator(".camera-bar")
        bar.wait_for()
        wait_until_exact(page)
        bar.locator(".menu > button").click()
        page.locator(".camera-menu").wait_for()
        save_picture(setup, page, "place-a-camera")


def change_material(setup: Setup) -> None:
    """The inspector of a material, one of its sliders changed."""
    with open_editor(setup, material=MATERIAL, term="1") as page:
        drag_slider(page, page.locator(".inspector [role=slider]").first, 0.5, 0.3)
        wait_until_exact(page)
        save_picture(setup, page, "change-a-material")


def draw_curve(setup: Setup) -> None:
    """The highlight curve of a material, a point moved, the pointer over the picture."""
    with open_editor(setup, material=MATERIAL, term="1") as page:
        tabs = page.locator(".curve-tabs button")
        if page.locator(".plot").count() == 0:
            tabs.first.click()
        points = page.locator(".plot [role=slider]")
        points.first.wait_for()
        points.nth(1).press("ArrowUp")
        points.nth(1).press("PageUp")
        wait_until_exact(page)
        page.mouse.move(*canvas_point(page, 0.42, 0.45))
        time.sleep(1.0)
        save_picture(setup, page, "draw-a-curve")


def light_scene(setup: Setup) -> None:
    """A panel light with its handles."""
    with open_editor(setup) as page:
        page.get_by_role("button", name="Add light").first.click()
        page.locator(".light-kinds button").nth(2).click()
        page.mouse.click(*canvas_point(page, 0.5, 0.8))
        page.locator(".light-handle").first.wait_for()
        wait_until_exact(page)
        save_picture(setup, page, "light-it")


def compare_looks(setup: Setup) -> None:
    """A wipe between two looks."""
    with open_editor(setup, material=MATERIAL, term="0") as page:
        page.mouse.move(*canvas_point(page, 0.5, 0.5))
        page.keyboard.press("a")
        set_color(page, "#1c5f8a")
        page.keyboard.press("w")
        page.locator(".wipe[role=slider]").wait_for()
        save_picture(setup, page, "compare")


def save_looks(setup: Setup) -> None:
    """Two saved looks and some steps of the history."""
    with open_editor(setup, material=MATERIAL, term="0") as page:
        for color in ("#1c5f8a", "#3f7d3a"):
            set_color(page, color)
            page.keyboard.press("Control+s")
            page.locator(".tiles.saved input").press("Enter")
            time.sleep(1.0)
        save_picture(setup, page, "save-and-share")


def export_picture(setup: Setup) -> None:
    """The export menu."""
    with open_editor(setup) as page:
        show_control(page, "export").locator("button[aria-expanded]").click()
        page.locator(".export-menu").wait_for()
        save_picture(setup, page, "export")


def work_together(setup: Setup) -> None:
    """Two people in a live session, the menu open."""
    forbid_copying = "() => { navigator.clipboard.writeText = () => Promise.reject(new Error('no')); }"
    with open_editor(setup, material=MATERIAL) as page, new_page(setup.browser) as second:
        page.evaluate(forbid_copying)
        page.locator(".together > button").click()
        menu = page.locator(".together .menu-body")
        menu.get_by_role("button").first.click()
        menu.locator("input[type=text]").first.fill("Ann")
        page.keyboard.press("Enter")
        menu.get_by_role("button").first.click()
        link = menu.locator("input[readonly]").input_value()
        second.goto(link)
        wait_until_exact(second)
        second.locator("nav [role=option]").nth(1).click()
        page.locator(".together .chip").first.wait_for()
        if menu.count() == 0:
            page.locator(".together > button").click()
        save_picture(setup, page, "together")


PICTURES: dict[str, Callable[[Setup], None]] = {
    "open-a-scene": open_scene,
    "place-a-camera": place_camera,
    "change-a-material": change_material,
    "draw-a-curve": draw_curve,
    "light-it": light_scene,
    "compare": compare_looks,
    "save-and-share": save_looks,
    "export": export_picture,
    "together": work_together,
}


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Make the pictures of docs/guide.")
    parser.add_argument("--only", nargs="+", choices=sorted(PICTURES), help="pictures to make; default all")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the pictures")
    parser.add_argument("--relume", default=str(Path(sys.executable).with_name("relume")), help="the relume command")
    parser.add_argument("--free-camera-method", default="probes", help="name of the free-camera method")
    return parser.parse_args()


def find_chromium() -> str:
    """Path of the installed browser.

    Raises:
        RuntimeError: there is none.
    """
    path = next(filter(None, map(shutil.which, CHROMIUM_NAMES)), None)
    if path is None:
        raise RuntimeError(f"no browser found; install one of {', '.join(CHROMIUM_NAMES)}")
    return path


def bake_scenes(relume: Relume, tasks: set[str], free_camera_method: str) -> dict[str, Any]:
    """Import and bake the built-in scenes that the pictures need; returns scene ids."""
    still_life = relume.run("import", "--built-in", "still_life", "--quiet")
    if tasks - {"open-a-scene", "place-a-camera"}:
        relume.run("bake", still_life, *STILL_LIFE_BAKE, "--quiet")
    free_camera = None
    if "place-a-camera" in tasks:
        free_camera = relume.run("import", "--built-in", "cornell_box", "--quiet")
        relume.run("bake", free_camera, "--method", free_camera_method, *FREE_CAMERA_BAKE, "--quiet")
    return {"still_life": still_life, "free_camera": free_camera}


def main() -> int:
    """Make the pictures; returns the number of those that failed."""
    arguments = parse_arguments()
    tasks = list(arguments.only or PICTURES)
    output = arguments.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    failures = {}
    with tempfile.TemporaryDirectory(prefix="relume-guide-") as data, sync_playwright() as playwright:
        relume = Relume(arguments.relume, Path(data))
        scenes = bake_scenes(relume, set(tasks), arguments.free_camera_method)
        relume.start()
        browser = playwright.chromium.launch(executable_path=find_chromium(), args=CHROMIUM_ARGUMENTS)
        try:
            setup = Setup(browser=browser, url=relume.url, output=output, **scenes)
            for task in tasks:
                try:
                    PICTURES[task](setup)
                except Exception as error:  # one missing picture should not cost the others
                    failures[task] = str(error)
        finally:
            browser.close()
            relume.stop()
    sys.stdout.write(json.dumps({"output": str(output), "failures": failures}, indent=1) + "\n")
    return len(failures)


if __name__ == "__main__":
    sys.exit(main())
