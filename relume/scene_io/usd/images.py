"""Images of USD shaders as RGBA bytes in the layout of glTF textures.

A glTF texture is one image with fixed meanings of its channels; shaders of USD take each channel from an image of its
own, with a color space, scale and bias. The bytes are made here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode, srgb_encode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, unsupported, with_subject
from relume.image_io.decode import MAX_SIDE, Decoder
from relume.image_io.read_linear import EXR_MAGIC, read_pixels
from relume.scene.model import Texture, TextureEncoding
from relume.scene.texture_encoding import mean_value
from relume.scene_io.obj_ply.material_maker import printable
from relume.scene_io.usd.layers import LayerFolder
from relume.scene_io.usd.networks import Sample

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
Meaning = Literal["color", "data", "normal"]
HDR_MAGIC = b"#?"
UDIM, FIRST_TILE = "<UDIM>", "1001"
_CACHE_BYTES = 300_000_000  # of decoded images, which other materials may use


@dataclass(frozen=True)
class ImageChannel:
    """A channel of an image of the file; None for the sample is white."""

    sample: Sample | None
    number: int = 0


@dataclass(frozen=True)
class TextureRecipe:
    """A texture: its four channels, and the meaning of the first three."""

    channels: tuple[ImageChannel, ImageChannel, ImageChannel, ImageChannel]
    meaning: Meaning

    @property
    def samples(self) -> list[Sample]:
        """Images that it needs."""
        return list(dict.fromkeys(channel.sample for channel in self.channels if channel.sample is not None))


class UsdImages:
    """Makes the textures of one file, by number, from its images; each is decoded at most once while it is in use."""

    def __init__(self, layers: LayerFolder, warnings: list[ImporterWarning]) -> None:
        self._layers, self._warnings = layers, warnings
        self._decoder = Decoder()
        self._decoded: dict[str, U8 | F32] = {}
        self._unusable: set[str] = set()
        self._recipes: list[TextureRecipe] = []

    def add(self, recipe: TextureRecipe) -> int:
        """Return the number of a texture."""
        self._recipes.append(recipe)
        return len(self._recipes) - 1

    def is_usable(self, index: int, label: str) -> bool:
        """True: an image that cannot be read is white, with a warning."""
        return True

    def texture(self, index: int, label: str) -> tuple[Shaped[U8, "height width 4"], tuple[str, str]]:
        """Return the RGBA bytes of a texture, and its wrap modes along u and v."""
        recipe = self._recipes[index]
        loaded = {sample: self.load(sample.asset, label) for sample in recipe.samples}
        sources = {sample: pixels for sample, pixels in loaded.items() if pixels is not None}
        if not sources:
            return np.full((1, 1, 4), 255, np.uint8), ("repeat", "repeat")
        rows, columns = (max(pixels.shape[axis] for pixels in sources.values()) for axis in (0, 1))
        texture = np.full((rows, columns, 4), 255, np.uint8)
        for slot, channel in enumerate(recipe.channels):
            if channel.sample in sources:
                values = _channel_bytes(sources[channel.sample], channel, recipe.meaning, slot)
                texture[..., slot] = values if values.shape == (rows, columns) else _resize(values, rows, columns)
        return texture, next(iter(sources)).wrap

    def load(self, key: str, label: str) -> U8 | F32 | None:
        """Decode an image: RGBA bytes, or linear RGB of an .exr or .hdr file; None with a warning if it is unusable.

        Args:
            key: of the file in the stage. label: names the texture in warnings.
        """
        if key in self._unusable or key not in self._layers.assets:
            return None
        if key in self._decoded:
            self._decoded[key] = self._decoded.pop(key)  # most recently used last
            return self._decoded[key]
        pixels = self._decode(key, label)
        if pixels is None:
            self._unusable.add(key)
            return None
        self._decoded[key] = pixels
        while len(self._decoded) > 1 and sum(image.nbytes for image in self._decoded.values()) > _CACHE_BYTES:
            del self._decoded[next(iter(self._decoded))]
        return pixels

    def mean_color(self, key: str, label: str) -> Shaped[NDArray[np.float64], " 3"]:
        """Mean linear color of an image; white with a warning if it is unusable."""
        pixels = self.load(key, label)
        if pixels is None:
            return np.ones(3)
        if pixels.dtype != np.uint8:
            return np.asarray(pixels.mean(axis=(0, 1), dtype=np.float64))
        return mean_value(Texture(pixels[..., :3], encoding=TextureEncoding("srgb")))

    def read(self, key: str) -> bytes | None:
        """Read a file; None with a warning if it is missing. Of UDIM tiles, the first."""
        asset = self._layers.assets.get(key)
        if asset is None:
            return None
        if UDIM in asset.name:
            self._warnings.append(unsupported(f"Of the tiles of “{printable(asset.name)}”, only the first is shown."))
            asset = replace(asset, name=asset.name.replace(UDIM, FIRST_TILE))
        return self._layers.read(asset, "image")

    def _decode(self, key: str, label: str) -> U8 | F32 | None:
        data = self.read(key)
        if data is None:
            return None
        name = printable(self._layers.assets[key].name)
        try:
            if not data.startswith((EXR_MAGIC, HDR_MAGIC)):
                return self._decoder.decode(data, label)
            suffix = ".exr" if data.startswith(EXR_MAGIC) else ".hdr"
            values, predicates = read_pixels(data, suffix, label, _check_size)
        except SceneError as error:
            self._warnings.append(unsupported(f"Skipped “{name}”: {error}."))
            return None
        pixels: F32 = np.maximum(np.nan_to_num(values), 0)
        self._warnings += with_subject(f"“{name}”", predicates)
        if pixels.max() > 1:
            self._warnings.append(approximated(f"Values of “{name}” above 1 are clamped in textures."))
        return pixels


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"it is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down")


def _channel_bytes(pixels: U8 | F32, channel: ImageChannel, meaning: Meaning, slot: int) -> Shaped[U8, "height width"]:
    """One channel of a texture from that of an image, whose bytes are sRGB or not."""
    sample, is_color = channel.sample, meaning == "color" and slot < 3
    assert sample is not None
    is_srgb = sample.color_space == "srgb" or (sample.color_space == "auto" and is_color)
    scale, bias = sample.scale[channel.number], sample.bias[channel.number]

    def encode(linear: F32) -> U8:
        value = linear * np.float32(scale) + np.float32(bias)
        if is_color:
            value = srgb_encode(value)
        elif meaning == "normal" and slot < 3:
            value = (value + 1) / 2
        return np.asarray(np.round(255 * np.clip(value, 0, 1)), np.uint8)

    if pixels.dtype != np.uint8:  # linear, without alpha
        has_channel = channel.number < pixels.shape[2]
        values = (
            pixels[..., channel.number].astype(np.float32) if has_channel else np.ones(pixels.shape[:2], np.float32)
        )
        return encode(values)
    levels: F32 = (np.arange(256) / 255).astype(np.float32)
    table = encode(srgb_decode(levels) if is_srgb and channel.number < 3 else levels)
    return np.asarray(table[pixels[..., channel.number]])


def _resize(values: Shaped[U8, "height width"], rows: int, columns: int) -> Shaped[U8, "rows columns"]:
    image = PIL.Image.fromarray(np.ascontiguousarray(values))
    return np.asarray(image.resize((columns, rows), PIL.Image.Resampling.BILINEAR))
