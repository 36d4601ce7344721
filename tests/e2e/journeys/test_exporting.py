"""Pictures to take away: a name that says what they are, layers, progress, and an end of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from editor_page import WAIT_MS, Editor
from editor_server import SIZE
from playwright.sync_api import expect


@pytest.mark.slow
def test_exr_is_called_like_the_png_has_layers_and_can_be_stopped(editor: Editor, tmp_path: Path) -> None:
    page = editor.page
    page.get_by_role("button", name="Add light", exact=True).first.click()
    page.get_by_role("button", name="Point", exact=True).click()
    page.get_by_role("button", name="Place in center").click()
    editor.wait_until_exact()
    exr, bar = page.get_by_role("button", name="EXR", exact=True), page.get_by_role("progressbar", name="EXR")
    with page.expect_download(timeout=WAIT_MS) as download:
        exr.click()
    assert download.value.suggested_filename == "still-life-front.exr"
    path = tmp_path / "picture.exr"
    download.value.save_as(path)
    picture = OpenImageIO.ImageBuf(str(path))
    channels, pixels = picture.spec().channelnames, picture.get_pixels(OpenImageIO.FLOAT)
    assert pixels.shape[1::-1] == SIZE
    (light,) = {name.partition(".")[0] for name in channels if name.startswith("light_")} - {"light_environment"}
    red = {name: pixels[..., k] for k, name in enumerate(channels)}
    parts = red["light_environment.R"] + red[f"{light}.R"]
    np.testing.assert_allclose(parts, red["R"], rtol=2e-3, atol=1e-4)
    assert red[f"{light}.R"].max() > 0.01
    expect(bar).to_have_count(0)

    page.get_by_role("button", name="More export formats").press("Enter")
    with page.expect_download(timeout=WAIT_MS) as download:
        page.get_by_role("button", name="EXR with light groups").press("Enter")
    download.value.save_as(path)
    layers = {name.partition(".")[0] for name in OpenImageIO.ImageBuf(str(path)).spec().channelnames}
    assert layers == {"R", "G", "B", "light_environment_direct", f"{light}_direct"}

    page.get_by_role("button", name="More export formats").press("Enter")
    with page.expect_download(timeout=WAIT_MS) as download:
        page.get_by_role("button", name="EXR, beauty only").press("Enter")
    download.value.save_as(path)
    assert OpenImageIO.ImageBuf(str(path)).spec().channelnames == ("R", "G", "B")

    # a server that has much to do: what it says of the render goes on being half done
    page.route(
        "**/api/renders/*",
        lambda route: (
            route.fulfill(json={"id": "a", "state": "running", "progress": 0.5, "problem": None})
            if route.request.method == "GET"
            else route.fulfill(status=204)
        ),
    )
    exr.click()
    expect(bar).to_have_attribute("value", "0.5")
    expect(exr).to_be_disabled()
    with page.expect_request(lambda request: request.method == "DELETE" and "/api/renders/" in request.url):
        page.get_by_role("button", name="Stop", exact=True).click()
    expect(bar).to_have_count(0)
    expect(exr).to_be_enabled()
