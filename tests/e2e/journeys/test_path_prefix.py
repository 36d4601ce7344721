"""The editor below a path prefix of nginx: no request leaves the prefix, and the session, images and links work."""

from __future__ import annotations

from pathlib import Path

from editor_page import Editor, changed, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Request, expect
from prefix_proxy import proxy_below_prefix

REFUSE_COPY = "() => { navigator.clipboard.writeText = () => Promise.reject(new Error('not allowed')); }"


def test_editor_works_below_a_prefix(server: Server, browser: Browser, tmp_path: Path) -> None:
    (scene,) = server.call("/api/scenes")
    outside: list[str] = []
    with proxy_below_prefix(tmp_path, server.port, is_stripped=True) as url, opened_page(browser) as page:

        def note(request: Request) -> None:
            if request.url.startswith("http") and not request.url.startswith(url):
                outside.append(request.url)

        page.on("request", note)
        page.goto(url)
        expect(page.get_by_text(scene["name"], exact=True)).to_be_visible()
        page.goto(f"{url}?scene={scene['id']}")
        editor = Editor(page)
        editor.wait_until_exact()
        before = editor.pixels()
        editor.choose("Ball", 1)
        editor.drag(editor.slider("Roughness σ"), 0.3, 0.8)
        assert changed(before, editor.pixels()) > 0.01
        shared = editor.pixels()
        page.evaluate(REFUSE_COPY)
        page.get_by_role("button", name="Share: copy a link to this look").click()
        link = page.get_by_role("dialog", name="Link to this look").get_by_role("textbox").input_value()
        assert link.startswith(f"{url}?share=")
        page.goto(link)
        editor.wait_until_exact()
        assert changed(shared, editor.pixels()) == 0
    assert outside == []
