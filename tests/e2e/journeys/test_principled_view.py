"""A material as principled parameters: dragged as one step, pasted on another one, and undone."""

from __future__ import annotations

from editor_page import Editor, changed
from playwright.sync_api import expect


def test_a_material_is_edited_as_principled_and_pasted(editor: Editor) -> None:
    page = editor.page
    materials = page.get_by_role("listbox", name="Materials")
    materials.get_by_role("option", name="Floor").click()
    page.get_by_role("radio", name="Principled").click()
    metallic = editor.slider("Metallic")
    expect(metallic).to_have_attribute("aria-valuenow", "0")
    before = editor.pixels()
    editor.drag(metallic, 0.02, 0.9)
    metal = editor.pixels()
    assert changed(before, metal) > 0.1
    page.get_by_role("button", name="Copy", exact=True).click()
    materials.get_by_role("option", name="Wall").click(modifiers=["Control"])
    materials.get_by_role("option", name="Ball").click(modifiers=["Control"])
    expect(materials.get_by_role("option", selected=True)).to_have_count(3)
    page.get_by_role("button", name="Paste", exact=True).click()
    assert changed(metal, editor.pixels()) > 0.1
    page.keyboard.press("Control+z")
    assert changed(metal, editor.pixels()) == 0
    page.keyboard.press("Control+z")
    assert changed(before, editor.pixels()) == 0
    expect(page.get_by_role("button", name="Undo")).to_be_disabled()
