"""The library in a browser: however a material comes onto an object, the object's images do not come along."""

from __future__ import annotations

import pytest
from editor_page import Editor
from editor_server import Server
from merl_files import make_planes
from playwright.sync_api import Locator, Page, expect

from relume.assets.measured.measured_store import store_material
from relume.assets.measured.merl import write_merl
from relume_worker.paths import materials_path


@pytest.fixture(scope="module")
def measured(server: Server, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Name of a measured material in the server's library."""
    path = tmp_path_factory.mktemp("measured") / "paint.binary"
    write_merl(path, make_planes())
    store_material(materials_path(server.data), path, "Blue paint")
    return "Blue paint"


def textures(page: Page) -> list[str]:
    """The image that each term of the selected material takes."""
    found = []
    folds = page.locator(".card .fold")
    for index in range(folds.count()):
        folds.nth(index).click()
        found.append(page.locator(".inspector .texture select").input_value())
    return found


def place_of(editor: Editor, material: str) -> tuple[float, float]:
    """Screen position of a material: the panels leave little room for the image."""
    box = editor.canvas.bounding_box()
    assert box is not None
    for share in (0.5, 0.55, 0.6, 0.65, 0.7, 0.8):  # beside the picture, what was last read would stay
        x, y = box["x"] + 0.5 * box["width"], box["y"] + share * box["height"]
        editor.page.mouse.move(x, y)
        editor.page.wait_for_timeout(300)
        shown = editor.page.locator(".picture-bar .material")
        if shown.count() and shown.inner_text() == material:
            return x, y
    raise AssertionError(f"{material} is nowhere below the middle of the picture")


def first_ball(page: Page) -> Locator:
    """Entries of the library."""
    return page.locator(".library-balls button").first


@pytest.mark.slow
def test_a_material_replaces_images_however_it_comes(editor: Editor, measured: str) -> None:
    page = editor.page
    undo = page.get_by_role("button", name="Undo", exact=True)
    editor.choose("Floor", 0)
    assert textures(page) == ["diffuse", ""]
    page.get_by_role("button", name="Library").click()
    first_ball(page).wait_for()
    expect(page.locator(".library-help").first).to_contain_text("Textures aren’t kept")

    def drop(ball: Locator) -> None:
        x, y = place_of(editor, "Floor")
        carried = {"dataTransfer": page.evaluate_handle("() => new DataTransfer()")}
        ball.dispatch_event("dragstart", carried)
        editor.canvas.dispatch_event("dragover", {**carried, "clientX": x, "clientY": y})
        editor.canvas.dispatch_event("drop", {**carried, "clientX": x, "clientY": y})

    ways = {"click": lambda ball: ball.click(), "drop": drop}
    for kind in ("cook_torrance", "measured"):
        page.locator(".library-filters").get_by_label("Model").select_option(kind)
        if kind == "measured":
            expect(first_ball(page)).to_contain_text(measured)
        for way, put in ways.items():
            expect(undo).to_be_disabled()
            put(first_ball(page))
            expect(undo).to_be_enabled()
            assert textures(page) == ["", ""], (kind, way)
            page.locator(".inspector .texture select").select_option("diffuse")  # one click brings it back
            assert textures(page) == ["", "diffuse"], (kind, way)
            undo.click()
            undo.click()
            assert textures(page) == ["diffuse", ""], (kind, way)
    page.get_by_role("application", name="Material map").press("ArrowRight")
    expect(undo).to_be_enabled()
    assert textures(page) == ["", ""]
    editor.wait_until_exact()
