"""An image on a material in a browser: by a button, by a drop on the object; taken off, and undone."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
from editor_page import Editor
from PIL import Image
from playwright.sync_api import expect


@pytest.fixture(scope="module")
def stripes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("image") / "stripes.png"
    image = Image.new("RGB", (64, 64), (230, 60, 20))
    image.paste((20, 60, 230), (0, 0, 32, 64))
    image.save(path)
    return path


@pytest.fixture(scope="module")
def bumps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A normal map of waves."""
    path = tmp_path_factory.mktemp("normals") / "bumps.png"
    x = np.sin(np.arange(64) * np.pi / 4) * 0.5
    normals = np.stack(np.broadcast_arrays(x, x[:, None], np.ones((64, 64))), axis=-1)
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    Image.fromarray(np.round(127.5 * (normals + 1)).astype(np.uint8)).save(path)
    return path


def test_an_image_is_put_on_by_a_button_and_by_a_drop(editor: Editor, stripes: Path) -> None:
    page = editor.page
    chosen = page.get_by_label("Base color texture")
    editor.choose("Floor", 0)
    page.get_by_label("Load texture…").set_input_files(stripes)
    expect(chosen.locator("option:checked")).to_have_text("stripes")
    editor.wait_until_exact()
    chosen.select_option("")  # by keys alone: a list and a button
    expect(chosen.locator("option:checked")).to_have_text("Original texture")
    page.get_by_role("button", name="Undo", exact=True).click()
    expect(chosen.locator("option:checked")).to_have_text("stripes")
    page.get_by_role("button", name="Undo", exact=True).click()
    material = drop_on_the_middle(editor, {"dropped.png": stripes})
    expect(page.locator(".inspector > header h2")).to_have_text(material)
    expect(chosen.locator("option:checked")).to_have_text("dropped")
    editor.wait_until_exact()


def test_an_image_named_like_a_map_of_roughness_and_metal_becomes_both(editor: Editor, stripes: Path) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    page.get_by_label("Model").last.select_option("ggx")
    assert drop_on_the_middle(editor, {"tiles_orm.png": stripes}) == "Ball"
    chosen, metal = (page.get_by_label(label, exact=True) for label in ("Roughness map", "Metalness map"))
    for each in (chosen, metal):
        expect(each.locator("option:checked")).to_have_text("tiles_orm")
    page.get_by_role("button", name="Undo", exact=True).click()
    for each in (chosen, metal):
        expect(each.locator("option:checked")).not_to_have_text("tiles_orm")
    page.get_by_label("Load roughness map…").set_input_files(stripes)  # by keys: a button asks for it
    expect(chosen.locator("option:checked")).to_have_text("stripes")
    chosen.select_option("")
    expect(chosen.locator("option:checked")).not_to_have_text("stripes")
    metal.select_option(label="stripes")
    expect(page.get_by_label("Delete stripes")).to_be_visible()
    metal.select_option("")
    expect(page.get_by_label("Delete stripes")).to_have_count(0)
    editor.wait_until_exact()


@pytest.mark.slow
def test_an_image_of_normals_bends_the_surface(editor: Editor, bumps: Path) -> None:
    """By a button, a list, a drop and keys; taken off and undone, all twice; a reload brings it back."""
    page = editor.page
    editor.choose("Ball", 0)
    chosen, strength = page.get_by_label("Normal map", exact=True), editor.slider("Normal map strength")
    plain = editor.pixels()
    expect(strength).to_have_count(0)
    page.get_by_label("Load normal map…").set_input_files(bumps)
    expect(chosen.locator("option:checked")).to_have_text("bumps")
    expect(page.get_by_text("stay as baked")).to_have_count(0)  # which is said of mirrors alone
    bumpy = editor.pixels()
    assert np.abs(bumpy - plain).max() > 20
    for _ in range(2):
        chosen.select_option("")
        expect(strength).to_have_count(0)
        np.testing.assert_allclose(editor.pixels(), plain, atol=1)  # light is summed in another order
        page.get_by_role("button", name="Undo", exact=True).click()
        expect(chosen.locator("option:checked")).to_have_text("bumps")
        np.testing.assert_array_equal(editor.pixels(), bumpy)
    for key, value in (("Home", "0"), ("End", "4")):
        strength.press(key)
        expect(strength).to_have_attribute("aria-valuenow", value)
        assert np.abs(editor.pixels() - bumpy).max() > 20
    strength.press("Delete")
    np.testing.assert_array_equal(editor.pixels(), bumpy)
    page.reload()
    np.testing.assert_array_equal(editor.pixels(), bumpy)
    editor.choose("Ball", 0)
    expect(chosen.locator("option:checked")).to_have_text("bumps")
    for name in ("tiles_nor_gl_1k.png", "tiles_Normal.png"):  # the same file, by its newest name
        assert drop_on_the_middle(editor, {name: bumps}) == "Ball"
        expect(chosen.locator("option:checked")).to_have_text(name.removesuffix(".png"))
    drop_on_the_middle(editor, {"tiles_nor_dx_1k.png": bumps})
    expect(page.get_by_text("use the OpenGL version")).to_be_visible()


