"""Choice of the part and the channels of an image that show its colors.

OpenEXR files have parts, and names of channels have layers: `R` is red, `beauty.R` or `ViewLayer.Combined.R` red of a
layer.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import OpenImageIO as oiio  # noqa: N813  (the name its own documentation gives it)

from relume.core.errors import SceneError
from relume.core.import_warnings import quote

MAX_PARTS = 256
_COLORS = {"R": "R", "RED": "R", "G": "G", "GREEN": "G", "B": "B", "BLUE": "B"}
_LUMINANCES = ("Y", "L", "GRAY", "R")  # without G or X
_BEAUTY_LAYERS = {"rgba", "rgb", "beauty", "combined", "color", "c"}
_MAX_LISTED = 8


class ColorChannels(NamedTuple):
    """The channels that show the colors of an image.

    Attributes:
        part: index of the part. spec: its header.
        indices: of red, green and blue in the part, or one of its luminance.
        layer: name of the layer; empty for channels without one.
        num_layers: number of layers with colors, in all parts.
    """

    part: int
    spec: oiio.ImageSpec
    indices: tuple[int, ...]
    layer: str
    num_layers: int


def find_color_channels(image: oiio.ImageInput, label: str) -> ColorChannels:
    """Find the first part with red, green and blue; if there is none, the first with a luminance.

    Args:
        image: an open image; its current part may change. label: name of the file in messages.
    Raises:
        SceneError: no part shows colors.
    """
    parts = list(_flat_parts(image))
    for find in (_rgb_layers, _gray_layers):
        candidates = [(part, spec, layers) for part, spec in parts if (layers := find(spec.channelnames))]
        if candidates:
            part, spec, layers = candidates[0]
            layer = min(layers, key=_precedence)
            return ColorChannels(part, spec, layers[layer], layer, sum(len(layers) for *_, layers in candidates))
    raise _no_colors(parts, label)


def _flat_parts(image: oiio.ImageInput) -> Iterable[tuple[int, oiio.ImageSpec]]:
    for part in range(MAX_PARTS):
        if not image.seek_subimage(part, 0):
            return
        spec = image.spec()
        if spec.depth == 1 and not spec.deep:
            yield part, spec


def _rgb_layers(names: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Layers with red, green and blue, in the order of the file, and the indices of these channels."""
    layers: dict[str, dict[str, int]] = {}
    for index, name in enumerate(names):
        layer, _, channel = name.rpartition(".")
        if channel.upper() in _COLORS:
            layers.setdefault(layer, {}).setdefault(_COLORS[channel.upper()], index)
    return {layer: (found["R"], found["G"], found["B"]) for layer, found in layers.items() if len(found) == 3}


def _gray_layers(names: Sequence[str]) -> dict[str, tuple[int, ...]]:
    split_names = [name.upper().rpartition(".") for name in names]
    vectors = {layer for layer, _, channel in split_names if channel in ("G", "GREEN", "X")}
    return {
        name.rpartition(".")[0]: (index,)
        for index, (name, (layer, _, channel)) in enumerate(zip(names, split_names, strict=True))
        if channel in _LUMINANCES and layer not in vectors
    }


def _precedence(layer: str) -> int:
    """No layer comes first, then one whose name says that it is the complete image."""
    if not layer:
        return 0
    return 1 if _BEAUTY_LAYERS & set(layer.lower().split(".")) else 2


def _no_colors(parts: Sequence[tuple[int, oiio.ImageSpec]], label: str) -> SceneError:
    if not parts:
        return SceneError(f"{label} is deep or a volume; flatten it and save it as plain RGB")
    names = [quote(name) for _, spec in parts for name in spec.channelnames]
    more = " …" if len(names) > _MAX_LISTED else ""
    return SceneError(
        f"{label} has no channels R, G and B, only {', '.join(names[:_MAX_LISTED])}{more}; save its colors as plain RGB"
    )
