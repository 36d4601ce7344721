"""Export of an image and its layers to one OpenEXR file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.image_io.exr_writer import MAX_HALF, Attributes, Precision, image_channels, write_exr
from relume.look import Look
from relume.output.exr.aovs import AovTracer
from relume.output.exr.color_space import REC_709_SPACE, ExportColorSpace
from relume.output.exr.layers import Layer
from relume.scene.model import Camera

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
    aovs: AovPass | None = None,
) -> None:
    """Render a look and its layers sequentially, and write them; no more than one image is in memory.

    Args:
        path: path of the file, which appears only when it is complete; layers are stored beside it until then.
        render: renders a look, (height, width, 3 or 4); gets a callback for its progress.
        look: look of the image itself. layers: named looks, whose images become layers of the file.
        attributes: attributes of the file, from `build_attributes`.
        precision: float type of the values.
        progress: called with the finished fraction, in [0, 1].
        space: color space of the values, as in `attributes`. AOVs are in it too, apart from geometry and ids.
        aovs: AOVs of the image, with 32-bit floats; None for none.
    Raises:
        RelumeError: the file cannot be written. Errors of `render` propagate; then there is no file.
    """
    renders = [("", look), *((layer.name, layer.look) for layer in layers)]
    num_passes = len(renders) + (aovs is not None)
    with tempfile.TemporaryDirectory(prefix=".layers-", dir=path.parent) as folder:
        channels: list[tuple[str, NDArray[np.floating]]] = []
        for k, (name, layer_look) in enumerate(renders):

            def report_progress(fraction: float, k: int = k) -> None:
                progress((k + fraction) / num_passes)

            image = space.convert_image(render(layer_look, report_progress))
            image = image[..., :3] if name else image  # only the image itself has alpha
            channels += image_channels(_save_as_memmap(Path(folder) / f"{k}.npy", image, precision), name)
        if aovs is None:
            write_exr(path, channels, attributes, precision)
            return
        aov_channels = aovs.trace(Path(folder), space)
        progress(1.0)
        attributes = {**attributes, **aovs.tracer.attributes}
        write_exr(path, [*channels, *aov_channels.items()], attributes, precision, aov_channels)


@dataclass(frozen=True)
class AovPass:
    """AOVs of one image: what traces them, its camera, and its width and height in pixels."""

    tracer: AovTracer
    camera: Camera
    size: tuple[int, int]

    def trace(self, folder: Path, space: ExportColorSpace) -> dict[str, NDArray[np.float32]]:
        """Trace the channels into files, which are memory-mapped; by name, (height, width)."""
        channels = dict[str, NDArray[np.float32]]()
        for rows, band in self.tracer.bands(self.camera, self.size):
            for layer in ("albedo", "emission"):
                names = [f"{layer}.{channel}" for channel in "RGB"]
                converted = space.convert_image(np.stack([band[name] for name in names], axis=-1))
                band |= {name: converted[..., channel] for channel, name in enumerate(names)}
            for number, (name, values) in enumerate(band.items()):
                if name not in channels:
                    channels[name] = np.lib.format.open_memmap(
                        folder / f"aov-{number}.npy", "w+", np.float32, self.size[::-1]
                    )
                channels[name][rows] = values
        return channels


def _save_as_memmap(path: Path, image: NDArray[np.float32], precision: Precision) -> NDArray[np.floating]:
    """Save an image in the output precision, and map the file into memory."""
    pixels = np.minimum(image, MAX_HALF).astype(np.float16) if precision == "half" else image
    np.save(path, pixels, allow_pickle=False)
    return np.load(path, mmap_mode="r", allow_pickle=False)  # type: ignore[no-any-return]
