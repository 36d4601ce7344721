"""The textures of one material: channels of its images, packed for glTF's layout, at common UV coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
import PIL.Image
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated
from relume.scene.textured_vertex_colors import TexturedColors
from relume.scene_io.surfaces.surface_images import (
    CHANNELS,
    U8,
    Encoding,
    ImageInput,
    Pixels,
    encode_channel,
    mean_of_channel,
)
from relume.scene_io.surfaces.surface_inputs import Color, Scalar
from relume.scene_io.surfaces.surface_parameters import BLACK, WHITE, SurfaceParameters
from relume.scene_io.surfaces.texture_resampling import NOISE, Raster
from relume.scene_io.surfaces.uv_transforms import UvSlot, UvTransforms, Wrap

F64 = NDArray[np.float64]
Image = tuple[U8, Wrap]
_NORMAL: dict[str, Any] = {"factor": (2.0, 2.0, 2.0), "bias": (-1.0, -1.0, -1.0)}  # of bytes


class TextureSource(Protocol):
    """Images of a document, see `relume.scene_io.surfaces.surface_images.SurfaceImages`."""

    def pixels(self, file: str, label: str) -> Pixels | None: ...


class TextureLayout(NamedTuple):
    """Texture coordinates of a material: their slot, height and width of its largest image, and its wrap modes."""

    slot: UvSlot
    size: tuple[int, int]
    wrap: Wrap


@dataclass(frozen=True)
class PackedTexture:
    """Channels of images that are read together.

    Attributes:
        name: for messages. channels: image by the channels that it fills.
        is_plain: the bytes of the texture are those of its only image.
    """

    name: str
    channels: Mapping[str, ImageInput]
    encoding: Encoding
    is_plain: bool

    @property
    def first(self) -> ImageInput:
        """The image that decides on UV coordinates and wrap modes."""
        return next(iter(self.channels.values()))

    @property
    def slot(self) -> UvSlot:
        """Its UV coordinates."""
        return UvSlot(self.first.uv_set, self.first.transform)


class MaterialTextures:
    """The textures of one material.

    Attributes:
        transforms: common UV coordinates.
    """

    def __init__(
        self,
        images: TextureSource,
        surface: SurfaceParameters,
        colors: TexturedColors | None,
        label: str,
        warnings: list[ImporterWarning],
    ) -> None:
        """
        Args:
            images: of the document. surface: parameters; their images can be used. colors: vertex colors.
            label: names the material in warnings. warnings: gets a sentence for each approximation.
        """
        self._images, self._surface, self._colors = images, surface, colors
        self._label, self._warnings = label, warnings
        groups = _groups(surface)
        self._textures = {key: texture for key, group in groups.items() if (texture := _packed(group)) is not None}
        self._warn_clamped(groups.values())
        self.transforms = UvTransforms([texture.slot for texture in self._textures.values()], label, warnings)

    def _warn_clamped(self, groups: Iterable[_Group]) -> None:
        """Warn about images that are brighter than 1 in the file, where textures cannot be."""
        for group in groups:
            images = [value for value in group.values.values() if isinstance(value, ImageInput)]
            if (
                np.isfinite(group.maximum)
                and group.encoding != "normal"
                and any(max(np.add(image.factor, image.bias)) > group.maximum for image in images)
            ):
                message = f"Values above {group.maximum:g} of the {group.name} texture of {self._label} are clamped."
                self._warnings.append(approximated(message))

    def layout(self) -> TextureLayout | None:
        """Place and size of the textures; None without any."""
        if not self._textures:
            return None
        shapes = [self._tiled(texture)[0].shape for texture in self._textures.values()]
        size = max(height for height, *_ in shapes), max(width for _, width, *_ in shapes)
        return TextureLayout(self.transforms.slot, size, next(iter(self._textures.values())).first.wrap)

    def load(self, key: str) -> Image | None:
        """RGBA and wrap modes of "base", "packed", "normal", "specular", "tint" or "emission"; None without images.

        "base" is multiplied by the vertex colors; "packed" has roughness in green, and metallic in blue.
        """
        image = self._tiled(self._textures[key]) if key in self._textures else None
        if self._colors is None:
            return image
        placed = None if image is None else self._colors.place(*image)
        if key != "base":
            return placed
        return self._colors.image if placed is None else self._colors.multiply(placed[0]), self._colors.wrap

    def raster(self) -> Raster:
        """The textures of the base layer, resampled to the size of the first."""
        images = {key: image for key in ("base", "packed", "specular", "tint") if (image := self.load(key)) is not None}
        tiled = [
            images[key][0].shape
            for key in images
            if key in self._textures and self.transforms.is_tiled(self._textures[key].slot)
        ]
        return Raster(images, (max((h for h, _, _ in tiled), default=0), max((w for _, w, _ in tiled), default=0)))

    def mean(self, value: Scalar | Color, name: str) -> Shaped[F64, " 3"]:
        """A constant, or the mean of an image with a warning if it varies.

        Args:
            value: of a parameter; a number three times. name: of its texture, for messages.
        """
        if not isinstance(value, ImageInput):
            return np.array(np.broadcast_to(value, 3), np.float64)
        label = f"{name} texture of {self._label}"
        pixels = self.pixels(value, name)
        sources = [CHANNELS.index(letter) for letter in value.channel]
        means = [mean_of_channel(pixels, source, value.is_srgb) for source in sources]
        if max(float(np.ptp(pixels[..., source])) for source in sources if source < pixels.shape[2]) > (
            NOISE if pixels.dtype == np.uint8 else NOISE / 255
        ):
            self._warnings.append(approximated(f"The {label} was replaced by its average."))
        return np.asarray(np.array(means) * value.factor + value.bias)

    def pixels(self, image: ImageInput, name: str) -> Pixels:
        """The pixels of an image as they are. name: of the texture, for messages."""
        pixels = self._images.pixels(image.file, f"the {name} texture of {self._label}")
        return np.full((1, 1, 4), 255, np.uint8) if pixels is None else pixels

    def _tiled(self, texture: PackedTexture) -> Image:
        wrap = texture.first.wrap
        return self.transforms.tile_image(texture.slot, self._pack(texture), wrap), wrap

    def _pack(self, texture: PackedTexture) -> Shaped[U8, "height width 4"]:
        sources = {key: self.pixels(image, texture.name) for key, image in texture.channels.items()}
        if texture.is_plain and (plain := next(iter(sources.values()))).dtype == np.uint8:
            return np.asarray(plain, np.uint8)
        if any((image.uv_set, image.transform, image.wrap) != (
            texture.first.uv_set, texture.first.transform, texture.first.wrap
        ) for image in texture.channels.values()):  # fmt: skip
            message = f"Images of {self._label} that are used together repeat differently; all repeat as the first."
            self._warnings.append(approximated(message))
        height, width = (max(pixels.shape[axis] for pixels in sources.values()) for axis in (0, 1))
        packed = np.full((height, width, 4), 255, np.uint8)
        for key, image in texture.channels.items():
            for number, letter in enumerate(key):
                encoding: Encoding = "linear" if letter == "a" else texture.encoding
                values = encode_channel(sources[key], image, number, encoding)
                packed[..., CHANNELS.index(letter)] = _resized(values, height, width)
        return packed


def split_factor(value: Scalar | Color, maximum: float = 1.0) -> Shaped[F64, " 3"]:
    """The factor of a parameter, apart from its texture.

    Args:
        value: of a parameter. maximum: of the factor.
    """
    if isinstance(value, ImageInput):
        return _split(value, maximum)[0]
    return np.asarray(np.clip(np.broadcast_to(np.asarray(value, np.float64), 3), 0, maximum))


def _split(image: ImageInput, maximum: float) -> tuple[Shaped[F64, " 3"], dict[str, Any]]:
    """A factor, and the factor and bias of an image with values in [0, 1]."""
    factor, bias = np.array(image.factor), np.array(image.bias)
    if not bias.any() and (factor >= 0).all() and (factor <= maximum).all():
        return factor, {"factor": WHITE}
    peak = float(np.clip(np.maximum(bias, factor + bias).max(), 1, maximum))
    return np.full(3, peak), {"factor": tuple((factor / peak).tolist()), "bias": tuple((bias / peak).tolist())}


def split_strength(normal: ImageInput) -> tuple[float, ImageInput]:
    """Split normals into the strength of x and y, and normals whose texels are bytes as they are, if possible."""
    strength = normal.factor[0] / 2
    is_scaled = normal.factor == (2 * strength, 2 * strength, 2.0) and normal.bias == (-strength, -strength, -1.0)
    return (strength, replace(normal, **_NORMAL)) if is_scaled else (1.0, normal)


class _Group(NamedTuple):
    """Parameters that are read together. maximum: of their factors."""

    name: str
    values: dict[str, Scalar | Color]
    encoding: Encoding
    maximum: float = 1.0


def _groups(surface: SurfaceParameters) -> dict[str, _Group]:
    """Parameters by channel of each texture, the most important first."""
    alpha: dict[str, Scalar | Color] = {} if surface.alpha_mode == "OPAQUE" else {"a": surface.alpha}
    groups = {
        "base": _Group("base color", {"rgb": surface.base_color, **alpha}, "srgb"),
        "packed": _Group("metallic-roughness", {"g": surface.roughness, "b": surface.metallic}, "linear"),
        "specular": _Group("specular", {"a": surface.specular}, "linear"),
        "tint": _Group("specular color", {"rgb": surface.specular_color}, "srgb", np.inf),
    }
    if surface.normal is not None:
        groups["normal"] = _Group("normal", {"rgb": split_strength(surface.normal)[1]}, "normal")
    if surface.emission_strength > 0:
        groups["emission"] = _Group("emission", {"rgb": surface.emission}, "srgb", np.inf)
    return {key: groups[key] for key in ("base", "packed", "normal", "specular", "tint", "emission") if key in groups}


def _packed(group: _Group) -> PackedTexture | None:
    """The texture of the parameters that are images; None if there is none."""
    name, values, encoding, maximum = group
    channels = {key: value for key, value in values.items() if isinstance(value, ImageInput)}
    if encoding != "normal":
        channels = {key: replace(value, **_split(value, maximum)[1]) for key, value in channels.items()}
    if not channels:
        return None
    first = next(iter(channels.values()))
    is_plain = len(channels) == len(values) and all(
        image == replace(first, channel=key, default=image.default, **_bytes_as_they_are(key, encoding, image))
        for key, image in channels.items()
    )
    return PackedTexture(name, channels, encoding, is_plain)


def _bytes_as_they_are(key: str, encoding: Encoding, image: ImageInput) -> dict[str, Any]:
    """Fields of an image whose bytes are those of a texture."""
    space = {"is_srgb": image.is_srgb if key == "a" else encoding == "srgb"}
    return space | (_NORMAL if encoding == "normal" else {"factor": WHITE, "bias": BLACK})


def _resized(values: Shaped[U8, "height width"], height: int, width: int) -> Shaped[U8, "height width"]:
    if values.shape == (height, width):
        return values
    image = PIL.Image.fromarray(np.ascontiguousarray(values))
    return np.asarray(image.resize((width, height), PIL.Image.Resampling.BILINEAR))
