"""The editor where people log in: who may look, who may edit, and what happens when a token is revoked meanwhile."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from editor_page import Editor, changed, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Page, expect

from relume_server.auth.services import AuthServices
from relume_server.settings import Settings
from relume_worker.database import open_database
from relume_worker.ledger import Ledger


@pytest.fixture(scope="module")
def access(server: Server) -> Iterator[AuthServices]:
    """Tokens and audit of the servers' database."""
    ledger = Ledger(open_database(f"sqlite:///{server.data / 'relume.db'}"))
    yield AuthServices(ledger.sessions, Settings())
    ledger.close()


@pytest.fixture(scope="module")
def asking(server: Server) -> Iterator[Server]:
    """A second server on the same folder; people log in to it."""
    asking = Server(server.data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELUME_LOGIN", "true")
        asking.start()
    yield asking
    asking.kill()


def log_in(page: Page, token: str) -> Editor:
    page.get_by_label("Access token").fill(token)
    page.get_by_role("button", name="Log in").click()
    editor = Editor(page)
    editor.wait_until_exact()
    return editor


def test_people_log_in_and_roles_say_what_they_may_do(
    server: Server, asking: Server, access: AuthServices, browser: Browser
) -> None:
    (scene,) = server.call("/api/scenes")
    url = f"{asking.url}/?scene={scene['id']}"
    with opened_page(browser) as page:
        page.goto(url)
        page.get_by_label("Access token").fill("relume_000000000000_x")
        page.get_by_role("button", name="Log in").click()
        expect(page.get_by_role("alert")).to_contain_text("this token is not valid")
        log_in(page, access.tokens.add("Vera", "view"))
        page.get_by_role("option", name="Ball").click()
        expect(page.get_by_role("note")).to_contain_text("View-only access")
        expect(page.locator("aside [inert]")).to_be_attached()
        expect(page.locator(".readout")).to_contain_text("Click to add a point")  # it is there
        viewer = Editor(page)
        before = viewer.pixels()
        page.get_by_role("slider", name="Exposure").press("ArrowRight")
        assert changed(viewer.pixels(), before) > 0.01
        page.keyboard.press("n")
        expect(page.get_by_role("status").filter(has_text="You have view-only access")).to_be_visible()
        page.get_by_role("button", name="Log out").click()
        expect(page.get_by_label("Access token")).to_be_visible()
        editor = log_in(page, access.tokens.add("Ann", "edit"))
        expect(page.locator(".account")).to_contain_text("Ann")
        expect(page.get_by_role("note")).to_have_count(0)
        editor.choose("Ball", 1)
        roughness = editor.slider("Roughness σ")
        editor.drag(roughness, 0.5, 0.7)
        edited = roughness.get_attribute("aria-valuenow")
        editor.wait_until_exact()
        access.tokens.revoke("Ann")
        expect(page.get_by_role("dialog", name="Log in")).to_contain_text("revoked")
        editor = log_in(page, access.tokens.add("Ann", "edit"))
        editor.choose("Ball", 1)
        expect(editor.slider("Roughness σ")).to_have_attribute("aria-valuenow", str(edited))
    assert any(line.who == "Ann" and "edits in a session" in line.what for line in access.audit.list())


@pytest.mark.slow
def test_who_may_only_look_chooses_light_paths_and_hears_no_objection(
    server: Server, asking: Server, access: AuthServices, browser: Browser
) -> None:
    scene = str(server.call("/api/example-scenes/cornell_box", {})["id"])
    server.bake({"scene": scene, "method": "gather", "size": (96, 96), "lights": 100})
    with opened_page(browser) as page:
        page.goto(asking.url)
        page.get_by_label("Access token").fill(access.tokens.add("Vito", "view"))
        page.get_by_role("button", name="Log in").click()
        expect(page.locator(".account")).to_contain_text("Vito")
        page.goto(f"{asking.url}/?scene={scene}")
        viewer = Editor(page)
        viewer.wait_until_exact()
        before = viewer.pixels()
        page.get_by_role("radiogroup", name="Light paths").get_by_role("radio", name="Direct", exact=True).click()
        viewer.wait_until_exact()
        assert changed(viewer.pixels(), before) > 0.01
        page.get_by_role("slider", name="Bounces").press("ArrowLeft")
        viewer.wait_until_exact()
        expect(page.get_by_text("View-only access")).to_have_count(1)  # the line that is always there
        expect(page.get_by_role("alert")).to_have_count(0)
    server.delete(f"/api/scenes/{scene}")
