"""Judging a picture: white balance, a LUT, scopes, the area probe, and the difference of A and B."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from editor_page import Editor
from playwright.sync_api import expect

INVERTED = "LUT_1D_SIZE 2\n1 1 1\n0 0 0\n"


def test_white_balance_and_a_lut_change_the_picture(editor: Editor, tmp_path: Path) -> None:
    page, before = editor.page, editor.pixels()
    page.get_by_role("button", name="Display options").click()
    page.get_by_role("slider", name="Temperature").press("Home")
    cool = editor.pixels()
    assert (cool[..., 2] - cool[..., 0]).mean() > (before[..., 2] - before[..., 0]).mean() + 20
    page.get_by_role("slider", name="Temperature").press("Delete")
    np.testing.assert_allclose(editor.pixels(), before, atol=1)
    cube = tmp_path / "invert.cube"
    cube.write_text(INVERTED)
    page.get_by_label("LUT file").set_input_files(cube)
    expect(page.get_by_role("combobox", name="LUT")).to_have_value(re.compile("lut:[0-9a-f]{16}"))
    middle = np.s_[before.shape[0] // 3 : -before.shape[0] // 3, before.shape[1] // 3 : -before.shape[1] // 3]
    page.keyboard.press("Escape")
    np.testing.assert_allclose(editor.pixels()[middle], 255 - before[middle], atol=3)


def test_scopes_area_and_difference_have_numbers(editor: Editor) -> None:
    page = editor.page
    page.keyboard.press("h")
    page.get_by_role("radio", name="Histogram").press("ArrowRight")
    expect(page.get_by_role("figure", name="Waveform")).to_contain_text("Median")
    page.get_by_role("radio", name="Waveform").press("ArrowRight")
    expect(page.get_by_role("figure", name="RGB parade")).to_contain_text("Median")
    page.keyboard.press("h")
    page.keyboard.press("r")
    probe = page.get_by_role("region", name="Area probe")
    expect(probe).to_contain_text("px at")
    size = probe.get_by_role("status").inner_text()
    page.get_by_role("group", name="Area probe").press("Shift+ArrowRight")
    expect(probe.get_by_role("status")).not_to_have_text(size)
    page.get_by_role("button", name="Display options").click()
    page.get_by_role("combobox", name="Difference").select_option("stops")
    legend = page.locator(".legend.difference")
    expect(legend).to_contain_text("Mean 0.00, largest 0.00")
    gray = editor.pixels()
    middle = gray[gray.shape[0] // 2, gray.shape[1] // 2]
    np.testing.assert_allclose(middle, 128, atol=1)
    page.get_by_role("slider", name="Brightness").press("PageUp")  # B is brighter: negative, blue
    expect(legend).to_contain_text("Mean −")
    red, _, blue = editor.pixels()[gray.shape[0] // 2, gray.shape[1] // 2]
    assert blue > red + 20
    page.get_by_role("combobox", name="Difference").select_option("delta_e")
    expect(legend).to_contain_text("ΔE ITP")
    page.get_by_role("combobox", name="Difference").select_option("off")


def test_contrast_and_a_screen_without_hdr(editor: Editor) -> None:
    page, before = editor.page, editor.pixels()
    page.get_by_role("button", name="Display options").click()
    page.get_by_role("slider", name="Contrast").press("End")
    assert editor.pixels().std() > 1.2 * before.std()
    page.get_by_role("slider", name="Contrast").press("Delete")
    screen = page.get_by_role("combobox", name="Screen")
    expect(screen).to_have_value("srgb")
    expect(screen.locator("option[value=hdr]")).to_be_disabled()
    expect(page.get_by_role("group", name="Display options")).to_contain_text("HDR needs")
    np.testing.assert_allclose(editor.pixels(), before, atol=1)
