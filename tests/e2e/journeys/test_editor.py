"""The editor in a browser: seeing, picking, dragging, keys, curves, undo, looks, reload, a lost server, export."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from editor_page import WAIT_MS, Editor, changed
from editor_server import SIZE, Server
from PIL import Image
from playwright.sync_api import Browser, expect

SIGMA = "Roughness σ"


def test_opens_and_a_click_on_an_object_selects_its_material(editor: Editor) -> None:
    pixels = editor.pixels()
    assert pixels.mean() > 20
    assert pixels.std(axis=(0, 1)).min() > 10
    expect(editor.page.get_by_role("heading", level=1)).to_have_text("still life")
    box = editor.canvas.bounding_box()
    assert box is not None
    selected = editor.page.locator("[role=option][aria-selected=true]")
    expect(selected).to_have_count(0)
    editor.canvas.hover()
    editor.page.wait_for_function("() => document.querySelector('.probe .material')")
    fits = "(all) => all.every((each) => each.scrollWidth <= each.clientWidth)"
    assert editor.page.locator(".probe, .probe .material").evaluate_all(fits)
    editor.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    expect(selected).to_have_text("Ball")
    editor.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.85 * box["height"])
    expect(selected).to_have_text("Floor")


def test_a_click_on_a_scene_card_opens_it(server: Server, browser: Browser) -> None:
    page = browser.new_page()
    page.goto(server.url)
    title = page.locator(".scene-card").get_by_text("still life")
    title.wait_for(timeout=WAIT_MS)
    title.click(force=True)  # the card's button lies over it
    Editor(page).wait_until_exact()
    assert "scene=" in page.url
    page.close()


def test_dragging_a_slider_changes_the_picture_and_is_one_step_where_it_rests_on_the_way(editor: Editor) -> None:
    editor.choose("Ball", 1)
    before = editor.pixels()
    drawn = editor.page.evaluate("window.relumeStats.latencies.length")
    editor.drag(editor.slider(SIGMA), 0.3, 0.8)
    after = editor.pixels()
    assert changed(before, after) > 0.01
    assert editor.page.evaluate("window.relumeStats.latencies.length") > drawn

    steps = editor.page.locator(".tile.step")
    count = steps.count()
    box = editor.slider(SIGMA).bounding_box()
    assert box is not None
    mouse, y = editor.page.mouse, box["y"] + box["height"] / 2
    mouse.move(box["x"] + 0.3 * box["width"], y)
    mouse.down()
    for at in (0.5, 0.7):
        editor.page.wait_for_timeout(1000)
        mouse.move(box["x"] + at * box["width"], y)
    mouse.up()
    expect(steps).to_have_count(count + 1)


def test_panels_do_not_scroll_sideways_and_keys_are_the_pages_again_after_a_number_and_a_list(editor: Editor) -> None:
    editor.choose("Ball", 1)
    for panel in (".inspector", ".outline"):
        style = editor.page.locator(panel).evaluate("element => getComputedStyle(element).overflowX")
        assert style == "hidden", panel
        beyond = editor.page.locator(panel).evaluate("element => element.scrollWidth - element.clientWidth")
        assert beyond == 0, f"{panel} could be scrolled sideways by a script"
    editor.choose("Ball", 0)
    focused = "document.activeElement.tagName"
    number = editor.page.locator(".inspector input.number").first
    number.fill("0.3")
    number.press("Enter")
    assert editor.page.evaluate(focused) == "BODY"
    tone_map = editor.page.get_by_role("combobox", name="Tone mapping")
    tone_map.click()
    tone_map.select_option(index=1)
    assert editor.page.evaluate(focused) == "BODY"
    tone_map.focus()
    editor.page.keyboard.press("ArrowUp")
    assert editor.page.evaluate(focused) == "SELECT"


def test_keys_do_what_dragging_does(editor: Editor) -> None:
    editor.choose("Ball", 1)
    slider = editor.slider(SIGMA)
    first = editor.pixels()
    editor.drag(slider, 0.5, 1.2)
    dragged, value = editor.pixels(), slider.get_attribute("aria-valuenow")
    slider.press("Home")
    assert changed(dragged, editor.pixels()) > 0.01
    slider.press("End")
    assert changed(dragged, editor.pixels()) == 0
    assert slider.get_attribute("aria-valuenow") == value
    slider.press("Delete")
    assert changed(first, editor.pixels()) == 0


def test_a_curve_point_moves_by_hand_and_by_keys_and_can_be_undone(editor: Editor) -> None:
    editor.choose("Ball", 1)
    plot = editor.page.locator(".plot")
    points = plot.locator("[role=slider]")
    points.first.wait_for(timeout=WAIT_MS)
    point = points.nth(points.count() // 2)  # about where the highlight falls off
    point.scroll_into_view_if_needed()  # and stands still
    before = editor.pixels()
    box = point.locator(".mark").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    editor.page.mouse.move(x, y)
    editor.page.mouse.down()
    editor.page.mouse.move(x, y - 60, steps=8)
    editor.page.mouse.up()
    dragged = editor.pixels()
    assert changed(before, dragged) > 0.005
    expect(editor.page.locator(".inspector .dot")).to_have_count(1)

    before_keys = float(point.get_attribute("aria-valuenow") or "nan")
    point.press("PageUp")
    raised = editor.pixels()
    assert float(point.get_attribute("aria-valuenow") or "nan") > before_keys
    assert changed(dragged, raised) > 0

    undo, redo = (editor.page.get_by_role("button", name=name, exact=True) for name in ("Undo", "Redo"))
    undo.click()
    assert changed(dragged, editor.pixels()) == 0
    undo.click()
    assert changed(before, editor.pixels()) == 0
    expect(undo).to_be_disabled()
    redo.click()
    redo.click()
    assert changed(raised, editor.pixels()) == 0


def test_a_saved_look_survives_a_reload(editor: Editor) -> None:
    editor.choose("Ball", 1)
    plain = editor.pixels()
    editor.slider(SIGMA).press("End")
    edited = editor.pixels()
    editor.page.keyboard.press("Control+s")
    saved = editor.page.locator(".tiles.saved .tile-picture")
    expect(saved).to_have_count(1)
    editor.page.get_by_role("button", name="Reset material", exact=True).click()
    assert changed(plain, editor.pixels()) == 0
    editor.page.reload()
    editor.wait_until_exact()
    expect(saved).to_have_count(1)
    saved.click()
    assert changed(edited, editor.pixels()) == 0
    editor.page.locator(".tiles.saved .tile").hover()
    editor.page.get_by_role("button", name="Delete").first.click()
    expect(saved).to_have_count(0)


def test_a_reload_returns_to_the_same_place_and_undo_goes_on_before_it(editor: Editor) -> None:
    editor.choose("Ball", 1)
    first = editor.slider(SIGMA).get_attribute("aria-valuenow")
    pictures = editor.page.locator(".tile.step img")  # taken when the hand has rested a while
    expect(pictures).to_have_count(1)
    editor.slider(SIGMA).press("End")
    editor.page.keyboard.press("+")
    expect(pictures).to_have_count(2)
    section = editor.page.get_by_role("button", name="Environment", exact=True)
    section.click()
    url, pixels = editor.page.url, editor.pixels()
    value = editor.slider(SIGMA).get_attribute("aria-valuenow")
    editor.page.reload()
    assert changed(pixels, editor.pixels()) == 0
    assert editor.page.url == url
    expect(editor.page.locator("[role=option][aria-selected=true]")).to_have_text("Ball")
    assert editor.slider(SIGMA).get_attribute("aria-valuenow") == value
    expect(section).to_have_attribute("aria-expanded", "false")
    expect(pictures).to_have_count(2)
    editor.page.keyboard.press("Control+z")
    assert editor.slider(SIGMA).get_attribute("aria-valuenow") == first
    editor.page.keyboard.press("Control+Shift+z")
    assert editor.slider(SIGMA).get_attribute("aria-valuenow") == value


@pytest.mark.slow
def test_a_lost_server_is_said_and_edits_catch_up(editor: Editor, server: Server) -> None:
    editor.choose("Ball", 1)
    before = editor.pixels()
    pictures = editor.page.locator(".tile.step img")
    expect(pictures).to_have_count(1)
    server.kill()
    status = editor.page.locator(".status .state")
    expect(status).to_contain_text("Connection lost", timeout=WAIT_MS)
    editor.slider(SIGMA).press("End")  # kept until there is somebody to tell
    assert editor.page.locator(".exactness").inner_text() == ""
    editor.page.wait_for_timeout(1500)  # longer than a hand has to rest for a picture
    expect(pictures).to_have_count(1)  # what is shown is still the step before
    server.start()
    expect(status).to_contain_text("Connected", timeout=2 * WAIT_MS)  # by itself, after its backoff
    assert changed(before, editor.pixels()) > 0.01
    expect(pictures).to_have_count(2)
    assert pictures.first.get_attribute("src") != pictures.last.get_attribute("src")


def test_views_of_a_colour_config_are_shown_and_downloaded(editor: Editor, tmp_path: Path) -> None:
    page, tone_map = editor.page, editor.page.get_by_role("combobox", name="Tone mapping")
    page.get_by_role("button", name="1:1").click()
    tone_map.select_option("None")
    plain, shown = editor.pixels(), {}
    for view in ("Un-tone-mapped", "ACES 2.0 - SDR 100 nits (Rec.709)"):
        with page.expect_response("**/lut?*"):
            tone_map.select_option(json.dumps(["sRGB - Display", view], separators=(",", ":")))
        shown[view] = editor.pixels()
    first, second = shown.values()
    assert np.abs(first - plain).max() <= 1  # both are sRGB alone
    assert changed(second, plain) > 0.05
    with editor.page.expect_download() as download:
        editor.page.get_by_role("button", name="PNG").click()
    path = tmp_path / "picture.png"
    download.value.save_as(path)
    assert download.value.suggested_filename == "still-life-front.png"
    with Image.open(path) as image:
        assert image.size == SIZE
        picture = np.asarray(image.convert("RGB")).astype(np.int16)
    (width, height), (rows, columns) = SIZE, second.shape[:2]
    places = [((rows - height) // 2 + y, (columns - width) // 2 + x) for y in (0, 1) for x in (0, 1)]  # it is rounded
    assert min(np.abs(second[y : y + height, x : x + width] - picture).max() for y, x in places) <= 2
