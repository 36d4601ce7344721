"""Files and folders dropped as a file manager does: textures onto an object, many scenes on the start page."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from editor_page import Editor, opened_page
from editor_server import Server
from PIL import Image
from playwright.sync_api import Browser, Page, expect

NUM_SCENES = 12


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as libraries of textures give it."""
    folder = tmp_path_factory.mktemp("textures") / "Tiles012"
    folder.mkdir()
    for name, color in {"Color": (200, 80, 40), "Normal": (128, 128, 255), "AmbientOcclusion": (255,) * 3}.items():
        Image.new("RGB", (8, 8), color).save(folder / f"Tiles012_1K_{name}.png")
    (folder / "info.json").write_text(json.dumps({"license": "CC0"}))
    return folder


@pytest.fixture
def start(server: Server, browser: Browser) -> Iterator[Page]:
    """The start page in a fresh profile."""
    with opened_page(browser) as page:
        page.goto(server.url)
        expect(page.get_by_text("choose files")).to_be_visible()
        yield page


def hold(page: Page, kinds: tuple[str, ...], x: float, y: float, *paths: Path) -> None:
    session = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in kinds:
        session.send("Input.dispatchDragEvent", {"type": kind, "x": x, "y": y, "data": data})


def test_a_folder_of_textures_goes_onto_the_object_below(editor: Editor, tiles: Path) -> None:
    """A hint says so while it is held; what is dropped is one step, and what is not used is said. Twice."""
    page, box = editor.page, editor.canvas.bounding_box()
    assert box is not None
    place = (box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    steps = page.locator(".tile.step:not(.undone)")
    for _ in range(2):
        count = steps.count()
        hold(page, ("dragEnter", "dragOver"), *place, tiles)
        expect(page.locator(".drop-hint")).to_contain_text("apply to “Ball”")
        hold(page, ("drop",), *place, tiles)
        expect(page.locator(".drop-hint")).to_have_count(0)
        message = page.locator(".toast", has_text="Applied to “Ball”: base color and normals.")
        expect(message).to_contain_text("Tiles012_1K_AmbientOcclusion.png (ambient occlusion")
        expect(message).not_to_contain_text("info.json")
        expect(steps).to_have_count(count + 1)
        expect(page.get_by_label("Normal map", exact=True).locator("option:checked")).to_have_text("Tiles012_1K_Normal")
        page.get_by_role("button", name="Undo", exact=True).click()
        message.get_by_role("button", name="Dismiss").click()


def test_balls_of_materials_are_pictures_and_follow_an_edit(editor: Editor) -> None:
    ball = editor.page.get_by_role("option", name="Ball").locator(".swatch")
    picture = "e => /blob:[^\"]*/.exec(getComputedStyle(e).backgroundImage)?.[0] ?? ''"
    editor.page.wait_for_function(f"e => ({picture})(e) !== ''", arg=ball.element_handle())
    before = ball.evaluate(picture)
    editor.choose("Ball", 0)
    editor.page.locator(".inspector input.number").first.fill("0.9")
    editor.page.keyboard.press("Enter")
    changed = f"([e, before]) => !['', before].includes(({picture})(e))"
    editor.page.wait_for_function(changed, arg=[ball.element_handle(), before])
    editor.page.keyboard.press("Control+z")
    back = f"([e, before]) => ({picture})(e) === before"
    editor.page.wait_for_function(back, arg=[ball.element_handle(), before])


def test_a_number_beyond_its_range_says_what_it_became(editor: Editor) -> None:
    editor.choose("Ball", 1)
    slider = editor.slider("Roughness σ")
    for typed, words in (("50", "50.00 is out of range"), ("0", ": 0 is out of range")):
        slider.press("Enter")
        field = editor.page.get_by_role("textbox", name="Roughness σ value")
        field.fill(typed)
        field.press("Enter")
        expect(editor.page.locator(".toast.note", has_text=words)).to_contain_text("Roughness σ")
        expect(slider).to_be_focused()


def test_many_dropped_scenes_are_counted_and_errors_go_when_fixed(start: Page, tmp_path: Path) -> None:
    """The list shows some of many and scrolls; the upload is numbered."""
    scenes = [tmp_path / f"scene{k}.glb" for k in range(1, NUM_SCENES + 1)]
    for scene in scenes:
        scene.write_bytes(b"nothing")
    hold(start, ("dragEnter", "dragOver", "drop"), 400, 300, *scenes)
    rows = start.get_by_role("list", name="Chosen scenes")
    expect(rows.locator("li")).to_have_count(NUM_SCENES)
    expect(rows.locator("li").nth(1)).to_contain_text("scene2.glb")  # by number
    assert rows.evaluate("e => e.scrollHeight > e.clientHeight && (e.clientHeight + 4) % 28 !== 0")  # cuts a row
    held: list[str] = []

    def note(route: object) -> None:
        held.append(start.locator(".chosen").inner_text())
        route.continue_()  # type: ignore[attr-defined]

    start.route("**/api/scenes", note)
    start.get_by_role("button", name=f"Import {NUM_SCENES} scenes").click()
    error = start.locator(".toast.error")
    expect(error).to_contain_text(f"0 scenes imported, {NUM_SCENES} failed")
    counted = [text for text in held if "of 12" in text]
    assert len(counted) == NUM_SCENES
    assert "“scene3” (3 of 12)" in counted[2]
    start.get_by_role("button", name="Clear").click()
    expect(error).to_have_count(0)


def test_a_tall_thumbnail_stays_in_its_card(start: Page) -> None:
    """The picture of a card is made square, and then tall: neither covers what stands below."""
    card = start.locator(".scene-card").first
    picture = card.locator(".scene-open img")
    expect(picture).to_be_visible()
    height = card.bounding_box()
    for size in ((300, 300), (200, 600)):
        source = f"data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='{size[0]}' height='{size[1]}'/>"
        picture.evaluate("(e, source) => (e.src = source, e.decode())", source)
        below, text = picture.bounding_box(), card.locator(".scene-text").bounding_box()
        assert below is not None
        assert text is not None
        assert below["y"] + below["height"] <= text["y"] + 1
        assert card.bounding_box() == height
