"""Export of an image and its layers to one OpenEXR file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.image_io.exr_writer import MAX_HALF, Attributes, Precision, image_channels, write_exr
from relume.look import Look
from relume.output.exr.color_space import REC_709_SPACE, ExportColorSpace
from relume.output.exr.layers import Layer

Progress = Callable[[float], None]
Render = Callable[[Look, Progress], NDArray[np.float32]]
"""Renders a look, (height, width, 3) or with alpha (height, width, 4), and reports the finished fraction."""


def export_exr(
    path: Path,
    render: Render,
    look: Look,
    layers: Sequence[Layer],
    attributes: Attributes,
    precision: Precision = "half",
    progress: Progress = lambda share: None,
    space: ExportColorSpace = REC_709_SPACE,
) -> None:
    """Render a look and its layers sequentially, and write them; no more than one image is in memory.

    Args:
        path: path of the file, which appears only when it is complete; layers are stored beside it until then.
        render: renders a look, (height, width, 3 or 4); gets a callback for its progress.
        look: look of the image itself. layers: named looks, whose images become layers of the file.
        attributes: attributes of the file, from `build_attributes`.
        precision: float type of the values.
        progress: called with the finished fraction, in [0, 1].
        space: color space of the values, as in `attributes`.
    Raises:
        RelumeError: the file cannot be written. Errors of `render` propagate; then there is no file.
    """
    renders = [("", look), *((layer.name, layer.look) for layer in layers)]
    with tempfile.TemporaryDirectory(prefix=".layers-", dir=path.parent) as folder:
        channels: list[tuple[str, NDArray[np.floating]]] = []
        for k, (name, layer_look) in enumerate(renders):

            def report_progress(fraction: float, k: int = k) -> None:
                progress((k + fraction) / len(renders))

            image = space.convert_image(render(layer_look, report_progress))
            image = image[..., :3] if name else image  # only the image itself has alpha
            channels += image_channels(_save_as_memmap(Path(folder) / f"{k}.npy", image, precision), name)
        write_exr(path, channels, attributes, precision)


def _save_as_memmap(path: Path, image: NDArray[np.float32], precision: Precision) -> NDArray[np.floating]:
    """Save an image in the output precision, and map the file into memory."""
    pixels = np.minimum(image, MAX_HALF).astype(np.float16) if precision == "half" else image
    np.save(path, pixels, allow_pickle=False)
    return np.load(path, mmap_mode="r", allow_pickle=False)  # type: ignore[no-any-return]
