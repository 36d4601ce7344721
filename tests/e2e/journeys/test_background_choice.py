"""Backgrounds and shadow-catching grounds, in a browser."""

from __future__ import annotations

import io
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from editor_page import Editor, changed
from editor_server import SIZE, Server
from PIL import Image
from playwright.sync_api import Browser, expect

pytestmark = pytest.mark.slow  # by themselves they take minutes of a browser

SQUARES = {69, 92}


def ids(server: Server, bake: str) -> np.ndarray:
    """Material of each pixel of the view "front". (height, width)"""
    with urllib.request.urlopen(f"{server.url}/api/bakes/{bake}/views/front/materials.png") as answer:
        return np.asarray(Image.open(io.BytesIO(answer.read())))


def downloaded(editor: Editor, button: str, path: Path) -> Path:
    with editor.page.expect_download() as download:
        editor.page.get_by_role("button", name=button, exact=True).click()
    download.value.save_as(path)
    return path


def shown_in(picture: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Screen pixels of a mask of the baked image, without its edges."""
    height, width = picture.shape[:2]
    aspect = mask.shape[1] / mask.shape[0]
    inner = min(width, height * aspect) - 24  # the editor leaves a margin round it
    place = np.zeros((height, width), bool)
    size = int(inner), int(inner / aspect)
    small = np.asarray(Image.fromarray(mask.astype(np.uint8) * 255).resize(size, Image.Resampling.BILINEAR)) > 254
    top, left = (height - size[1]) // 2, (width - size[0]) // 2
    place[top : top + size[1], left : left + size[0]] = small
    for _ in range(6):
        place[1:-1, 1:-1] &= place[2:, 1:-1] & place[:-2, 1:-1] & place[1:-1, 2:] & place[1:-1, :-2]
    return place


def test_the_background_is_chosen_by_click_and_key_and_leaves_the_objects(
    editor: Editor, server: Server, tmp_path: Path
) -> None:
    page = editor.page
    (bake,) = server.call("/api/bakes")
    material = ids(server, bake["id"])
    group = page.get_by_role("radiogroup", name="Background")
    expect(group.get_by_role("radio", name="HDRI")).to_be_checked()
    before = editor.pixels()
    outside, ball = shown_in(before, material == 65535), shown_in(before, material == 2)
    assert outside.sum() > 2000
    assert ball.sum() > 2000
    group.get_by_role("radio", name="Blurred").click()
    page.get_by_role("slider", name="Background blur").press("End")
    blurred = editor.pixels()
    assert np.abs(blurred - before)[outside].max() > 5
    assert np.abs(blurred - before)[ball].max() <= 1
    group.get_by_role("radio", name="Blurred").press("ArrowRight")
    expect(group.get_by_role("radio", name="Color")).to_be_focused()
    page.get_by_label("Background color, red, linear").fill("2")
    page.keyboard.press("Enter")
    red = editor.pixels()
    assert red[outside].std(axis=0).max() < 1
    assert np.abs(red - before)[ball].max() <= 1
    for _ in range(4):
        page.get_by_role("button", name="Undo", exact=False).first.click()
    assert changed(before, editor.pixels()) == 0
    group.get_by_role("radio", name="Transparent").click()
    none = editor.pixels()
    assert set(np.unique(none[outside])) <= SQUARES
    page.reload()
    expect(group.get_by_role("radio", name="Transparent")).to_be_checked()
    assert changed(none, editor.pixels()) == 0
    page.keyboard.press("a")  # beside another background, what was kept has none still
    group.get_by_role("radio", name="Color").click()
    editor.wait_until_exact()
    page.keyboard.down("c")
    assert changed(none, editor.pixels()) == 0
    page.keyboard.up("c")
    assert not set(np.unique(editor.pixels()[outside])) & SQUARES
    page.get_by_role("button", name="Undo", exact=False).first.click()
    editor.wait_until_exact()
    with Image.open(downloaded(editor, "PNG", tmp_path / "a.png")) as image:
        assert image.mode == "RGBA"
        alpha = np.asarray(image)[..., 3]
    assert {0, 255} <= set(alpha.ravel())
    assert np.mean((alpha > 127) == (material != 65535)) > 0.98
    page.get_by_role("button", name="Undo", exact=False).first.click()
    with Image.open(downloaded(editor, "PNG", tmp_path / "b.png")) as image:
        assert np.asarray(image.convert("RGBA"))[..., 3].min() == 255


@pytest.fixture
def grounded(server: Server, browser: Browser) -> Iterator[Editor]:
    """The scene on a ground, made on the start page; deleted when it is done with."""
    (scene,) = server.call("/api/scenes")
    page = browser.new_context(viewport={"width": 1280, "height": 800}, accept_downloads=True).new_page()
    page.goto(server.url)
    page.get_by_role("button", name=f"Add ground plane to {scene['name']}").click()
    expect(page.get_by_role("button", name=f"Open {scene['name']} on a ground")).to_be_visible()
    made = next(each for each in server.call("/api/scenes") if each["id"] != scene["id"])
    try:
        assert [material["shadow_catcher"] for material in made["materials"]] == [False, False, False, True]
        expect(page.get_by_role("button", name=f"Add ground plane to {made['name']}")).to_have_count(0)
        bake = server.call(
            "/api/bakes", {"scene": made["id"], "method": "direct", "views": ["front"], "size": SIZE, "lights": 200}
        )
        while bake["state"] in ("queued", "running"):
            time.sleep(0.1)
            bake = server.call(f"/api/bakes/{bake['id']}")
        page.goto(f"{server.url}/?scene={made['id']}")
        editor = Editor(page)
        editor.wait_until_exact()
        yield editor
    finally:
        page.context.close()
        remove = urllib.request.Request(f"{server.url}/api/scenes/{made['id']}", method="DELETE")
        urllib.request.urlopen(remove).close()


def test_a_ground_shows_shadows_alone_or_itself(grounded: Editor, server: Server, tmp_path: Path) -> None:
    page = grounded.page
    bake = page.url.split("bake=")[1].split("&")[0] if "bake=" in page.url else server.call("/api/bakes")[0]["id"]
    material = ids(server, bake)
    on_ground = grounded.pixels()
    page.get_by_role("option", name="Ground").click()
    only = page.get_by_role("checkbox", name="Shadow catcher")
    expect(only).to_be_checked()
    expect(page.locator(".card")).to_have_count(0)
    only.press("Space")
    expect(page.locator(".card")).to_have_count(1)
    plain = grounded.pixels()
    ground, ball = shown_in(on_ground, material == 3), shown_in(on_ground, material == 2)
    assert ground.sum() > 1000
    assert (np.abs(plain - on_ground)[ground].max(axis=1) > 2).mean() > 0.5
    assert np.abs(plain - on_ground)[ball].max() <= 1
    page.get_by_role("button", name="Undo", exact=False).first.click()
    assert changed(on_ground, grounded.pixels()) == 0
    page.get_by_role("radiogroup", name="Background").get_by_role("radio", name="Transparent").click()
    grounded.wait_until_exact()
    with Image.open(downloaded(grounded, "PNG", tmp_path / "a.png")) as image:
        pixels = np.asarray(image)[material == 3]
    assert np.median(pixels[:, 3]) < 40 < 80 < np.quantile(pixels[:, 3], 0.99)
    assert np.median(pixels[pixels[:, 3] > 60][:, :3]) < 10
    exr = OpenImageIO.ImageBuf(str(downloaded(grounded, "EXR", tmp_path / "a.exr")))
    assert exr.spec().alpha_channel >= 0
