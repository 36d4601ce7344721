"""Make the pictures of docs/guide/match.md, by the look and the requests on that page; print the answers.

Usage:
    .venv/bin/python scripts/make_match_pictures.py [--data DIR] [--output DIR]

`--data` keeps the data folder with the bake for another time.
"""

from __future__ import annotations

import argparse
import base64
import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from relume import look as looks
from relume.image_io.display_transform import DisplayTransform, to_display
from relume.image_io.write_image import png_bytes, to_bytes
from relume_cli.main import main as relume
from relume_server.api.solve import solve_request
from relume_server.runtime.library import open_library
from relume_server.schemas.solve import SolveRequest

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "guide" / "match.md"
OUTPUT = ROOT / "docs" / "images" / "guide"
SCENE, VIEW = "still_life", "front"
BAKE = ("--method", "gather", "--view", VIEW, "--size", "320x240", "--lights", "200", "--quiet")
CACHE_BYTES = 2 << 30
QUALITY = 88
STROKE_COLORS = {"brighter": (255, 220, 80), "darker": (80, 120, 255)}
U8 = NDArray[np.uint8]


class Example:
    """The still life, the first look of the page, and the answers to its requests."""

    def __init__(self, store: Path, look: dict[str, Any], output: Path) -> None:
        self._library = open_library(CACHE_BYTES, 0)
        self._transfer = self._library.open_transfer(store)
        self._bake, self._output = store.name.split(".")[0], output
        self.look = look

    def solve(self, look: dict[str, Any], **fields: Any) -> dict[str, Any]:
        """The look of the answer to a request; the rest is printed."""
        request = SolveRequest.model_validate({"bake": self._bake, "view": VIEW, "look": look, **fields})
        answer = solve_request(request, self._transfer, self._library).model_dump()
        sys.stdout.write(json.dumps({key: value for key, value in answer.items() if key != "patch"}) + "\n")
        solved: dict[str, Any] = answer["look"]
        return solved

    def picture(self, look: dict[str, Any]) -> U8:
        """Display values of a look."""
        complete = looks.validate(look, self._transfer.default_look)
        radiance = self._library.render(self._transfer, VIEW, complete)
        return to_bytes(to_display(radiance[..., :3], DisplayTransform(complete.display.exposure)))

    def save(self, name: str, *pictures: U8) -> None:
        """Save pictures side by side."""
        Image.fromarray(np.concatenate(pictures, axis=1)).save(self._output / f"match-{name}.jpg", quality=QUALITY)


def drawn(picture: U8, *requests: dict[str, Any]) -> U8:
    """The picture with the strokes of requests over it."""
    image = Image.fromarray(picture)
    overlay = Image.new("RGBA", image.size)
    draw = ImageDraw.Draw(overlay)
    for stroke in (stroke for request in requests for stroke in request["strokes"]):
        linear = tuple(round(255 * value ** (1 / 2.2)) for value in stroke.get("color", ()))
        fill = (*STROKE_COLORS.get(stroke["kind"], linear), 160)
        points, radius = [tuple(point) for point in stroke["points"]], stroke["radius"]
        draw.line(points, fill, width=2 * radius)
        for x, y in points:
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill)
    return np.asarray(Image.alpha_composite(image.convert("RGBA"), overlay).convert("RGB"))


def make_pictures(example: Example, documents: list[dict[str, Any]]) -> None:
    """Solve the requests of the page, and save their pictures."""
    brighter, darker, evening, material, light = documents
    before = example.picture(example.look)

    first = example.solve(example.look, **brighter)
    second = example.solve(first, **darker)
    pictures = [example.picture(look) for look in (first, second)]
    example.save("strokes", before, drawn(before, brighter, darker), *pictures)

    lights = {name: {**fields, **evening["lights"][name]} for name, fields in example.look["lights"].items()}
    reference = example.picture({**example.look, **evening, "lights": lights})
    solved = example.solve(example.look, reference={"image": base64.b64encode(png_bytes(reference))})
    example.save("reference", before, reference, example.picture(solved))

    pictures = [example.picture(example.solve(example.look, **request)) for request in (material, light)]
    example.save("color", before, drawn(before, material, light), *pictures)


def page_documents() -> list[dict[str, Any]]:
    """The look and the requests of the page, in order."""
    return [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)]


def main() -> None:
    """Bake the scene, and make the pictures."""
    parser = argparse.ArgumentParser(description="Make the pictures of docs/guide/match.md.")
    parser.add_argument("--data", type=Path, help="data folder; default: a temporary one")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the pictures")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        data = arguments.data or Path(temporary)
        if not list(data.glob("bakes/*.zarr")):
            relume(["import", "--built-in", SCENE, "--quiet", "--data", str(data)])
            relume(["bake", SCENE, *BAKE, "--data", str(data)])
        look, *requests = page_documents()
        make_pictures(Example(next(data.glob("bakes/*.zarr")), look, arguments.output), requests)


if __name__ == "__main__":
    main()
