"""Environments in a browser: choosing by click and key, undo, importing by button and by a dropped file."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest
from editor_page import Editor, changed
from environment_files import dusk, write_map
from playwright.sync_api import expect

DROP = """([name, data]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name));
  const target = document.querySelector(".picture canvas");
  for (const type of ["dragover", "drop"])
    target.dispatchEvent(new DragEvent(type, { dataTransfer: transfer, bubbles: true, cancelable: true }));
}"""


@pytest.fixture(scope="module")
def dusk_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = write_map(tmp_path_factory.mktemp("maps") / "dusk.exr", dusk())
    return path


@pytest.mark.slow
def test_another_environment_is_chosen_by_click_and_by_key_and_undone(editor: Editor) -> None:
    page = editor.page
    group = page.get_by_role("radiogroup", name="Environment")
    expect(group.get_by_role("radio", name="Original")).to_be_checked()
    before = editor.pixels()
    group.get_by_role("radio", name="Clear sky").click()
    clear = editor.pixels()
    assert changed(before, clear) > 0.5
    expect(page.get_by_text("bounce light shows it more coarsely")).to_be_visible()
    group.get_by_role("radio", name="Clear sky").press("ArrowRight")
    expect(group.get_by_role("radio", name="Sunset")).to_be_checked()
    expect(group.get_by_role("radio", name="Sunset")).to_be_focused()
    assert changed(clear, editor.pixels()) > 0.3
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    expect(group.get_by_role("radio", name="Original")).to_be_checked()
    expect(page.get_by_text("bounce light shows it more coarsely")).to_have_count(0)
    assert changed(before, editor.pixels()) < 0.01


@pytest.mark.slow
def test_a_chosen_file_lights_the_scene(editor: Editor, dusk_file: Path) -> None:
    before = editor.pixels()
    editor.page.get_by_label("Environment file").set_input_files(dusk_file)
    expect(editor.page.get_by_role("radio", name="dusk")).to_be_checked()
    heads = editor.page.locator(".outline .panel-head h2")  # there is one more button beside the heading now
    assert heads.evaluate_all("all => all.filter((head) => head.scrollWidth > head.clientWidth).length") == 0
    lit = editor.pixels()
    assert changed(before, lit) > 0.5
    assert lit[..., 0].mean() > 1.3 * lit[..., 2].mean()


def test_a_dropped_file_lights_the_scene_and_others_are_refused_in_words(editor: Editor, dusk_file: Path) -> None:
    page = editor.page
    before = editor.pixels()
    page.evaluate(DROP, ["teapot.glb", ""])
    expect(page.get_by_text("Import scenes on the start page")).to_be_visible()
    page.evaluate(DROP, ["broken.hdr", base64.b64encode(b"broken").decode()])
    expect(page.get_by_text("neither Radiance .hdr nor OpenEXR")).to_be_visible()
    expect(page.get_by_role("radio", name="Original")).to_be_checked()
    page.evaluate(DROP, ["dusk.exr", base64.b64encode(dusk_file.read_bytes()).decode()])
    expect(page.get_by_role("radio", name="dusk")).to_be_checked()
    assert changed(before, editor.pixels()) > 0.5


def test_an_imported_environment_is_deleted_after_a_question(editor: Editor, dusk_file: Path) -> None:
    page = editor.page
    before = editor.pixels()
    page.get_by_label("Environment file").set_input_files(dusk_file)
    chosen = page.get_by_role("radio", name="dusk")
    expect(chosen).to_be_checked()
    page.get_by_role("button", name="Delete HDRI dusk").click()
    expect(chosen).to_be_checked()
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(chosen).to_have_count(0)
    assert changed(before, editor.pixels()) < 0.01
