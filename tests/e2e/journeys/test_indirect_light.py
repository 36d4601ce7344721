"""Reflected light in a browser: baked by way of the dialogue, and seen by paths."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from editor_page import WAIT_MS, Editor, changed
from editor_server import Server
from playwright.sync_api import Browser, Page, expect
from tiny_scenes import still_life

from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene


@pytest.fixture
def start_page(tmp_path: Path, browser: Browser) -> Iterator[Page]:
    """The start page of a server with a scene that nobody has baked."""
    ledger = Ledger(open_database(f"sqlite:///{tmp_path / 'relume.db'}"))
    register_scene(tmp_path, ledger, still_life())
    ledger.close()
    server = Server(tmp_path)
    server.start()
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(server.url)
    yield page
    page.close()
    server.kill()


@pytest.mark.slow
def test_indirect_light_is_baked_from_the_dialog_and_shown_by_paths(start_page: Page) -> None:
    page, editor = start_page, Editor(start_page)
    page.get_by_role("button", name="Bake…").click()
    plan = page.locator(".presets .plan").first
    expect(plan).to_contain_text("memory", timeout=WAIT_MS)
    of_all_light = plan.inner_text()
    page.get_by_role("radio", name=re.compile("^Direct light")).check()
    expect(plan).not_to_have_text(of_all_light)
    page.get_by_role("radio", name=re.compile("^Global illumination")).check()
    expect(plan).to_have_text(re.compile("memory"))
    page.get_by_role("checkbox", name="left").uncheck()
    page.get_by_role("button", name="Open and bake").first.click()
    editor.wait_until_exact()
    expect(page.get_by_role("button", name="GI ▾")).to_be_visible()

    steps = page.locator(".tile.step")
    editor.choose("Ball", 1)
    editor.slider("Roughness σ").press("PageUp")
    expect(steps).to_have_count(2)
    everything = editor.pixels()
    paths = page.get_by_role("radiogroup", name="Light paths")
    paths.get_by_role("radio", name="1 bounce").click()
    assert changed(everything, editor.pixels()) > 0.5
    paths.get_by_role("radio", name="1 bounce").press("ArrowLeft")
    assert changed(everything, editor.pixels()) > 0.5
    paths.get_by_role("radio", name="Indirect").press("ArrowLeft")
    expect(paths.get_by_role("radio", name="Direct", exact=True)).to_be_checked()
    direct_alone = editor.pixels()
    assert direct_alone.mean() < everything.mean()
    expect(steps).to_have_count(2)  # a way of looking, no edit
    page.reload()
    assert changed(direct_alone, editor.pixels()) == 0
    expect(paths.get_by_role("radio", name="Direct", exact=True)).to_be_checked()
    expect(steps).to_have_count(2)
    page.keyboard.press("Control+z")
    expect(paths.get_by_role("radio", name="Direct", exact=True)).to_be_checked()
    page.keyboard.press("Control+Shift+z")
    page.get_by_role("button", name="Direct light only").click()
    assert changed(everything, editor.pixels()) == 0

    bounces = page.get_by_role("slider", name="Bounces")
    bounces.press("Home")
    expect(bounces).to_have_attribute("aria-valuenow", "0")
    assert changed(direct_alone, editor.pixels()) < 0.01
    bounces.press("ArrowRight")
    expect(bounces).to_have_attribute("aria-valuenow", "1")
    expect(page.get_by_role("button", name="At most 1 bounce")).to_be_visible()
