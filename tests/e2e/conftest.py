"""A real server with a small real bake, and a real browser, once for all tests of a process."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from editor_page import WAIT_MS, Editor, clear_storage, opened_page
from editor_server import SIZE, Server
from playwright.sync_api import Browser, Error, Page, expect, sync_playwright
from tiny_scenes import still_life

from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

NUM_LIGHTS = 200
ARGUMENTS = [
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of this folder needs a browser."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.e2e)


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """The server, with one baked scene: "still life"."""
    data = tmp_path_factory.mktemp("e2e")
    scene = still_life()
    ledger = Ledger(open_database(f"sqlite:///{data / 'relume.db'}"))
    register_scene(data, ledger, scene)
    ledger.close()
    server = Server(data)
    server.start()
    try:
        server.bake(
            {"scene": scene.id, "method": "direct", "views": ["front", "left"], "size": SIZE, "lights": NUM_LIGHTS}
        )
        yield server
    finally:
        server.kill()


@pytest.fixture(scope="module")
def moving_scene(server: Server) -> Iterator[str]:
    """A scene of its own with one bake, whose view moves; it is gone afterwards."""
    identity = server.create_free_camera_scene()
    yield identity
    server.delete(f"/api/scenes/{identity}")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((executable for name in names if (executable := shutil.which(name))), None)
    if path is None:
        pytest.skip("there is no chromium on this machine")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        expect.set_options(timeout=WAIT_MS)  # of a busy machine; five seconds are its default
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def kept_page(browser: Browser) -> Iterator[Page]:
    """A page for all that `editor` opens: a browser that starts a process for each takes longer than most tests."""
    with opened_page(browser) as page:
        yield page


@pytest.fixture
def editor(server: Server, kept_page: Page) -> Iterator[Editor]:
    """The editor of the scene as in a fresh browser profile, its first picture exact; no script on it may fail."""
    page, errors = kept_page, []

    def take_note(error: Error) -> None:
        errors.append(str(error))

    page.on("pageerror", take_note)
    (scene,) = server.call("/api/scenes")
    editor = Editor(page)
    page.goto(f"{server.url}/?scene={scene['id']}")
    editor.wait_until_exact()
    yield editor
    clear_storage(page, server.url)
    page.remove_listener("pageerror", take_note)
    assert errors == []
