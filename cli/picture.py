"""Writes pictures that commands made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from relume.errors import ParameterError

FORMATS = (".exr", ".png", ".webp")


def check_output(path: Path) -> None:
    """Raise ParameterError before hours of work where the picture could not be written."""
    if path.suffix.lower() not in FORMATS:
        raise ParameterError("--output", path.name, f"a file name that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise ParameterError("--output", str(path), "a file in a folder that exists")


def save(path: Path, image: NDArray[Any], look: Any) -> None:
    """Write linear radiance, (H, W, 3); formats for the screen are shown as the look's display says."""
    from relume.imageio import write_image

    write_image(path, image, look.display.exposure, look.display.tone_map)
