"""Images as inputs of surface models, and their pixels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_encode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, unsupported, with_subject
from relume.image_io.decode import MAX_SIDE, Decoder
from relume.image_io.read_linear import EXR_MAGIC, read_pixels
from relume.math.uv_transform import UvTransform
from relume.scene.texture_encoding import SRGB_TO_LINEAR
from relume.scene_io.surfaces.uv_transforms import UvSet

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Pixels = U8 | F32
Encoding = Literal["srgb", "linear", "normal"]
CHANNELS = "rgba"
HDR_MAGIC = b"#?"
UDIM, FIRST_TILE = "<UDIM>", "1001"
_CACHE_BYTES = 300_000_000  # of decoded images, which other materials may use
_LEVELS: F32 = (np.arange(256) / 255).astype(np.float32)


@dataclass(frozen=True)
class ImageInput:
    """An image times a factor plus a bias, both of linear values.

    Attributes:
        file: as the document names it.
        channel: "r", "g", "b" or "a" of a number; "rgb" of a color or a vector.
        is_srgb: colors are in sRGB, otherwise linear; None if their use decides, sRGB for colors. Alpha is linear.
        factor, bias: of the values; of a number, three equal ones.
        wrap: as in `relume.scene.model.Texture`. is_black_outside: the file is black outside its bounds instead.
        uv_set: set of UV coordinates. transform: of these with v from the top, as in glTF.
        default: value if the file is missing; None for the default of the surface's input.
    """

    file: str
    channel: str = "rgb"
    is_srgb: bool | None = False
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wrap: tuple[str, str] = ("repeat", "repeat")
    is_black_outside: bool = False
    uv_set: UvSet = "st"
    transform: UvTransform = field(default_factory=UvTransform)
    default: tuple[float, float, float] | None = None


class DocumentFiles(Protocol):
    """The image files of a document, by the names that it has for them."""

    def read(self, file: str, label: str) -> bytes | None:
        """Contents of a file; None, with a warning, if it is missing. label: names the image in warnings."""
        ...

    def printable_name(self, file: str) -> str:
        """The name of a file for messages."""
        ...


class SurfaceImages:
    """Decodes the images of one document, with a cache; an image that cannot be used is one warning.

    Attributes:
        files: of the document.
    """

    def __init__(self, files: DocumentFiles, warnings: list[ImporterWarning]) -> None:
        """
        Args:
            files: of the document. warnings: gets a sentence for each image that is damaged.
        """
        self.files, self._warnings = files, warnings
        self._decoder = Decoder()
        self._pixels: dict[str, Pixels | None] = {}

    def pixels(self, file: str, label: str) -> Pixels | None:
        """RGBA bytes of a file as they are, or linear RGB of an .exr or .hdr file; None if it cannot be used.

        Args:
            file: name in the document. label: names the image in messages, such as "base color of …".
        """
        if file in self._pixels:
            self._pixels[file] = self._pixels.pop(file)  # most recently used last
        else:
            self._pixels[file] = self._decode(file, label)
            while (
                len(self._pixels) > 1 and sum(p.nbytes for p in self._pixels.values() if p is not None) > _CACHE_BYTES
            ):
                del self._pixels[next(iter(self._pixels))]
        return self._pixels[file]

    def mean(self, image: ImageInput, label: str) -> Shaped[F64, " 3"]:
        """Mean of an image that can be used: three linear numbers."""
        pixels = self.pixels(image.file, label)
        assert pixels is not None
        means = [mean_of_channel(pixels, CHANNELS.index(name), image.is_srgb) for name in image.channel]
        return np.asarray(np.array(means) * image.factor + image.bias)

    def _decode(self, file: str, label: str) -> Pixels | None:
        data = self.files.read(file, label)
        if data is None:
            return None
        name = self.files.printable_name(file)
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


def encode_channel(pixels: Pixels, image: ImageInput, number: int, encoding: Encoding) -> Shaped[U8, "height width"]:
    """Bytes of one channel of an image times its factor plus its bias, clamped to [0, 1] or, of normals, [-1, 1].

    Args:
        pixels: of the image. number: which of its channels, from 0. encoding: of the bytes.
    """
    source = CHANNELS.index(image.channel[min(number, len(image.channel) - 1)])
    factor, bias = np.float32(image.factor[number]), np.float32(image.bias[number])

    def encode(linear: F32) -> U8:
        values = linear * factor + bias
        if encoding != "linear":
            values = srgb_encode(values) if encoding == "srgb" else (values + 1) / 2
        return np.asarray(np.round(255 * np.clip(values, 0, 1)), np.uint8)

    if pixels.dtype != np.uint8:
        return encode(_floats(pixels, source))
    return np.asarray(encode(_table(image.is_srgb, source))[pixels[..., source]])


def first_tile(name: str, warnings: list[ImporterWarning]) -> str:
    """The name of an image; of UDIM tiles that of the first, with a warning.

    Args:
        name: as the document has it. warnings: gets the warning.
    """
    if UDIM not in name:
        return name
    warnings.append(unsupported(f"Of the tiles of “{name[:80]}”, only the first is shown."))
    return name.replace(UDIM, FIRST_TILE)


def mean_of_channel(pixels: Pixels, channel: int, is_srgb: bool | None) -> float:
    """Linear mean of a channel.

    Args:
        pixels: of an image. channel: from 0. is_srgb: the bytes are in sRGB.
    """
    if pixels.dtype != np.uint8:
        return float(np.minimum(_floats(pixels, channel), 1).mean(dtype=np.float64))
    counts = np.bincount(pixels[..., channel].ravel(), minlength=256)
    return float(counts @ _table(is_srgb, channel).astype(np.float64) / counts.sum())


def _table(is_srgb: bool | None, channel: int) -> Shaped[F32, " 256"]:
    """Linear value of each byte of a channel."""
    return np.asarray(SRGB_TO_LINEAR if is_srgb and channel < 3 else _LEVELS, np.float32)


def _floats(pixels: Pixels, channel: int) -> Shaped[F32, "height width"]:
    """A channel of an image without bytes; 1 for alpha, which it does not have."""
    has_channel = channel < pixels.shape[2]
    return np.asarray(pixels[..., channel] if has_channel else np.ones(pixels.shape[:2]), np.float32)


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise SceneError(f"it is {width}×{height}; at most {MAX_SIDE}×{MAX_SIDE} is read, scale it down")
