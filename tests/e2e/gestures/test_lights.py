"""Lights in a browser: placed by a click and by keys, pulled and aimed in the picture, switched, alone, undone."""

from __future__ import annotations

import re

import numpy as np
import pytest
from editor_page import NAMELESS, Editor, changed
from playwright.sync_api import Locator, expect

ON_THE_FLOOR = (0.5, 0.85)


def start_adding(editor: Editor, kind: str) -> None:
    editor.page.get_by_role("button", name="Add light").click()
    editor.page.get_by_role("group", name="Light type").get_by_role("button", name=kind).click()


def add_by_click(editor: Editor, kind: str) -> None:
    start_adding(editor, kind)
    box = editor.canvas.bounding_box()
    assert box is not None
    u, v = ON_THE_FLOOR
    editor.page.mouse.click(box["x"] + u * box["width"], box["y"] + v * box["height"])
    expect(editor.page.locator(".light .name", has_text=kind)).to_have_attribute("aria-pressed", "true")


def handle(editor: Editor, kind: str) -> Locator:
    return editor.page.locator(f".light-handle.{kind}")


def numbers(editor: Editor, label: str) -> list[float]:
    fields = editor.page.get_by_role("group", name=label, exact=True).get_by_role("textbox")
    return [float(fields.nth(k).input_value()) for k in range(fields.count())]


def pull(editor: Editor, knob: Locator, dx: float, dy: float) -> None:
    box = knob.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    editor.page.mouse.move(x, y)
    editor.page.mouse.down()
    editor.page.mouse.move(x + dx, y + dy, steps=6)
    editor.page.mouse.up()


def test_a_light_is_placed_by_a_click_and_shines_and_undo_takes_it_away(editor: Editor) -> None:
    before = editor.pixels()
    add_by_click(editor, "Point")
    lit = editor.pixels()
    assert changed(before, lit) > 0.1
    assert lit.mean() > before.mean()
    editor.page.keyboard.press("Control+z")
    expect(editor.page.locator(".light")).to_have_count(0)
    assert changed(before, editor.pixels()) == 0


def test_a_light_is_placed_by_keys_alone_and_by_none_where_escape_is_pressed(editor: Editor) -> None:
    page = editor.page
    start_adding(editor, "Sun")
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Place in center")).to_have_count(0)
    expect(page.locator(".light")).to_have_count(0)
    page.get_by_role("button", name="Add light").press("Enter")
    page.get_by_role("group", name="Light type").get_by_role("button", name="Spot").press("Enter")
    middle = page.get_by_role("button", name="Place in center")
    expect(middle).to_be_focused()
    middle.press("Enter")
    expect(page.get_by_role("combobox", name="Light type")).to_have_value("spot")
    expect(middle).to_have_count(0)
    expect(page.locator(".light .name", has_text="Spot")).to_be_focused()


WITHIN_SCROLLER = """row => {
  let list = row.parentElement;
  while (list.scrollHeight <= list.clientHeight) list = list.parentElement;
  const [inner, outer] = [row, list].map((element) => element.getBoundingClientRect());
  return list !== document.documentElement && inner.top >= outer.top && inner.bottom <= outer.bottom;
}"""


def test_a_new_light_is_the_only_selected_row_and_is_scrolled_to(editor: Editor) -> None:
    page = editor.page
    page.set_viewport_size({"width": 900, "height": 600})
    selected = page.locator("[role=option][aria-selected=true], .light.selected")
    page.get_by_role("option", name="Ball").click()
    expect(selected).to_have_count(1)
    for number in range(1, 7):
        start_adding(editor, "Point")
        editor.canvas.click()  # a row that is placed by keys is focused, which scrolls to it
        expect(page.locator(".light")).to_have_count(number)
        expect(selected).to_have_count(1)
        expect(page.locator(".light.selected")).to_have_count(1)
    assert page.locator(".light.selected").evaluate(WITHIN_SCROLLER)
    page.get_by_role("option", name="Ball").click()
    expect(selected).to_have_count(1)
    expect(page.locator(".light.selected")).to_have_count(0)


def test_a_handle_is_pulled_in_one_step_across_the_picture_and_away(editor: Editor) -> None:
    add_by_click(editor, "Spot")
    before, start = editor.pixels(), numbers(editor, "Position")
    steps = editor.page.locator(".tile.step")
    count = steps.count()
    pull(editor, handle(editor, "move"), 60, -20)
    moved = numbers(editor, "Position")
    assert moved != start
    expect(steps).to_have_count(count + 1)
    assert changed(before, editor.pixels()) > 0.02

    place = handle(editor, "move").bounding_box()
    editor.page.keyboard.down("Shift")
    pull(editor, handle(editor, "move"), 0, -20)
    editor.page.keyboard.up("Shift")
    assert numbers(editor, "Position") != moved
    after = handle(editor, "move").bounding_box()
    assert place is not None
    assert after is not None
    assert abs(after["x"] - place["x"]) < 1
    assert abs(after["y"] - place["y"]) < 1

    editor.page.keyboard.press("Control+z")
    assert numbers(editor, "Position") == moved
    editor.page.keyboard.press("Control+z")
    assert numbers(editor, "Position") == start
    assert changed(before, editor.pixels()) < 0.005  # the handle has the focus now


