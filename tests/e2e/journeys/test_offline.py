"""A browser that loses its network: said soon, and nothing that was edited is lost."""

from __future__ import annotations

import numpy as np
import pytest
from editor_page import Editor, changed
from playwright.sync_api import expect


def test_offline_is_said_and_edits_are_kept(editor: Editor, request: pytest.FixtureRequest) -> None:
    """Twice: the network goes, an edit is made, the network is back, and the server has the edit."""
    page, state = editor.page, editor.page.locator(".status .state")
    request.addfinalizer(lambda: page.context.set_offline(False))  # else those who share the page have no network
    editor.choose("Ball", 1)
    roughness = editor.slider("Roughness σ")
    for key in ("Home", "End"):
        before = editor.pixels()
        page.context.set_offline(True)
        expect(state).to_contain_text("Offline. Your edits are safe")
        roughness.press(key)
        value = roughness.get_attribute("aria-valuenow")
        np.testing.assert_array_equal(editor.read_pixels(), before)  # the last picture stays
        page.context.set_offline(False)
        expect(state).to_have_text("Connected")
        assert changed(before, editor.pixels()) > 0.01
        expect(roughness).to_have_attribute("aria-valuenow", str(value))
