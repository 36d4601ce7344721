"""The comparison with a reference in a browser: its time, its result, stopping and resuming it."""

from __future__ import annotations

import re

import pytest
from editor_page import Editor
from playwright.sync_api import expect


@pytest.mark.slow
def test_a_comparison_shows_its_time_and_can_be_stopped_and_resumed(editor: Editor) -> None:
    page = editor.page
    page.get_by_role("button", name="Compare with reference").click()
    panel = page.get_by_role("complementary", name="Compare with reference")
    expect(panel).to_contain_text(re.compile(r"16 passes, about \d"))
    expect(panel.get_by_role("progressbar")).to_have_count(0)  # nothing has begun
    panel.get_by_role("button", name="Start", exact=True).click()
    expect(panel).to_contain_text(re.compile(r"pass \d+ of 16 \(\d.* left"))
    expect(panel.get_by_role("img", name="Error map")).to_be_visible()
    panel.get_by_role("button", name="Stop").press("Enter")
    expect(panel).to_contain_text(re.compile(r"Stopped after \d+ of 16 passes"))
    expect(panel.get_by_role("img", name="Error map")).to_be_visible()
    shown = panel.get_by_role("list", name="Notes")
    expect(shown).to_contain_text("Reference noise:")
    expect(shown).to_contain_text("Not simulated here: indirect light")
    assert ("No visible difference found" in shown.inner_text()) != ("of the pixels differ" in shown.inner_text())
    verdicts = panel.get_by_role("list", name="Error", exact=True)
    both = r"Error, all light paths: .*Error, simulated light paths: "
    expect(verdicts).to_contain_text(re.compile(both, re.DOTALL))
    picture, paths = panel.get_by_role("img", name="Error map"), panel.get_by_role("radiogroup", name="Light paths")
    paths.get_by_role("radio", name="All light paths").press("ArrowRight")
    expect(picture).to_have_attribute("src", re.compile("/method-error.png"))
    panel.get_by_role("button", name="Resume").press("Enter")
    expect(panel).to_contain_text(re.compile(r"pass \d+ of 16 \(\d.* left"))
    with page.expect_request(lambda request: request.method == "DELETE" and "delete_files=true" in request.url):
        panel.get_by_role("button", name="Close").click()
    expect(panel).to_have_count(0)
