"""The inputs of one surface: constants and images by name, checked and with the defaults of its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.scene_io.surfaces.surface_images import ImageInput, SurfaceImages

Rgb = tuple[float, float, float]
Scalar = float | ImageInput
Color = Rgb | ImageInput
Value = float | Rgb | ImageInput
_ONE: Rgb = (1.0, 1.0, 1.0)


class SurfaceInputs:
    """Inputs of one surface.

    Args:
        values: those that the document sets, by name.
        images: of the document. label: names the material in warnings.
        warnings: gets a sentence for each value that cannot be used as it is.
    """

    def __init__(
        self, values: Mapping[str, Value], images: SurfaceImages, label: str, warnings: list[ImporterWarning]
    ) -> None:
        self._values, self._images, self.label, self._warnings = values, images, label, warnings

    def warn_approximated(self, sentence: str) -> None:
        """Add a warning about something that looks almost as in the document."""
        self._warnings.append(approximated(sentence))

    def warn_unsupported(self, sentence: str) -> None:
        """Add a warning about something that looks different from the document."""
        self._warnings.append(unsupported(sentence))

    def color(self, name: str, default: Rgb, maximum: float = 1.0) -> Color:
        """A color, at least 0 per channel.

        Args:
            name: of the input. default: of the model. maximum: larger constants are clamped, with a warning.
        """
        value = self._value(name, default, maximum)
        if isinstance(value, ImageInput):
            return replace(value, is_srgb=value.is_srgb is not False)
        return (value, value, value) if isinstance(value, float) else value

    def scalar(self, name: str, default: float, maximum: float = 1.0) -> Scalar:
        """A number, at least 0; of a color the mean. Arguments as in `color`: name, default, maximum."""
        value = self._value(name, default, maximum)
        if isinstance(value, ImageInput):
            return replace(_first_channel(value), is_srgb=bool(value.is_srgb))
        return float(np.mean(value)) if isinstance(value, tuple) else value

    def number(self, name: str, default: float, maximum: float = 1.0) -> float:
        """As `scalar`, and the mean of an image, with a warning; name, default, maximum."""
        return self.mean(name, self.scalar(name, default, maximum))[0]

    def constant_color(self, name: str, default: Rgb, maximum: float = 1.0) -> Rgb:
        """As `color`, and the mean of an image, with a warning; name, default, maximum."""
        return self.mean(name, self.color(name, default, maximum))

    def is_image(self, name: str) -> bool:
        """True if the input is an image, even one that cannot be used."""
        return isinstance(self._values.get(name), ImageInput)

    def normal(self, name: str) -> ImageInput | None:
        """A normal map, whose values are vectors; None without one."""
        value = self._values.get(name)
        pixels = self._images.pixels(value.file, self._describe(name)) if isinstance(value, ImageInput) else None
        if not isinstance(value, ImageInput) or pixels is None:
            return None
        if pixels.dtype == np.uint8 and value.factor == _ONE and value.bias == (0.0, 0.0, 0.0):
            # bytes as vectors would all lean to one side: exporters forget the scale
            self.warn_approximated(f"{name} of {self.label} lacks the scale of normals; it is read as (n + 1) / 2.")
            value = encoded_normals(value, _ONE)
        return replace(value, is_srgb=bool(value.is_srgb))

    def mean(self, name: str, value: Value) -> Rgb:
        """Three equal numbers of a number; a color; the mean of an image, with a warning.

        Args:
            name: of the input. value: its value.
        """
        if not isinstance(value, ImageInput):
            return value if isinstance(value, tuple) else (value, value, value)
        self.warn_approximated(f"The {self._describe(name)} was replaced by its average.")
        red, green, blue = self._images.mean(value, self._describe(name)).tolist()
        return red, green, blue

    def weighted_color(self, weight_name: str, weight: Scalar, color: Color) -> Color:
        """A color times a weight; of two images, the weight's mean is used.

        Args:
            weight_name: names the input of the weight in warnings. weight, color: constants or images.
        """
        if isinstance(weight, ImageInput) and not isinstance(color, ImageInput):
            return scaled(weight, color)
        return scaled(color, self.mean(weight_name, weight))

    def _value(self, name: str, default: Value, maximum: float) -> Value:
        if name not in self._values:
            return default
        value = self._values[name]
        if not isinstance(value, ImageInput):
            return self._clamped(name, value, default, maximum)
        if self._images.pixels(value.file, self._describe(name)) is not None:
            return value
        return default if value.default is None else self._clamped(name, value.default, default, maximum)

    def _clamped(self, name: str, value: float | Rgb, default: Value, maximum: float) -> Value:
        numbers = np.array(value, np.float64)
        if not np.isfinite(numbers).all():
            self.warn_unsupported(f"{name} of {self.label} is not a number; its default is used.")
            return default
        clamped = np.clip(numbers, 0, maximum)
        if (clamped != numbers).any():
            self.warn_approximated(f"{name} of {self.label} was clamped to [0, {maximum:g}].")
        return float(clamped) if clamped.ndim == 0 else (float(clamped[0]), float(clamped[1]), float(clamped[2]))

    def _describe(self, name: str) -> str:
        return f"image of {name} of {self.label}"


def encoded_normals(image: ImageInput, scale: Rgb) -> ImageInput:
    """Normals as vectors, of an image whose texels are (n + 1) / 2.

    Args:
        image: the image. scale: of x and y.
    """
    strength = np.array([scale[0], scale[1], 1.0])
    (x, y, z), (u, v, w) = (strength * 2 * image.factor).tolist(), (strength * (2 * np.array(image.bias) - 1)).tolist()
    return replace(image, factor=(x, y, z), bias=(u, v, w), is_srgb=False, default=None)


def channel(value: Value, name: str) -> Value:
    """One channel of a color.

    Args:
        value: the color. name: "r", "g", "b" or "a".
    """
    if isinstance(value, ImageInput):
        if name == value.channel:
            return value
        index = "rgba".index(name)
        factor, bias, default = (_repeated(row, index) for row in (value.factor, value.bias, value.default))
        return replace(value, channel=name, factor=factor or _ONE, bias=bias or (0.0, 0.0, 0.0), default=default)
    if isinstance(value, tuple):
        return value["rgb".index(name)] if name != "a" else 1.0
    return value


def _first_channel(image: ImageInput) -> ImageInput:
    first = channel(image, image.channel[0])
    assert isinstance(first, ImageInput)
    return first


def scaled(color: Color, factor: Rgb) -> Color:
    """Multiply a color by another."""
    if not isinstance(color, ImageInput):
        return _product(color, factor)
    default = None if color.default is None else _product(color.default, factor)
    return replace(color, factor=_product(color.factor, factor), bias=_product(color.bias, factor), default=default)


def lerp(a: Rgb, b: Rgb, weight: float) -> Rgb:
    """Interpolate colors linearly, from a at weight 0 to b at weight 1."""
    red, green, blue = (np.array(a) * (1 - weight) + np.array(b) * weight).tolist()
    return red, green, blue


def _product(a: Rgb, b: Rgb) -> Rgb:
    red, green, blue = (np.array(a) * b).tolist()
    return red, green, blue


def _repeated(numbers: Rgb | None, index: int) -> Rgb | None:
    """One of three numbers, for all channels; None of what has no alpha."""
    return None if numbers is None or index > 2 else (numbers[index],) * 3
