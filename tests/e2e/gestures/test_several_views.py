"""Several views side by side in the browser: an edit changes all, each answers the pointer, a reload keeps them."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from editor_page import WAIT_FOR_FRAMES, WAIT_MS, Editor, changed
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import expect

SIGMA = "Roughness σ"


@pytest.fixture
def both(editor: Editor) -> Editor:
    """The editor with both views beside each other."""
    editor.page.keyboard.press("v")
    expect(editor.page.locator(".cell")).to_have_count(2)
    editor.wait_until_exact()
    return editor


def cells(editor: Editor) -> list[NDArray[np.int16]]:
    """The image of each view."""
    editor.wait_until_exact()
    editor.page.mouse.move(2, 2)
    editor.page.evaluate(WAIT_FOR_FRAMES)
    return screenshots(editor)


def screenshots(editor: Editor) -> list[NDArray[np.int16]]:
    """The canvases as they are now."""
    images = [Image.open(io.BytesIO(canvas.screenshot())) for canvas in editor.canvas.all()]
    return [np.asarray(image.convert("RGB")).astype(np.int16) for image in images]


def at(editor: Editor, cell: int, x: float, y: float) -> tuple[float, float]:
    """A point of the page, by fractions of a cell."""
    box = editor.canvas.nth(cell).bounding_box()
    assert box is not None
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


def test_one_drag_changes_every_view_and_a_stretch_of_the_curve_tints_each(both: Editor) -> None:
    both.choose("Ball", 1)
    before = cells(both)
    assert min(picture.std() for picture in before) > 10
    drawn = both.page.evaluate("window.relumeStats.latencies.length")
    both.drag(both.slider(SIGMA), 0.3, 0.8)
    after = cells(both)
    assert min(changed(a, b) for a, b in zip(before, after, strict=True)) > 0.005
    assert both.page.evaluate("window.relumeStats.latencies.length") > drawn

    plain = cells(both)
    plot = both.page.locator(".plot").bounding_box()
    assert plot is not None
    both.page.mouse.move(plot["x"] + 0.3 * plot["width"], plot["y"] + 0.5 * plot["height"])
    deadline = time.monotonic() + WAIT_MS / 1e3
    while not all(changed(a, b) > 0.1 for a, b in zip(plain, screenshots(both), strict=True)):
        assert time.monotonic() < deadline, "a view was not tinted"


def test_the_pointer_is_sent_to_the_server_and_inspects_its_own_view(both: Editor) -> None:
    sent: list[str] = []
    both.page.on("websocket", lambda socket: socket.on("framesent", lambda data: sent.append(str(data))))
    both.page.reload()
    both.wait_until_exact()
    for cell, view in ((1, "left"), (0, "front")):
        sent.clear()
        both.page.mouse.move(*at(both, cell, 0.5, 0.5))
        both.page.wait_for_function("() => !document.querySelector('.probe.quiet')")
        both.page.wait_for_timeout(200)
        assert f'{{"type":"focus","view":"{view}"}}' in sent
        assert any(f'"inspect","view":"{view}"' in message for message in sent)
    both.page.mouse.click(*at(both, 1, 0.5, 0.5))
    expect(both.page.locator("[role=option][aria-selected=true]")).to_have_text("Ball")
    expect(both.page.locator(".cell.active .cell-name")).to_have_text("left")
    with both.page.expect_download() as download:
        both.page.get_by_role("button", name="PNG").click()
    assert download.value.suggested_filename == "still-life-left.png"


def test_side_by_side_survives_a_reload_and_enter_shows_one_alone(both: Editor) -> None:
    before = cells(both)
    both.page.reload()
    after = cells(both)
    assert [changed(a, b) for a, b in zip(before, after, strict=True)] == [0, 0]
    both.canvas.nth(1).focus()
    both.page.keyboard.press("Enter")
    expect(both.page.locator(".cell")).to_have_count(1)
    both.canvas.evaluate("canvas => canvas.blur()")  # which has the focus still, and a ring about it
    alone = both.pixels()
    both.page.get_by_role("button", name="left").click()
    assert changed(alone, both.pixels()) == 0
    both.page.get_by_role("button", name="front").click()
    assert changed(alone, both.pixels()) > 0.1
    both.page.get_by_role("button", name="Views side by side").click()
    both.page.mouse.dblclick(*at(both, 0, 0.5, 0.2))
    expect(both.page.locator(".cell")).to_have_count(1, timeout=WAIT_MS)
