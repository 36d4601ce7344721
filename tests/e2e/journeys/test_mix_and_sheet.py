"""A light mix leaves the editor as a file and comes back by a drop; a contact sheet has all saved looks."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from editor_page import WAIT_MS, Editor
from PIL import Image
from playwright.sync_api import expect
from test_first_minute import drop


@pytest.mark.slow
def test_light_mix_and_contact_sheet(editor: Editor, tmp_path: Path) -> None:
    page, brightness = editor.page, editor.page.get_by_role("slider", name="Brightness")
    before = editor.pixels()
    brightness.focus()
    for _ in range(3):
        page.keyboard.press("PageDown")
    dimmed = editor.pixels()
    assert dimmed.mean() < before.mean() - 2

    page.get_by_role("button", name="More export formats").press("Enter")
    page.get_by_role("button", name="Scene…").press("Enter")
    dialog = page.get_by_role("dialog", name="Export scene")
    dialog.get_by_role("radio", name="Light mix").check()
    expect(dialog.get_by_role("status")).to_have_text("The file has all lights, without materials.", timeout=WAIT_MS)
    page.screenshot(path=tmp_path / "dialog.png")
    with page.expect_download(timeout=WAIT_MS) as download:
        dialog.get_by_role("button", name="Download").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    mix = json.loads(path.read_text())
    assert (path.suffix, mix["environment"]["intensity"] < 1) == (".json", True)

    page.keyboard.press("Control+z")
    assert np.abs(editor.pixels() - dimmed).mean() > 0.5
    path.write_text(json.dumps({**mix, "lights": {"Kicker": {"intensity": 2}}}))
    drop(page, path)
    expect(page.get_by_text("lights that the scene does not have: 'Kicker'")).to_be_visible()
    assert np.abs(editor.pixels() - dimmed).max() <= 1

    page.get_by_role("button", name="Save look").click()
    name = page.get_by_role("textbox", name="New name of")
    expect(name).to_be_focused()
    name.press("Enter")
    expect(page.get_by_role("button", name="Rename Look").first).to_be_visible()
    page.get_by_role("button", name="More export formats").press("Enter")
    page.get_by_role("button", name="Render…").press("Enter")
    dialog = page.get_by_role("dialog", name="Render")
    dialog.get_by_role("checkbox", name="Current look").check()
    dialog.get_by_role("checkbox", name="Contact sheet").check()
    expect(dialog.get_by_role("status", name="Result")).to_contain_text("2 images: ", timeout=WAIT_MS)
    page.screenshot(path=tmp_path / "render.png")
    with page.expect_download(timeout=WAIT_MS) as download:
        dialog.get_by_role("button", name="Render", exact=True).click()
    download.value.save_as(tmp_path / "all.zip")
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        names = archive.namelist()
        archive.extract(names[2], tmp_path)
    assert names[:2] == ["still-life_front_Current.png", "still-life_front_Look-1.png"]
    with Image.open(tmp_path / names[2]) as sheet:
        sheet.load()
        assert min(sheet.size) > 100