def test_keys_and_numbers_place_and_aim_a_light_and_escape_leaves_it(editor: Editor) -> None:
    add_by_click(editor, "Panel")
    assert editor.page.evaluate(NAMELESS) == []
    position, direction = numbers(editor, "Position"), numbers(editor, "Direction")
    before = handle(editor, "move").bounding_box()
    handle(editor, "move").press("ArrowRight")
    after = handle(editor, "move").bounding_box()
    assert before is not None
    assert after is not None
    assert 5 < after["x"] - before["x"] < 7
    assert numbers(editor, "Position") != position
    assert numbers(editor, "Direction") == direction
    handle(editor, "aim").press("ArrowUp")
    assert numbers(editor, "Direction") != direction
    expect(handle(editor, "aim")).to_have_attribute("aria-label", re.compile("Panel, aims at"))

    x, start = editor.page.get_by_role("textbox", name="Position, x"), numbers(editor, "Position")
    x.fill("7")
    x.press("Escape")
    expect(x).not_to_be_focused()
    assert numbers(editor, "Position") == start
    x.fill("0.25")
    x.press("Enter")
    assert numbers(editor, "Position") == [0.25, *start[1:]]
    x.press("ArrowUp")
    np.testing.assert_allclose(numbers(editor, "Position")[0], 0.26, atol=1e-6)
    handle(editor, "aim").press("Delete")
    expect(editor.page.locator(".light")).to_have_count(0)


@pytest.mark.slow
def test_a_light_is_switched_off_and_soloed(editor: Editor) -> None:
    page = editor.page
    dark = editor.pixels()
    add_by_click(editor, "Point")
    lit = editor.pixels()
    page.get_by_role("button", name="Turn off Point").click()
    assert changed(dark, editor.pixels()) < 0.01
    page.get_by_role("button", name="Turn on Point").click()
    assert changed(lit, editor.pixels()) < 0.01

    steps = page.locator(".tile.step").count()
    page.get_by_role("button", name="Solo Point").click()
    page.get_by_role("button", name="Solo: Point").wait_for()
    alone = editor.pixels()
    assert changed(lit, alone) > 0.2
    with page.expect_request("**/api/renders") as asked:
        page.get_by_role("button", name="EXR", exact=True).click()
    (exported,) = asked.value.post_data_json["looks"]
    assert exported["environment"]["intensity"] == 0
    expect(page.get_by_text("Rendering EXR (solo: Point)…")).to_be_visible()
    page.get_by_role("button", name="Solo environment").click()
    assert changed(dark, editor.pixels()) < 0.01
    page.get_by_role("button", name="Solo: environment").click()
    assert changed(lit, editor.pixels()) < 0.01
    assert page.locator(".tile.step").count() == steps


def test_a_light_has_a_temperature_a_power_a_name_a_copy_and_an_aim_that_stays(editor: Editor) -> None:
    page = editor.page
    add_by_click(editor, "Spot")
    white = editor.pixels()
    temperature = editor.slider("Color temperature")
    temperature.press("Home")
    warm = editor.pixels()
    lit = np.abs(white - warm).max(axis=2) > 2
    assert lit.mean() > 0.01
    red, _, blue = (warm - white)[lit].mean(axis=0)
    assert red > blue + 10

    lumens, watts = (page.get_by_role("textbox", name=f"Power, {unit}", exact=True) for unit in ("lm", "W"))
    before = float(lumens.input_value())
    lumens.fill(str(before / 2))
    lumens.press("Enter")
    np.testing.assert_allclose(float(watts.input_value()) * 683, before / 2, rtol=5e-3)  # shown with three digits
    assert editor.pixels()[lit].mean() < warm[lit].mean()

    page.get_by_role("button", name="Rename Spot").click()
    name = page.get_by_role("textbox", name="New name of Spot")
    name.fill("Key")
    name.press("Enter")
    expect(page.locator(".light .name")).to_have_text("Key")
    page.get_by_role("button", name="Duplicate light").click()
    expect(page.locator(".light .name")).to_have_text(["Key", "Key 2"])

    page.get_by_role("checkbox", name="Lock target").check()
    target = np.add(numbers(editor, "Position"), numbers(editor, "Direction"))
    pull(editor, page.get_by_role("button", name=re.compile("^Key 2, at")), 40, -10)
    np.testing.assert_allclose(np.add(numbers(editor, "Position"), numbers(editor, "Direction")), target, atol=2e-3)
    for _ in range(3):  # the move, the copy, the name
        page.keyboard.press("Control+z")
    expect(page.locator(".light .name")).to_have_text("Spot")
