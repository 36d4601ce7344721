"""A real server with a small real bake, and a real browser, once for all of these tests."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from editor_page import Editor
from playwright.sync_api import Browser, sync_playwright
from tiny_scenes import still_life

from worker.database import open_database
from worker.ledger import Ledger
from worker.scenes import register_scene

SIZE, NUM_LIGHTS = (320, 240), 200
START_S, BAKE_S = 60.0, 120.0
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of this folder needs a browser."""
    for item in items:
        if Path(item.fspath).parent == Path(__file__).parent:
            item.add_marker(pytest.mark.e2e)


class Server:
    """`relume serve` as a process of its own; `kill` takes it away as a power cut would."""

    def __init__(self, data: Path) -> None:
        self.data = data
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it answers."""
        command = [sys.executable, "-m", "cli.main", "serve", "--data", str(self.data), "--port", str(self.port)]
        with (self.data / "server.txt").open("ab") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log)
        deadline = time.monotonic() + START_S
        while True:
            try:
                return urllib.request.urlopen(f"{self.url}/readyz", timeout=2).close()
            except OSError:
                if time.monotonic() > deadline or self.process.poll() is not None:
                    pytest.fail(f"the server did not start: {(self.data / 'server.txt').read_text()}")
                time.sleep(0.1)

    def kill(self) -> None:
        """End it at once, without goodbyes."""
        assert self.process is not None
        self.process.kill()
        self.process.wait()

    def call(self, path: str, body: dict[str, Any] | None = None) -> Any:
        """GET, or POST where there is a body."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=10) as answer:
            return json.load(answer)


@pytest.fixture(scope="package")
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
        recipe = {"scene": scene.id, "views": ["front"], "size": SIZE, "lights": NUM_LIGHTS}
        bake = server.call("/api/bakes", recipe)
        deadline = time.monotonic() + BAKE_S
        while bake["state"] in ("queued", "running") and time.monotonic() < deadline:
            time.sleep(0.1)
            bake = server.call(f"/api/bakes/{bake['id']}")
        assert bake["state"] == "ready", bake["problem"]
        yield server
    finally:
        server.kill()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("there is no chromium on this machine")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def editor(server: Server, browser: Browser) -> Iterator[Editor]:
    """The editor of the scene in a fresh browser profile, its first picture exact."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, accept_downloads=True)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    editor = Editor(page)
    (scene,) = server.call("/api/scenes")
    page.goto(f"{server.url}/?scene={scene['id']}")
    editor.wait_until_exact()
    yield editor
    context.close()
    assert errors == []
