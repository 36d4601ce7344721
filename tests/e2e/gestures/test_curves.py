"""Curves under the hand in a browser: what is not touched does not change, and what is moved changes nothing else."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from editor_page import WAIT_FOR_FRAMES, WAIT_MS, Editor, changed
from editor_server import Server
from numpy.typing import NDArray
from playwright.sync_api import Locator, expect

from relume import look as looks
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer

HALF_ANGLE = "half angle θh"
NUDGE = 1e-3
# of the brightest value: what float32 sums are off by where a highlight was before (docs/direct-light.md#algorithm)
ROUNDING = 1e-6
RESAMPLED = 1e-4
# everything that the page says to the server from now on
LISTEN = """() => {
  window.said = [];
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (data) {
    window.said.push(data);
    return send.call(this, data);
  };
}"""


class CurvePage:
    """The curve editor of the ball's highlight, and what it says to the server."""

    def __init__(self, editor: Editor) -> None:
        self.editor, self.page = editor, editor.page
        self.points = self.page.locator(".plot [role=slider]")
        self.page.evaluate(LISTEN)

    def open(self, params: dict[str, float], log: bool) -> None:
        """The curve over the half angle at these parameters, its points and their table shown."""
        for label, value in params.items():
            self.editor.slider(label).press("Enter")
            number = self.page.get_by_label(f"{label} value")
            number.fill(str(value))
            number.press("Enter")
        tab = self.page.get_by_role("button", name=HALF_ANGLE, exact=True)
        if tab.get_attribute("aria-expanded") != "true":
            tab.click()
        axis = self.page.get_by_role("button", name="log", exact=True)
        if (axis.get_attribute("aria-pressed") == "true") != log:
            axis.click()
        table = self.page.get_by_role("button", name="Point table")
        if table.get_attribute("aria-pressed") != "true":
            table.click()
        self.points.first.wait_for(timeout=WAIT_MS)
        self.editor.wait_until_exact()
        self.page.evaluate("window.said = []")

    def said(self) -> list[Any]:
        """The values of the curve after each edit since the last call; None for an undo."""
        self.page.evaluate(WAIT_FOR_FRAMES)
        messages = [json.loads(text) for text in self.page.evaluate("window.said.splice(0)")]
        edits = [op for message in messages if message["type"] == "edit" for op in message["patch"]]
        return [op.get("value") for op in edits if "/curves" in op["path"]]

    def shown(self) -> list[str | None]:
        """The positions of the points as text."""
        return [point.get_attribute("aria-valuetext") for point in self.points.all()]

    def value(self, index: int) -> Locator:
        """A point's value in the table."""
        return self.page.get_by_label(f"Point {index + 1}, value")

    def type_value(self, index: int, value: float) -> None:
        """Type it there."""
        self.value(index).fill(f"{value:.9g}")
        self.value(index).press("Enter")

    def drag_in_plot(self, start: tuple[float, float], stop: tuple[float, float]) -> None:
        """Drag between fractions of the plot's width and height."""
        box = self.page.locator(".plot svg").bounding_box()
        assert box is not None
        (x0, y0), (x1, y1) = ((box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in (start, stop))
        self.page.mouse.move(x0, y0)
        self.page.mouse.down()
        self.page.mouse.move(x1, y1, steps=10)
        self.page.mouse.up()


@pytest.fixture
def curve(editor: Editor) -> CurvePage:
    """The curve of the ball's highlight."""
    editor.choose("Ball", 1)
    return CurvePage(editor)


class Painter:
    """Linear radiance of looks of the baked scene, as the server computes it."""

    def __init__(self, server: Server) -> None:
        (bake,) = server.call("/api/bakes")
        self._transfer = open_transfer(server.data / "bakes" / f"{bake['id']}.zarr", Cache(1 << 30))
        self._picture = Picture(self._transfer, "front", Cache(1 << 30))

    def paint(self, term: dict[str, Any]) -> NDArray[np.float64]:
        """With this highlight on the ball."""
        terms = [self._transfer.default_look["materials"]["Ball"]["terms"][0], term]
        look = looks.validate({"materials": {"Ball": {"terms": terms}}}, self._transfer.default_look)
        self._picture.set_look(look)
        self._picture.prepare("/materials/Ball/terms/1/curves/theta_h")
        while not self._picture.advance(None).exact or self._picture.next_job() is not None:
            self._picture.run_next_job(lambda share: None, lambda: False)
        return self._picture.image().astype(np.float64)


def term_of(model: str, params: dict[str, float], drawn: Any = None) -> dict[str, Any]:
    """A highlight as it stands in a look."""
    curves = {} if drawn is None else {"theta_h": drawn}
    return {"model": model, "color": [0.9, 0.8, 0.7], "texture": None, "params": params, "curves": curves}


def bands_of(term: dict[str, Any]) -> NDArray[np.float64]:
    """Its curve over the half angle. (3, 256)"""
    return curve_bands(term, TERMS[term["model"]].curve("theta_h"))


CASES = [
    ("cook_torrance", {"Roughness σ": 0.0079}, {"sigma": 0.0079, "ior": 1.8}),
    ("ggx", {"Roughness": 0.05}, {"roughness": 0.05}),
    ("ggx", {"Roughness": 0.245}, {"roughness": 0.245}),
]


@pytest.mark.slow
def test_points_that_are_touched_change_nothing_and_a_nudge_no_more_than_its_share(
    curve: CurvePage, server: Server
) -> None:
    painter = Painter(server)
    middles = (np.arange(256) + 0.5) * (90 / 256)
    for (model, sliders, params), log in zip(CASES, (False, True, False), strict=True):
        curve.page.get_by_label("Model").first.select_option(model)
        curve.open(sliders, log)
        plain = term_of(model, params)
        before, image = bands_of(plain), painter.paint(plain)
        pixels, places = curve.editor.pixels(), curve.shown()
        steps = curve.page.locator(".tile.step").count()
        for point in curve.points.all():
            point.locator(".mark").click(force=True)
        curve.page.keyboard.press("Escape")
        curve.points.first.focus()
        for _ in places:
            curve.page.keyboard.press("Tab")
        for index in range(len(places)):
            curve.value(index).focus()
        assert curve.said() == []
        assert changed(pixels, curve.editor.pixels()) == 0
        expect(curve.page.locator(".tile.step")).to_have_count(steps)

        angles = [float(place.split()[0]) for place in places if place is not None]
        values = [float(point.get_attribute("aria-valuenow") or "nan") for point in curve.points.all()]
        for index in sorted({0, 1, len(values) // 2, len(values) - 2, len(values) - 1}):
            if values[index] == 0:
                continue
            curve.type_value(index, values[index] * (1 + NUDGE))
            *_, drawn = curve.said()
            nudged = term_of(model, params, drawn)
            after = bands_of(nudged)
            assert (np.abs(after - before) <= NUDGE * 1.02 * before).all()  # a value has six digits
            low = angles[index - 1] if index > 0 else 0.0
            high = angles[index + 1] if index + 1 < len(angles) else 90.0
            beyond = (middles < low - 0.01) | (middles > high + 0.01)
            np.testing.assert_array_equal(after[:, beyond], before[:, beyond])
            if index in (0, len(values) - 2):
                change = np.abs(painter.paint(nudged) - image)
                # rays of a narrow lobe follow its curve, and some meet another texel
                assert np.mean(change > NUDGE * 1.02 * image + ROUNDING * image.max()) < RESAMPLED
            shown = curve.shown()
            assert [*shown[:index], *shown[index + 1 :]] == [*places[:index], *places[index + 1 :]]
            curve.page.keyboard.press("Control+z")
            assert curve.said() == [None]
        assert curve.shown() == places


@pytest.mark.slow
def test_all_tools_change_what_they_touch_and_a_reload_keeps_the_points(curve: CurvePage) -> None:
    page, params = curve.page, {"sigma": 0.05, "ior": 1.8}
    plain = bands_of(term_of("cook_torrance", params))
    middles = (np.arange(256) + 0.5) * (90 / 256)

    def bands() -> NDArray[np.float64]:
        """After the last edit."""
        *_, drawn = curve.said()
        return bands_of(term_of("cook_torrance", params, drawn))

    def unchanged(after: NDArray[np.float64], low: float, high: float) -> None:
        """Outside a stretch."""
        beyond = (middles < low - 0.01) | (middles > high + 0.01)  # said with two digits
        np.testing.assert_array_equal(after[:, beyond], plain[:, beyond])
        assert (after[:, ~beyond] != plain[:, ~beyond]).any()

    curve.open({"Roughness σ": 0.05}, log=False)
    offered = curve.shown()
    point = curve.points.nth(2)
    low, high = (float((offered[k] or "").split()[0]) for k in (1, 3))
    box = point.locator(".mark").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 6, y - 40, steps=8)
    page.mouse.up()
    unchanged(bands(), low, high)
    moved = curve.shown()
    assert [a == b for a, b in zip(moved, offered, strict=True)].count(False) == 1
    page.get_by_role("button", name="Add point in the widest gap").click()
    unchanged(bands(), low, high)
    added = curve.shown()
    assert len(added) == len(offered) + 1

    pixels = curve.editor.pixels()
    page.reload()
    curve.points.first.wait_for(timeout=WAIT_MS)
    expect(curve.points).to_have_count(len(added))
    assert changed(pixels, curve.editor.pixels()) == 0
    assert curve.shown() == added
    page.evaluate(LISTEN)
    point.focus()
    page.keyboard.press("r")
    np.testing.assert_array_equal(bands(), plain)
    page.keyboard.press("Delete")
    np.testing.assert_array_equal(bands(), plain)

    page.get_by_role("button", name="R", exact=True).click()
    curve.points.nth(1).focus()
    page.keyboard.press("PageUp")
    after = bands()
    np.testing.assert_array_equal(after[1:], plain[1:])
    assert (after[0] != plain[0]).any()
    page.get_by_role("button", name="RGB", exact=True).click()
    page.get_by_role("button", name="Reset", exact=True).click()
    assert curve.said() == [None]
    assert curve.shown() == offered

    page.keyboard.press("d")
    curve.drag_in_plot((0.5, 0.5), (0.7, 0.3))
    # the axis is that of the root of the angle, between margins of 40 and 10 pixels
    width = page.locator(".plot svg").bounding_box()["width"]
    ends = [90 * ((share * width - 40) / (width - 50)) ** 2 for share in (0.5, 0.7)]
    unchanged(bands(), ends[0] - 0.5, ends[1] + 0.5)
    page.keyboard.press("Control+z")
    page.keyboard.press("t")
    curve.drag_in_plot((0.3, 0.5), (0.4, 0.5))
    curve.said()
    page.get_by_role("button", name="×1.1").click()
    ends = [90 * ((share * width - 40) / (width - 50)) ** 2 for share in (0.3, 0.4)]
    scaled = bands()
    unchanged(scaled, ends[0] - 0.5, ends[1] + 0.5)
    inner = (middles > ends[0] + 0.5) & (middles < ends[1] - 0.5)
    np.testing.assert_allclose(scaled[:, inner], 1.1 * plain[:, inner], rtol=1e-8)
