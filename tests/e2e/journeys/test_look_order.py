"""Saved looks and lights in a browser: in their order and with their pictures, for whoever comes."""

from __future__ import annotations

from editor_page import Editor, opened_page
from editor_server import Server
from playwright.sync_api import Browser, Locator, Page, expect

SIGMA = "Roughness σ"


def save_as(page: Page, name: str) -> None:
    page.keyboard.press("Control+s")
    rename(page, page.get_by_role("textbox", name="New name of"), name)


def rename(page: Page, field: Locator, name: str) -> None:
    field.fill(name)
    field.press("Enter")
    expect(page.get_by_role("button", name=f"Show {name}", exact=True)).to_be_visible()


def delete(page: Page, name: str) -> None:
    shown = page.get_by_role("button", name=f"Show {name}", exact=True)
    shown.hover()
    page.get_by_role("button", name=f"Delete {name}", exact=True).click()
    expect(shown).to_have_count(0)


def expect_looks(page: Page, names: list[str]) -> None:
    expect(page.locator(".tiles.saved .tile-name")).to_have_text(names)


def add_light(editor: Editor, kind: str) -> None:
    editor.page.get_by_role("button", name="Add light").click()
    editor.page.get_by_role("group", name="Light type").get_by_role("button", name=kind).click()
    editor.page.get_by_role("button", name="Place in center").click()
    expect(editor.page.locator(".light .name", has_text=kind)).to_have_attribute("aria-pressed", "true")


def expect_lights(page: Page, names: list[str]) -> None:
    expect(page.locator(".light .name")).to_have_text(names)


def test_looks_and_lights_keep_their_order_and_thumbnails_are_for_everybody(
    editor: Editor, server: Server, browser: Browser
) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    for name, key in (("Night", "End"), ("Studio", "Home"), ("Dawn", "PageUp")):
        editor.slider(SIGMA).press(key)
        editor.wait_until_exact()
        save_as(page, name)
    for kind in ("Spot", "Point"):
        add_light(editor, kind)
    editor.wait_until_exact()
    save_as(page, "Lit")
    order = ["Night", "Studio", "Dawn", "Lit"]
    expect_looks(page, order)
    expect_lights(page, ["Spot", "Point"])
    page.reload()
    editor.wait_until_exact()
    expect(page.locator(".tiles.saved .tile-picture img")).to_have_count(4)
    expect_looks(page, order)
    # renamed, then deleted and brought back, it stands where it stood, with its picture
    page.get_by_role("button", name="Rename Studio").click()
    rename(page, page.get_by_role("textbox", name="New name of Studio"), "Noon")
    expect(page.get_by_role("button", name="Show Studio", exact=True)).to_have_count(0)
    delete(page, "Night")
    page.keyboard.press("Control+z")
    expect(page.get_by_role("button", name="Show Night", exact=True)).to_be_visible()
    order = ["Night", "Noon", "Dawn", "Lit"]
    with opened_page(browser) as participant:
        participant.goto(page.url)
        Editor(participant).wait_until_exact()
        expect(participant.locator(".tiles.saved .tile-picture img")).to_have_count(4)
        expect_looks(participant, order)
        shown = "(image) => image.complete && image.naturalWidth > 0"
        for image in participant.locator(".tiles.saved .tile-picture img").all():
            participant.wait_for_function(shown, arg=image.element_handle())
        participant.get_by_role("button", name="Show Lit", exact=True).click()
        expect_lights(participant, ["Spot", "Point"])
    for name in order:
        delete(page, name)


def test_a_link_keeps_the_order_of_lights(editor: Editor, browser: Browser) -> None:
    page = editor.page
    for kind in ("Spot", "Point"):
        add_light(editor, kind)
    editor.wait_until_exact()
    page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(new Error('not allowed')); }")
    page.get_by_role("button", name="Share: copy a link to this look").click()
    link = page.get_by_role("dialog", name="Link to this look").get_by_role("textbox").input_value()
    with opened_page(browser) as participant:
        participant.goto(link)
        Editor(participant).wait_until_exact()
        expect_lights(participant, ["Spot", "Point"])


def test_a_step_that_is_left_at_once_has_a_picture(editor: Editor) -> None:
    page = editor.page
    editor.choose("Ball", 1)
    pictures = page.locator(".tile.step img")
    expect(pictures).to_have_count(1)
    for key in ("End", "Home", "PageUp"):
        editor.slider(SIGMA).press(key)
        page.get_by_role("button", name="Reset material", exact=True).click()
    expect(page.locator(".tile.step")).to_have_count(7)
    expect(pictures).to_have_count(7)
