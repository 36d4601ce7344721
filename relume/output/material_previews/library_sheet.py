"""Prerendered previews of the material library: one atlas image in the package, one tile per material.

Rendering one preview takes half a second, and there are hundreds, too slow for browsing the library.
`python -m relume.output.material_previews.library_sheet` renders all of them again; run it when the materials or the
lighting of previews change.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from PIL import Image

from relume.brdf.term_validation import complete_term
from relume.image_io.write_image import png_bytes
from relume.look.library import Preset, presets
from relume.output.material_previews.preview import THUMBNAIL_SIZE, preview_pixels

ATLAS = Path(__file__).with_name("balls.webp")
_NUM_COLUMNS = 32  # previews per row
_QUALITY = 90


def library_preview_png(identity: str) -> bytes | None:
    """Preview of a library material as a PNG; None if the library has no such material."""
    index = _indices().get(identity)
    return None if index is None else png_bytes(_tile(index))


def render(preset: Preset) -> Shaped[NDArray[np.uint8], "size size 3"]:
    """Render the preview of a material, of `THUMBNAIL_SIZE`, for the atlas."""
    return preview_pixels([complete_term(("library", k), term, None) for k, term in enumerate(preset.terms)])


def write(path: Path, previews: Sequence[NDArray[np.uint8]]) -> None:
    """Write previews into one atlas image, row by row."""
    size, rows = THUMBNAIL_SIZE, -(-len(previews) // _NUM_COLUMNS)
    atlas = np.zeros((rows * size, _NUM_COLUMNS * size, 3), np.uint8)
    for index, preview in enumerate(previews):
        row, column = divmod(index, _NUM_COLUMNS)
        atlas[row * size : (row + 1) * size, column * size : (column + 1) * size] = preview
    Image.fromarray(atlas).save(path, "WEBP", quality=_QUALITY, method=6)


@cache
def _indices() -> dict[str, int]:
    return {preset.id: index for index, preset in enumerate(presets())}


@cache
def _atlas() -> NDArray[np.uint8]:
    with Image.open(ATLAS) as image:
        return np.asarray(image.convert("RGB"))


def _tile(index: int) -> NDArray[np.uint8]:
    row, column = divmod(index, _NUM_COLUMNS)
    size = THUMBNAIL_SIZE
    return _atlas()[row * size : (row + 1) * size, column * size : (column + 1) * size]


def main() -> None:
    """Render all previews and write the atlas."""
    library_presets, previews = presets(), []
    for count, preset in enumerate(library_presets, 1):
        previews.append(render(preset))
        sys.stderr.write(f"\r{count} of {len(library_presets)}")
    write(ATLAS, previews)
    sys.stderr.write("\n")


if __name__ == "__main__":
    main()
