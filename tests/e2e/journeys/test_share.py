"""A link in a browser: who opens it sees what was sent, and loses nothing of their own."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from editor_page import WAIT_MS, Editor, changed
from editor_server import SIZE, Server
from playwright.sync_api import Browser, expect

REFUSE_COPY = "() => { navigator.clipboard.writeText = () => Promise.reject(new Error('not allowed')); }"


@pytest.fixture
def visitor(browser: Browser) -> Iterator[Editor]:
    """Another profile."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    yield Editor(context.new_page())
    context.close()


@pytest.mark.slow
def test_a_link_opens_what_was_shared_and_stays_what_it_was(editor: Editor, visitor: Editor, server: Server) -> None:
    page = editor.page
    page.get_by_role("button", name="left", exact=True).click()
    editor.choose("Ball", 1)
    editor.drag(editor.slider("Roughness σ"), 0.3, 0.8)
    shared = editor.pixels()
    page.evaluate(REFUSE_COPY)
    page.get_by_role("button", name="Share: copy a link to this look").click()
    field = page.get_by_role("dialog", name="Link to this look").get_by_role("textbox")
    expect(field).to_be_focused()
    link = field.input_value()
    assert link.startswith(f"{server.url}/?share=")
    page.keyboard.press("Escape")
    expect(field).to_have_count(0)

    # the sender goes on; and copies another link, which the browser allows now
    editor.drag(editor.slider("Roughness σ"), 0.8, 0.1)
    assert changed(shared, editor.pixels()) > 0.01
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.evaluate("() => { delete navigator.clipboard.writeText; }")
    page.get_by_role("button", name="Share: copy a link to this look").click()
    expect(page.locator(".toast.note").last).to_contain_text("Link copied")
    assert page.evaluate("navigator.clipboard.readText()") != link

    # a visitor who has a look of their own
    visitor.page.goto(f"{server.url}/?scene={server.call('/api/scenes')[0]['id']}&view=left")
    visitor.choose("Floor", 0)
    visitor.page.locator(".inspector input.number").first.fill("0.2")
    visitor.page.keyboard.press("Enter")
    own = visitor.pixels()
    assert changed(own, shared) > 0.01
    visitor.page.goto(link)
    assert changed(visitor.pixels(), shared) == 0
    assert "share=" not in visitor.page.url
    expect(visitor.page.locator(".tile.step").last).to_contain_text("Shared look")
    visitor.page.get_by_role("button", name="Undo").click()
    assert changed(visitor.pixels(), own) == 0


def test_a_link_in_a_fresh_profile_and_one_that_opens_nothing(editor: Editor, visitor: Editor, server: Server) -> None:
    editor.page.get_by_role("button", name="Views side by side").click()
    editor.choose("Ball", 1)
    editor.drag(editor.slider("Roughness σ"), 0.3, 0.7)
    editor.wait_until_exact()
    shared = server.call("/api/shares", {
        "bake": editor.page.evaluate("new URLSearchParams(location.search).get('bake')"),
        "view": "front", "views": ["front", "left"],
        "look": {"materials": {"Ball": {"terms": [{"model": "lambert", "color": [0.1, 0.6, 0.2]}]}}},
    })  # fmt: skip
    visitor.page.goto(f"{server.url}{shared['url']}")
    visitor.wait_until_exact()
    expect(visitor.page.locator(".picture canvas")).to_have_count(2)
    visitor.page.get_by_role("option", name="Ball").click()
    expect(visitor.page.locator(".card")).to_have_count(1)
    visitor.page.get_by_role("button", name="Undo").click()
    expect(visitor.page.locator(".card")).to_have_count(2)

    visitor.page.goto(f"{server.url}/?share=aaaaaaaaaa")
    expect(visitor.page.locator(".toast.error")).to_contain_text("ask the sender to share it again")
    expect(visitor.page.locator(".scene-card")).to_have_count(1)


def wait_until_cancelled(server: Server, bake: str) -> None:
    deadline = time.monotonic() + WAIT_MS / 1e3
    while (state := server.call(f"/api/bakes/{bake}")["state"]) != "canceled":
        assert state == "running", f"the bake is {state}"
        assert time.monotonic() < deadline, "nothing was canceled"
        time.sleep(0.1)


@pytest.mark.slow
def test_a_bake_says_what_it_is_at_and_ends_where_it_is_cancelled(editor: Editor, server: Server) -> None:
    (scene,) = server.call("/api/scenes")
    recipe = {"scene": scene["id"], "method": "direct", "views": ["front", "left"], "size": SIZE, "lights": 2000}
    bake = server.call("/api/bakes", recipe)
    expect(editor.page.locator(".status .bake")).to_contain_text("baking, ")
    editor.page.get_by_role("button", name="Cancel").click()
    wait_until_cancelled(server, bake["id"])