@pytest.mark.slow
def test_an_image_of_emission_shines_and_lights_the_scene(editor: Editor, stripes: Path) -> None:
    """Dropped on an object; its light is in the list of lights; taken off and undone."""
    page = editor.page
    editor.choose("Ball", 0)
    chosen, plain = page.get_by_label("Emission map", exact=True), editor.pixels()
    light = page.get_by_role("slider", name="Ball: intensity", exact=True)
    assert drop_on_the_middle(editor, {"panel_emission.png": stripes}) == "Ball"
    expect(chosen.locator("option:checked")).to_have_text("panel_emission")
    expect(light).to_have_count(1)
    editor.slider("Emission intensity").press("End")
    bright = editor.pixels()
    height, width, _ = bright.shape
    assert (bright - plain)[height // 2, width // 2].max() > 20
    assert (bright - plain).max(axis=2)[-height // 6 :].max() > 20  # the floor
    for _ in range(2):
        chosen.select_option("")
        expect(light).to_have_count(0)
        np.testing.assert_array_equal(editor.pixels(), plain)
        page.get_by_role("button", name="Undo", exact=True).click()
        expect(chosen.locator("option:checked")).to_have_text("panel_emission")
        np.testing.assert_array_equal(editor.pixels(), bright)


def test_images_that_are_dropped_together_are_one_step(
    editor: Editor, stripes: Path, bumps: Path, tmp_path: Path
) -> None:
    """Each in its place, and one message says what is not used; undone at once, and dropped again."""
    page = editor.page
    editor.choose("Ball", 1)
    page.get_by_label("Model").last.select_option("ggx")
    names = ["tiles_Color", "tiles_Normal", "tiles_Roughness", "tiles_Displacement"]
    labels = ["Base color texture", "Normal map", "Roughness map"]
    files = {f"{name}.png": tmp_path / f"{name}.png" for name in names}  # of the same content the newest name counts
    for gray, path in enumerate(files.values()):
        Image.new("L", (8, 8), 100 + gray).save(path)
    files |= {"tiles_Color.png": stripes, "tiles_Normal.png": bumps}
    steps = page.locator(".tile.step:not(.undone)")
    expect(steps).to_have_count(2)
    for _ in range(2):
        assert drop_on_the_middle(editor, files) == "Ball"
        message = page.locator(".toast", has_text="Applied to “Ball”: base color, roughness and normals.")
        expect(message).to_contain_text("Not used: tiles_Displacement.png")
        for label, name in zip(labels, names, strict=False):
            expect(page.get_by_label(label, exact=True).locator("option:checked")).to_have_text(name)
        expect(steps).to_have_count(3)
        page.get_by_role("button", name="Undo", exact=True).click()
        expect(steps).to_have_count(2)
        for label, name in zip(labels, names, strict=False):
            expect(page.get_by_label(label, exact=True).locator("option:checked")).not_to_have_text(name)
        message.get_by_role("button", name="Dismiss").click()


def test_what_cannot_be_taken_is_named_until_the_next_drop(editor: Editor, stripes: Path) -> None:
    page = editor.page
    for name, words in (("cayman.brdf", "give a .binary, .bsdf or .brdf"), ("car.glb", "on the start page")):
        drop_on_the_middle(editor, {name: stripes}, "")
        expect(page.locator(".toast.error")).to_have_count(1)  # that before is gone
        expect(page.locator(".toast.error")).to_contain_text(name)
        expect(page.locator(".toast.error")).to_contain_text(words)
    toast, strip = page.locator(".toast.error").bounding_box(), page.locator(".filmstrip").bounding_box()
    assert toast is not None
    assert strip is not None
    assert toast["y"] + toast["height"] <= strip["y"]
    drop_on_the_middle(editor, {"tiles.png": stripes})
    expect(page.locator(".toast.error")).to_have_count(0)


def drop_on_the_middle(editor: Editor, files: dict[str, Path], mime: str = "image/png") -> str:
    """Let files go over the middle of the picture, each under a name; returns the material that is seen there."""
    page, box = editor.page, editor.canvas.bounding_box()
    assert box is not None
    place = {"clientX": box["x"] + 0.5 * box["width"], "clientY": box["y"] + 0.5 * box["height"]}
    page.mouse.move(place["clientX"], place["clientY"])
    material = page.locator(".picture-bar .material").inner_text()
    messages = [[name, base64.b64encode(file.read_bytes()).decode()] for name, file in files.items()]
    carried = page.evaluate_handle(
        """([messages, type]) => {
          const held = new DataTransfer();
          for (const [name, text] of messages) {
            const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
            held.items.add(new File([bytes], name, { type }));
          }
          return held;
        }""",
        [messages, mime],
    )
    editor.canvas.dispatch_event("dragover", {"dataTransfer": carried, **place})
    editor.canvas.dispatch_event("drop", {"dataTransfer": carried, **place})
    return material
