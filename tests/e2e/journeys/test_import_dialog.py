"""The dialog after an import: clay picture, size and options of a file, its warnings, and the editor before a bake."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from editor_page import WAIT_MS, Editor, opened_page
from editor_server import Server
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, expect

CORNERS = [(x, y, z) for x in (0, 400) for y in (0, 300) for z in (0, 2000)]  # a pillar in millimeters that stands on Z
SIDES = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
CLAY = "img.clay:not(.is-loading)"


@pytest.fixture
def pillar(tmp_path: Path) -> Path:
    """An .obj whose four materials name images that are missing."""
    names = ["Base", "Shaft", "Ring", "Top"]
    faces = [f"usemtl {names[k % 4]}\nf {side}" for k, side in enumerate(SIDES)]
    text = "\n".join(["mtllib pillar.mtl", *("v {} {} {}".format(*corner) for corner in CORNERS), *faces])
    (tmp_path / "pillar.obj").write_text(text + "\n")
    (tmp_path / "pillar.mtl").write_text("".join(f"newmtl {name}\nmap_Kd {name}.png\n" for name in names))
    return tmp_path / "pillar.obj"


@pytest.fixture
def start(server: Server, browser: Browser) -> Iterator[Page]:
    """The start page in a fresh profile; scenes that a test imports are gone afterwards."""
    known = {scene["id"] for scene in server.call("/api/scenes")}
    with opened_page(browser) as page:
        page.goto(server.url)
        expect(page.get_by_text("choose files")).to_be_visible()
        yield page
    for scene in server.call("/api/scenes"):
        if scene["id"] not in known:
            server.delete(f"/api/scenes/{scene['id']}")


def import_pillar(start: Page, pillar: Path) -> Locator:
    """Import the file and return the dialog."""
    start.get_by_label("choose files").set_input_files([pillar, pillar.with_suffix(".mtl")])
    start.get_by_role("button", name="Import", exact=True).click()
    return start.get_by_role("region", name="Bake pillar")


def silhouette(picture: Locator) -> tuple[int, int]:
    """Columns and rows of the surfaces in a clay picture on the screen."""
    with Image.open(io.BytesIO(picture.screenshot())) as image:
        rows, columns = np.nonzero(np.asarray(image.convert("L")) > 70)
    return int(np.ptp(columns)), int(np.ptp(rows))


def test_options_turn_and_scale_the_scene_in_the_dialog(start: Page, server: Server, pillar: Path) -> None:
    before = len(server.call("/api/scenes"))
    dialog = import_pillar(start, pillar)
    clay = dialog.locator(CLAY)
    expect(clay).to_be_visible()
    columns, rows = silhouette(clay)
    assert columns > rows  # it lies
    size = dialog.locator(".scene-size")
    expect(size).to_have_text("400 × 300 × 2,000 m")
    expect(dialog).to_contain_text("Larger than 100 m: a person would be 1/1,100 of its longest side")
    dialog.get_by_label("Unit").select_option("Millimeters")
    expect(size).to_have_text("0.40 × 0.30 × 2.00 m")
    expect(dialog.locator(".doubt")).to_have_count(0)
    dialog.get_by_label("Up axis").focus()
    for key in ("ArrowDown", "ArrowDown"):  # +Y, then +Z
        start.keyboard.press(key)
    expect(size).to_have_text("0.40 × 2.00 × 0.30 m")
    expect(dialog.get_by_role("status").first).to_have_text("Imported with Up axis +Z, Unit Millimeters.")
    expect(dialog.get_by_label("Up axis")).to_be_focused()
    expect(clay).to_be_visible()
    columns, rows = silhouette(clay)
    assert rows > 2 * columns  # it stands
    expect(start.locator(".scene-card")).to_have_count(before + 1)  # those before are gone
    scenes = server.call("/api/scenes")
    (scene,) = (each for each in scenes if each["name"] == "pillar")
    assert scene["import_options"] == {
        "up": "z",
        "unit": "mm",
        "recenter": "auto",
        "light_unit": "file",
        "scene_name": "",
        "time": None,
    }
    start.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    assert start.evaluate("document.activeElement.closest('main') !== null || document.activeElement === document.body")


def test_the_time_of_an_animation_is_a_number_that_can_be_taken_back(start: Page, server: Server, pillar: Path) -> None:
    dialog = import_pillar(start, pillar)
    time, status = dialog.get_by_role("spinbutton", name="Time"), dialog.get_by_role("status").first
    time.fill("1.5")
    time.press("Enter")
    expect(status).to_have_text("Imported with Time 1.5.")
    (scene,) = (each for each in server.call("/api/scenes") if each["name"] == "pillar")
    assert scene["import_options"]["time"] == 1.5
    time.fill("")
    time.press("Enter")
    expect(status).to_have_text("Imported as the file says.")
    expect(time).to_have_value("")


def test_a_refused_option_is_explained_and_taken_back(start: Page, pillar: Path) -> None:
    dialog = import_pillar(start, pillar)
    expect(dialog.locator(CLAY)).to_be_visible()
    refusal = json.dumps({"title": "Unprocessable Content", "detail": "the scene is too large; choose a smaller unit"})
    start.route("**/api/scenes", lambda route: route.fulfill(status=422, body=refusal))
    dialog.get_by_label("Unit").select_option("Meters")
    expect(dialog.get_by_role("alert")).to_contain_text("Options unchanged: the scene is too large")
    expect(dialog.get_by_label("Unit").locator("option:checked")).to_have_text("As in file")


def test_four_warnings_of_a_kind_are_one_line(start: Page, pillar: Path) -> None:
    dialog = import_pillar(start, pillar)
    group = dialog.get_by_role("region", name="Differs from the file")
    line = group.locator("summary")
    expect(line).to_have_count(1)
    expect(line).to_contain_text("4 ×")
    expect(line).to_contain_text("Base.png, Shaft.png, Ring.png and 1 more")
    expect(group.get_by_text("Top.png")).to_be_hidden()
    line.focus()
    start.keyboard.press("Enter")
    expect(group.get_by_text("Top.png")).to_be_visible()


def test_the_editor_shows_clay_until_the_first_bake(start: Page, pillar: Path) -> None:
    dialog = import_pillar(start, pillar)
    dialog.get_by_label("Unit").select_option("Millimeters")
    expect(dialog.locator(".scene-size")).to_have_text("0.40 × 0.30 × 2.00 m")
    start.keyboard.press("Escape")
    card = start.locator(".scene-card", has_text="pillar")
    expect(card).to_have_count(1)  # the one before the option is gone
    expect(card.locator(CLAY)).to_be_visible()
    card.get_by_role("button", name="Open pillar").click()
    expect(start.locator(f".picture {CLAY}")).to_be_visible()
    expect(start.locator(".picture")).to_contain_text("Clay picture: shape only.")
    columns, rows = silhouette(start.locator(f".picture {CLAY}"))
    assert columns > rows
    Editor(start).wait_until_exact()
    start.locator(".picture .clay").wait_for(state="detached", timeout=WAIT_MS)
