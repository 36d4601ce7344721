"""A room whose server is killed goes on on the other one behind nginx, with all that was edited, and stays there."""

from __future__ import annotations

import re
import secrets
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from editor_page import Editor, changed, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Page, expect
from replicas_proxy import CONFIGURATION, proxy_to_ports

ROOM = secrets.token_hex(16)


@pytest.fixture
def servers(server: Server) -> Iterator[tuple[Server, Server]]:
    """Two on one data folder; both run again afterwards, the first as before."""
    other = Server(server.data)
    other.start()
    try:
        yield server, other
    finally:
        other.kill()
        assert server.process is not None
        if server.process.poll() is not None:
            server.start()


@pytest.fixture
def people(browser: Browser) -> Iterator[tuple[Page, Page]]:
    """Two profiles."""
    with opened_page(browser) as ann, opened_page(browser) as bob:
        yield ann, bob


def sessions_of(server: Server) -> int:
    with urllib.request.urlopen(f"{server.url}/metrics", timeout=10) as answer:
        lines = answer.read().decode().splitlines()
    return int(next(float(line.split()[1]) for line in lines if line.startswith("relume_sessions ")))


def floor_is(editor: Editor, value: str) -> None:
    editor.choose("Floor", 0)
    expect(editor.page.locator(".inspector input.number").first).to_have_value(value)


def set_floor(editor: Editor, value: str) -> None:
    editor.choose("Floor", 0)
    editor.page.locator(".inspector input.number").first.fill(value)
    editor.page.keyboard.press("Enter")


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_room_goes_on_when_its_server_is_killed(
    servers: tuple[Server, Server], people: tuple[Page, Page], browser: Browser, tmp_path: Path
) -> None:
    (scene,) = servers[0].call("/api/scenes")
    with proxy_to_ports(tmp_path, [server.port for server in servers]) as port:
        ann, bob = (Editor(page) for page in people)
        for editor in (ann, bob):
            editor.page.goto(f"http://127.0.0.1:{port}/?scene={scene['id']}#room={ROOM}")
            editor.wait_until_exact()
        expect(ann.page.locator(".together .chip")).to_have_count(1)
        ann.choose("Ball", 1)
        ann.drag(ann.slider("Roughness σ"), 0.3, 0.8)
        set_floor(bob, "0.2")
        floor_is(ann, "0.200")
        before = bob.pixels()

        (holder,) = (server for server in servers if sessions_of(server))
        (heir,) = (server for server in servers if server is not holder)
        assert sessions_of(holder) == 2
        holder.kill()
        ann.choose("Ball", 1)
        ann.drag(ann.slider("Roughness σ"), 0.8, 0.5)
        roughness = str(ann.slider("Roughness σ").get_attribute("aria-valuenow"))
        set_floor(bob, "0.35")

        expect(ann.page.locator(".together .chip")).to_have_count(1)
        floor_is(ann, "0.350")
        floor_is(bob, "0.350")
        bob.choose("Ball", 1)
        expect(bob.slider("Roughness σ")).to_have_attribute("aria-valuenow", roughness)
        after = bob.pixels()
        assert changed(before, after) > 0.01
        assert changed(ann.pixels(), after) == 0
        assert sessions_of(heir) == 2

        holder.start()
        time.sleep(_away_s() + 1.0)  # from now on nginx would send who names the room to its first server
        with opened_page(browser) as page:
            cleo = Editor(page)
            cleo.page.goto(f"http://127.0.0.1:{port}/?scene={scene['id']}#room={ROOM}")
            cleo.wait_until_exact()
            expect(cleo.page.locator(".together .chip")).to_have_count(2)
            floor_is(cleo, "0.350")
            set_floor(cleo, "0.25")
            floor_is(ann, "0.250")
            assert (sessions_of(heir), sessions_of(holder)) == (3, 0)


def _away_s() -> float:
    """Seconds for which nginx avoids an unreachable server."""
    (found,) = re.findall(r"fail_timeout=(\d+)s", CONFIGURATION.read_text())
    return float(found)
