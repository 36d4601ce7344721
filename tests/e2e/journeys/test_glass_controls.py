"""Glass edited in a browser: by keys and by a field; previewed, traced, and undone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from editor_page import Editor, changed, clear_storage
from editor_server import Server
from playwright.sync_api import Page, expect
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.scene.model import Glass, Material
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene


@pytest.fixture(scope="module")
def scene_behind_glass(server: Server) -> Iterator[str]:
    """A ball behind a pane, baked for a fixed camera; it is gone afterwards."""
    highlight = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.01, "f0": [0.04] * 3}}
    scene = make_tiny_scene(
        sphere("ball", [0, 0, -0.5], 0.6, 0),
        quad("pane", [[-0.8, -1, 0.5], [0.8, -1, 0.5], [0.8, 0.8, 0.5], [-0.8, 0.8, 0.5]], 1),
        camera=make_camera("front", (0, 0.2, 3), (0, 0, 0), 0.7),
        environment=studio(),
        materials=[
            Material("Clay", ({"model": "lambert", "color": [0.8, 0.5, 0.3]},)),
            Material("Pane", (highlight,), glass=Glass()),
        ],
    )
    ledger = Ledger(open_database(f"sqlite:///{server.data / 'relume.db'}"))
    register_scene(server.data, ledger, scene)
    ledger.close()
    server.bake({"scene": scene.id, "views": ["front"], "method": "gather", "size": (160, 120), "lights": 100})
    yield scene.id
    server.delete(f"/api/scenes/{scene.id}")


@pytest.mark.slow
def test_glass_is_edited_by_keys_and_undone(kept_page: Page, server: Server, scene_behind_glass: str) -> None:
    page, editor = kept_page, Editor(kept_page)
    page.goto(f"{server.url}/?scene={scene_behind_glass}")
    editor.wait_until_exact()
    page.get_by_role("option", name="Pane").click()
    clear = editor.pixels()
    green = page.get_by_label("Glass color, green, linear")
    green.fill("0.2")
    green.press("Enter")
    tinted = editor.pixels()
    assert changed(clear, tinted) > 0.1
    roughness = editor.slider("Glass roughness")
    roughness.focus()
    for _ in range(4):
        page.keyboard.press("PageUp")
    frosted = editor.pixels()
    assert changed(tinted, frosted) > 0.02
    expect(editor.slider("Roughness")).to_have_attribute(
        "aria-valuenow", roughness.get_attribute("aria-valuenow") or ""
    )
    page.get_by_role("button", name="Undo", exact=True).click()
    editor.wait_until_exact()
    page.get_by_role("button", name="Undo", exact=True).click()
    assert changed(clear, editor.pixels()) < 0.01
    page.get_by_role("option", name="Clay").click()
    expect(page.get_by_label("Glass color, green, linear")).to_have_count(0)
    clear_storage(page, server.url)
