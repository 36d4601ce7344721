"""Contact sheet: many images in one, each with its name below."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import OpenImageIO
from PIL import Image, ImageDraw, ImageFont

from relume.core.errors import CancelledError
from relume.core.filesystem import atomic_write

MAX_IMAGES = 400
CELL_WIDTH = 320
GAP = 12
LABEL_HEIGHT = 24
CELL_BYTES = 3 * (CELL_WIDTH + GAP) * (CELL_WIDTH + LABEL_HEIGHT + GAP)
"""Upper bound of the size of one cell."""
_FONT_SIZE = 14
_PAPER, _INK = (32, 32, 32), (230, 230, 230)
_MAX_LABEL = 400  # characters; more do not fit into a cell


def write_contact_sheet(
    images: Sequence[Path], labels: Sequence[str], path: Path, is_canceled: Callable[[], bool] = lambda: False
) -> None:
    """Write a PNG with all images in rows, in a grid of about as many rows as columns.

    Images are at most `CELL_WIDTH` wide and high, and keep their aspect ratios; transparent ones show the paper.

    Args:
        images: 1 to `MAX_IMAGES` files. labels: one per image; shortened with an ellipsis to the cell's width.
        path: file to write. is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true. RelumeError: the file cannot be written.
    """
    thumbnails = []
    for image in images:
        if is_canceled():
            raise CancelledError("the contact sheet was stopped")
        thumbnails.append(_thumbnail(image))
    sheet = _arrange(thumbnails, labels)
    with atomic_write(path) as file:
        sheet.save(file)


def _thumbnail(path: Path) -> Image.Image:
    with Image.open(path) as image:
        image.thumbnail((CELL_WIDTH, CELL_WIDTH), Image.Resampling.BOX)
        rgba = image.convert("RGBA")
    paper = Image.new("RGBA", rgba.size, (*_PAPER, 255))
    return Image.alpha_composite(paper, rgba).convert("RGB")


def _arrange(thumbnails: Sequence[Image.Image], labels: Sequence[str]) -> Image.Image:
    num_columns = math.ceil(math.sqrt(len(thumbnails)))
    num_rows = math.ceil(len(thumbnails) / num_columns)
    width = max(image.width for image in thumbnails)
    height = max(image.height for image in thumbnails)
    column, row = width + GAP, height + LABEL_HEIGHT + GAP
    sheet = Image.new("RGB", (GAP + num_columns * column, GAP + num_rows * row), _PAPER)
    draw, font = ImageDraw.Draw(sheet), _load_font()
    for index, (image, label) in enumerate(zip(thumbnails, labels, strict=True)):
        x, y = GAP + index % num_columns * column, GAP + index // num_columns * row
        sheet.paste(image, (x, y))
        draw.text((x, y + height + 4), _fitting(label, width, font), _INK, font)
    return sheet


def _load_font() -> ImageFont.FreeTypeFont:
    """Return a font of the system with many alphabets, or OpenImageIO's with Western European letters."""
    folder = Path(OpenImageIO.__file__).parent / "share" / "fonts" / "OpenImageIO"
    for name in ("DejaVuSans.ttf", "Arial.ttf"):
        with suppress(OSError):
            return ImageFont.truetype(name, _FONT_SIZE)
    return ImageFont.truetype(str(folder / "DroidSans.ttf"), _FONT_SIZE)


def _fitting(label: str, width: int, font: ImageFont.FreeTypeFont) -> str:
    """Shorten a label to a width in pixels; letters that the font does not have become question marks."""
    text = " ".join(label[:_MAX_LABEL].split())
    text = "".join(c if c == " " or font.getmask(c).getbbox() is not None else "?" for c in text)
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."
