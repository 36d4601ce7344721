"""The first minute in a browser: built-in scenes, folders and several files, remarks, bakes of any shape."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from editor_page import Editor, opened_page
from editor_server import Server
from PIL import Image
from playwright.sync_api import Browser, Page, expect

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
FACES = "usemtl Wall\nf 1/1 2/2 3/3\nl 1 2\nf 2/1 4/2 3/3\n"
ROOM = f"mtllib looks/room.mtl\n{TRIANGLE}v 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n{FACES}"
LOOKS = "newmtl Wall\nKd 1 1 1\nmap_Kd ../images/wall.png\nmap_Ks ../images/gone.png\n"
GLTF = {
    "asset": {"version": "2.0"},
    "buffers": [{"uri": "far%20away.bin", "byteLength": 36}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an .obj, and what belongs to it in folders of their own."""
    folder = tmp_path_factory.mktemp("files") / "room"
    for name, content in {"room.obj": ROOM, "looks/room.mtl": LOOKS, "README.md": "a room"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    (folder / "images").mkdir()
    Image.new("RGB", (2, 2), (200, 40, 40)).save(folder / "images" / "wall.png")
    return folder


@pytest.fixture
def start(server: Server, browser: Browser) -> Iterator[Page]:
    """The start page in a fresh profile; scenes that a test imports are gone afterwards."""
    known = {scene["id"] for scene in server.call("/api/scenes")}
    with opened_page(browser) as page:
        page.goto(server.url)
        expect(page.get_by_text("choose files")).to_be_visible()  # before it stands, a drop is the browser's own
        yield page
    for scene in server.call("/api/scenes"):
        if scene["id"] not in known:
            server.delete(f"/api/scenes/{scene['id']}")


def drop(page: Page, *paths: Path) -> None:
    """Drop files and folders of the disk onto the page, as a file manager does."""
    session = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, "x": 400, "y": 300, "data": data})


@pytest.mark.slow
def test_one_click_takes_a_built_in_scene_and_opens_it(start: Page, server: Server) -> None:
    start.get_by_role("button", name="Still life Teapot").click()
    Editor(start).wait_until_exact()
    expect(start.get_by_role("heading", level=1)).to_have_text("Still life")
    expect(start.get_by_role("option", name="Teapot")).to_be_visible()


def test_a_dropped_folder_becomes_a_scene_with_import_warnings_baked_in_any_shape(
    start: Page, server: Server, room: Path
) -> None:
    drop(start, room)
    expect(start.get_by_text("Scene: room.obj with 2 files")).to_be_visible()
    start.get_by_role("button", name="Import", exact=True).click()
    dialog = start.get_by_role("region", name="Bake room")
    warnings = dialog.get_by_role("region", name="Differs from the file")
    expect(warnings).to_contain_text("Missing image “../images/gone.png” (map_Ks of material “Wall”)")
    expect(dialog.get_by_role("region", name="Ignored")).to_contain_text("lines aren't supported")
    own = dialog.get_by_role("group", name="Custom bake")
    own.get_by_label("Height").fill("16385")
    expect(dialog.get_by_text("Enter a width and height in pixels")).to_be_visible()
    own.get_by_label("Width").fill("60")
    own.get_by_label("Height").fill("200")
    own.get_by_label("Environment detail").fill("40")
    expect(dialog.locator(".custom-recipe .plan")).to_have_attribute("title", re.compile("^40 environment triangles"))
    expect(dialog.get_by_role("radio", name=re.compile("^Global illumination"))).to_be_checked()
    dialog.get_by_role("radio", name=re.compile("^Direct light")).check()
    dialog.get_by_label("Optimize for swapping HDRIs").check()
    dialog.locator(".custom-recipe").get_by_role("button", name="Open and bake").click()
    editor = Editor(start)
    expect(start.get_by_role("button", name="60×200, direct light")).to_be_visible()
    wall = editor.pixels()
    mark = start.get_by_text("Direct light only")
    expect(mark).to_be_visible()
    expect(mark).to_have_attribute("title", re.compile("No bounce light"))
    assert (wall[..., 0] - wall[..., 2]).max() > 40  # the image came along: it is red
    (scene,) = (each for each in server.call("/api/scenes") if each["name"] == "room")
    recipes = [bake["recipe"] for bake in server.call(f"/api/bakes?scene={scene['id']}")]
    assert (recipes[0]["size"], recipes[0]["lights"], recipes[0]["relightable"]) == ([60, 200], 40, True)
    mark = start.get_by_role("button", name="Import warnings: 1 difference, 1 ignored")
    mark.click()
    expect(start.get_by_text("Missing image “../images/gone.png” (map_Ks of material “Wall”)")).to_be_visible()
    start.keyboard.press("Escape")
    expect(start.get_by_text("Missing image “../images/gone.png” (map_Ks of material “Wall”)")).to_have_count(0)


@pytest.mark.slow
def test_several_files_are_several_scenes_and_missing_files_are_named(
    start: Page, server: Server, tmp_path: Path
) -> None:
    before = len(server.call("/api/scenes"))
    for name, content in {"one.obj": TRIANGLE + "f 1 2 3\n", "notes.txt": "", "two.gltf": json.dumps(GLTF)}.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "far away.bin").write_bytes(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes())
    drop(start, tmp_path / "notes.txt")
    expect(start.get_by_text("Can't open notes.txt. Scenes: GLB")).to_be_visible()
    expect(start.get_by_role("button", name="Import", exact=True)).to_be_disabled()
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE")
    drop(start, tmp_path / "sky.hdr")
    expect(start.get_by_text("Add a scene to light with it")).to_be_visible()
    start.get_by_role("button", name="Clear").click()
    files = start.get_by_label("choose files")
    files.set_input_files([tmp_path / "one.obj", tmp_path / "two.gltf"])
    expect(start.get_by_text("missing: far away.bin")).to_be_visible()
    start.get_by_role("button", name="Import 2 scenes").click()
    expect(start.get_by_text("1 scene imported, 1 failed")).to_be_visible()
    expect(start.get_by_role("list", name="Chosen scenes")).to_contain_text("buffer 0 is outside the file")
    expect(start.get_by_role("button", name="Open one")).to_be_visible()
    assert len(server.call("/api/scenes")) == before + 1
    drop(start, tmp_path / "far away.bin")
    expect(start.get_by_text("Scene: two.gltf with 1 file")).to_be_visible()
    start.get_by_role("button", name="Import", exact=True).click()
    expect(start.get_by_role("button", name="Open two")).to_be_visible()
    assert len(server.call("/api/scenes")) == before + 2
